"""Received signals of a scene: echo, uplinks, bistatic and multistatic responses.

Each function turns a scene into complex samples over antennas and frequencies, without noise.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
