"""What cannot be is refused, before any work.

Arrays inside walls, solids inside one another, missing files, more facets than memory holds: each
problem names the key, the value, the limit and the remedy.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
