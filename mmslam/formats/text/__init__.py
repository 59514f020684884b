"""Text files of numbers: tables with named columns (RFC 4180 and its kin), and plain matrices."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
