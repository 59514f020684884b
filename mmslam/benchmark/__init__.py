"""A public benchmark: three tracks, each with a frozen recipe, its parts and its scorer.

Find the mirrors, locate the user, predict the channel. Anyone makes the parts again from the
recipe, byte for byte; the truth of the test part is made by the scorer, from the recipe alone.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
