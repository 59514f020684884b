"""Pages that one looks into: plan, volumes, tracks and rooms, drawn by Plotly without a network."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
