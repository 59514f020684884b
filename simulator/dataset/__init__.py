"""Datasets: many samples of a varied scenario, by any number of workers, resumable.

Sample n depends on the seed and n alone. Two stores of one configuration are equal byte for byte,
whatever the number of workers and runs.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
