"""Frozen rough surfaces: an object's mean shape plus one drawn realisation of heights.

The same seed gives the same surface, whatever else is in the scene; it can be exported as a mesh.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
