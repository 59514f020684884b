"""The channel of one user's pilot: angle/range maps, and the paths that make it up.

A spherical-wave matched filter over angle and path length (3-10), steering vectors, MUSIC, and the
extraction of all significant paths by RELAX. A linear array hears angles on a cone (``_2d``), a
planar one directions in space (``_3d``).
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
