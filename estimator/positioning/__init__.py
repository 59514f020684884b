"""From a user's paths and the map to its position, or to why none can be told.

Hypotheses over chains of mirrors, weighted least squares over angles, delays and curvatures, checks
whether a straight path is what it seems, and the rules that decide. Where no mirror-like path
stands out, what rough walls scatter diffusely is searched.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
