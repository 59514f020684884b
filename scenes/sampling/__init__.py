"""Distributions over a scenario's keys, and the samples drawn from them.

Sample n depends only on the seed and n, and every key has its own random stream. Draws that give
an impossible scene are repeated.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
