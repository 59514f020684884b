"""Checks of a mapping by the array's shape and the focused image: boresight, sign, delays."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
