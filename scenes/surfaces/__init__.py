"""Shapes and their roughness: cut finely enough, displaced by drawn heights.

Plates, cylinders, boxes and meshes as grids of facets (lines in 2-D, triangles in 3-D), and rough
profiles by spectral synthesis.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
