"""A scenario made ready to be simulated: frozen surfaces, mirrors, antennas; and its truth.

Also the specular paths that a plan of the scenario shows.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
