"""Arrays: their frame, their resolution, and what they image without grating lobes.

Linear and planar apertures in a frame of their own (origin at the centre, x along the array, y at
its boresight); resolution cells and sampling limits after (2-15) to (2-28) and field regions after
(3-1) to (3-3) of the thesis; tapers over frequency and aperture.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
