"""The map of a room from its echo: walls at their true place, targets, the corrected image.

What the image shows behind a wall is a ghost and is unfolded over it. Targets are told from the
clouds that diffuse scattering leaves around their ghosts.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
