"""Fields over several surfaces, of which one may scatter diffusely.

In two dimensions by iterative physical optics, wall then target; in three by specular legs plus the
diffuse part of each wall. Waves are computed at few frequencies and interpolated over the band.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
