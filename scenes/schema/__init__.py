"""The parts of a scenario as typed, checked models: one file for each table of the TOML.

Every key carries its unit in its name; its description and limits make the JSON schema.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
