"""Validation: estimates against the truth, the simulator against theory and full wave.

Only this package and the front door use both truth and estimate. A claim (``claims``) states a
figure, its limit and the limit's origin; experiments, bounds and closed forms measure it.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
