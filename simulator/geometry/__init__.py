"""Facets, patches, mean planes and rays: the geometry that fields are computed on.

Frozen surfaces are cut into facets; their mean surfaces are what reflects specularly and what
blocks rays. Lengths are computed in double precision: at 300 GHz a micrometre is 0.4°.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
