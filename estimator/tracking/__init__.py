"""Users that move: answers of successive measurements joined to tracks.

A constant-velocity Kalman filter and smoother over many hypotheses, which drop outliers, decide
ambiguous answers and bridge times without any.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
