"""The tables of a mapping file: frequencies, times, positions and samples, with their keys.

Each is checked as it is read, before any data: see :mod:`mmslam.formats.mapping` for the whole.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
