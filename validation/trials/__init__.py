"""Rooms drawn at random, hidden users and targets, and rooms that invite wrong answers.

Shared by experiments and claims.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
