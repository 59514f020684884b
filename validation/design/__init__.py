"""The numbers of a radio's design, by theory and as measured from simulated data.

Resolutions, unambiguous ranges, sampling steps and field regions.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
