"""Errors of estimates against the truth, and the calibration of their stated uncertainty.

The truth is read only here, after the estimate was made. Errors of users, walls and targets;
coverage of covariances; quality of images.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
