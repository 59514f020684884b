"""Users and mirrors from lists of paths, by what the paths of many places agree on.

A base station that knows no room proposes a mirror from each path, lets all others vote, and fits
users, mirrors and the clock together. What cannot be told apart is left open.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
