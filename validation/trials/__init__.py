"""Drawn echoes, hidden users and targets, and rooms prone to wrong answers.

Shared by experiments and claims.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
