"""Rooms that nobody drew: a written prior over rooms, and how the estimator fares in them.

Rooms for tuning and rooms for judging have seeds of their own. An oracle that is given the true
walls and paths says what could be answered; scores compare. Rooms drawn by hand are those of
:mod:`validation.trials.trap_rooms`.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
