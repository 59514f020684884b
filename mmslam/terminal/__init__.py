"""What a terminal shows: progress, summaries, exit codes, and what Ctrl-C does.

Progress goes to stderr, answers to stdout.
"""

import lazy_loader

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
