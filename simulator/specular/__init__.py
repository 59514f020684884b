"""Specular paths by the image method, and the fields along them.

Chains of mirrors on mean planes with finite extents; every segment is tested for blockage, every
bounce has its slab's coefficient at all frequencies and the coherent loss of its roughness.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
