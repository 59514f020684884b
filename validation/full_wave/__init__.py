"""Two-dimensional full wave, by the method of moments: the reference for the simulator.

A solver for perfect conductors (TM_z), hierarchical so that long walls fit, and comparisons with
physical optics on the very same profile.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
