"""What an array's shape and the focus itself say of a mapping: boresight, sign and delays."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
