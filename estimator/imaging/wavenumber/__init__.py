"""Images of arrays on a uniform grid by Fourier transforms, in the wavenumber domain.

Range migration (the ω-k algorithm with Stolt's interpolation, (2-13) and (2-14)) over a band, and
the angular spectrum of the few frequencies of a hologram.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
