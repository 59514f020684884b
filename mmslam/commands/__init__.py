"""The commands without their command-line options: compute, write files, return lines of text.

Each module serves one command and the function of the same purpose in ``mmslam``.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
