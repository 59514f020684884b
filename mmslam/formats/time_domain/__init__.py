"""What is not a stepped sweep: traces over time, beats of a chirp, and recorders' own files."""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
