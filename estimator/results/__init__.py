"""What the estimator answers: users, mirrors, targets and images, as plain data.

Every field has its unit beside it. Nothing here draws or prints: ``mmslam.Estimate`` adds that.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
