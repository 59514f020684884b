"""Sweeps: errors over a grid of a scenario's keys, with bounds; tables and figures.

Results are cached under a digest of all that they depend on, so that a sweep can be interrupted and
extended.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
