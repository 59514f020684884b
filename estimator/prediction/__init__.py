"""The channel that a map implies: paths of a user with angle, delay and level.

Predicted from walls and positions alone, to save pilots. How strongly walls reflect is learnt from
users that are located already; without any, an assumption is stated.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
