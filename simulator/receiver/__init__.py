"""The receiver: noise and the radio's flaws, each from a random stream of its own.

Thermal noise at a given SNR, phase noise, gain ripple, position jitter, clock offset and limited
dynamic range.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
