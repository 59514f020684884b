"""How far an estimate is from the truth, and whether its stated uncertainty is honest.

The truth is read here, after the estimate was made. Errors of users, walls and targets; coverage of
covariances; quality of images.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
