"""Results: the estimate as tables and plots, as a JSON document, as figures and a report."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
