"""Bounds on errors: Cramér–Rao for waves, walls and positions, and the floor by roughness.

No unbiased estimator has a smaller variance; ours is compared with these bounds.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
