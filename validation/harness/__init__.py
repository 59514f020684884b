"""Claims: their parts, runs, stored results and page.

A claim has our figure, its limit and the limit's origin. Planted errors test that claims fail if
the code is wrong.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
