"""Fields over several surfaces, of which one may scatter diffusely.

In two dimensions by iterated physical optics, wall then target; in three by specular legs plus the
diffuse part of each wall. Few frequencies carry the band; the rest is interpolated.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
