"""A scenario for other programs: a Sionna RT scene, Mitsuba XML and PLY meshes.

Smooth surfaces for ray tracers; frozen facets too, where their number allows it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
