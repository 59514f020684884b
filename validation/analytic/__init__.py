"""Closed forms and series to which simulator and estimator are compared.

Point scatterers, plates, spheres and cylinders, mean power of rough plates, and Sionna RT's own
paths as a second method.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
