"""Images from an echo: back-projection, range migration, and the peaks that they show.

Range compression and back-projection onto any points, range migration (the ω-k algorithm with
Stolt interpolation, (2-13) and (2-14)) for linear and planar arrays, coarse surveys of all that an
array reaches, and peaks that stand out of the background.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
