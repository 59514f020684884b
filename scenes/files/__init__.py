"""Scenario files: the library, TOML in and out, overrides by dotted path.

A scenario is loaded by name or path, changed key by key, checked as a whole, and written so that
its folder can be moved.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
