"""Datasets for learning: parts that share no room, normalisation, samples in batches, a card.

Nothing here imports PyTorch but `torch_dataset.py`, which is imported when it is asked for.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
