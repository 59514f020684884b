"""Time-domain data: traces over time, beat signals of a chirp, and recorders' file formats."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
