"""Scenarios, the ground truth: shapes, frozen rough surfaces, and a library of examples.

World frame, right-handed, metres: x cross-range (along a linear array), y range
(boresight), z up. Files and the command line use degrees, GHz and mm, with the unit in the
key's name; everything that leaves this package is SI and radians.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
