"""Materials: permittivity over frequency, slabs, and their reflection coefficients.

Conductors, absorbers and dielectric slabs after ITU-R P.2040-4 or from tables; coefficients at
every frequency and angle, on tables where many facets need them.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
