"""Triangle meshes of other programs: PLY, OBJ, STL, OFF and Mitsuba XML.

Read from memory, cleaned and checked; nothing that they refer to is fetched.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
