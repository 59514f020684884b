"""Fast factorised back-projection: parts of a linear array are imaged coarsely, and added.

A polar grid of ranges and sines, which parts of the array sample on few sines, and points anywhere,
which are read from it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
