"""Consistency checks of a scenario, made before anything is simulated.

They find arrays inside walls, overlapping solids, missing files, and more facets than memory
holds. Each message names the key, the value, the limit and the remedy.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
