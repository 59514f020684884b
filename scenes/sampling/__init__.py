"""Distributions over a scenario's keys, and the samples drawn from them.

Sample n depends on the seed and n alone, and every key has a stream of its own. Impossible draws
are drawn again.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
