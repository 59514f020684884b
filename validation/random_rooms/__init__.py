"""Random rooms: a stated prior over rooms, and the estimator's performance in them.

Rooms for tuning and rooms for judging have separate seeds. An oracle with the true walls and paths
determines which users can be located; estimates are scored. Rooms designed by hand are those of
:mod:`validation.trials.trap_rooms`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
