"""From a measurement to mirrors, targets and users: the estimator's complete pipeline.

:func:`locate` runs the stages: image, walls, map, paths, positions. It sees a measurement and
nothing else: no scene, no truth.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
