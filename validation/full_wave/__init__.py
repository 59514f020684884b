"""Two-dimensional full wave, by boundary integral equations: the reference for the simulator.

Conductors and homogeneous dielectrics, open strips and closed bodies with corners, TM and TE,
solved hierarchically for long walls; whole scenarios; and comparisons with physical optics on the
same profile.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
