"""Sums over many facets at all frequencies: non-uniform FFT and butterfly.

The cost of an echo does not grow with the number of frequencies. Every sum has a stated accuracy
and adds in an order that does not depend on threads.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
