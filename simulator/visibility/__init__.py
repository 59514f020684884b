"""Visibility between antennas and facets, and between facets.

Shafts decide for whole tiles first; rays are traced for the rest. Only the mean surfaces of other
bodies block: a surface does not hide itself by its own roughness.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
