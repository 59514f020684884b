"""One spherical wave, fitted: angle, delay and curvature with their covariance.

Maximum-likelihood fits at a linear (``_2d``) or a planar array (``_3d``), searches for the
curvature to begin with, the noise that remains, and what phase errors of the radio add.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
