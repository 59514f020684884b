"""Figures: each function draws on an Axes and returns it.

Images, angle/range maps, plans of estimates (2-D and 3-D), and plans of scenarios.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
