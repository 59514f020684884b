"""Other localization methods of the thesis' introduction, one per module, on our scenes.

Each gets the same measurement as our estimator, and states its additional inputs.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
