"""What claims are made of, how they are run, kept and told.

A claim has our figure, its limit and where that comes from. Planted errors show that figures would
turn red.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
