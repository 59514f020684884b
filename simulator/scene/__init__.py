"""Preparation of a scenario for simulation: frozen surfaces, mirrors, antennas; and its truth.

Also the specular paths drawn in the plan of a scenario.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
