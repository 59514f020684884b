"""Facets, patches, mean planes and rays: the geometry on which fields are computed.

Frozen surfaces are divided into facets; their mean surfaces reflect specularly and block rays.
Lengths are computed in double precision: at 300 GHz a micrometre is 0.4° of phase.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
