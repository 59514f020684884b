"""Who sees whom: antennas and facets, facets and facets.

Whole beams are culled by shafts first; rays decide what is left. Only other bodies' mean surfaces
block: a surface does not hide itself by its own roughness.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
