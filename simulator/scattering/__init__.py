"""Scattering by rough facets: physical optics and the kernels that evaluate it.

Every facet has its own normal, area, Fresnel coefficient and visibility from both ends; the same
facets are seen from every antenna and at every frequency.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
