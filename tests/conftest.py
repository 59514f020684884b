"""Import the estimator first: it points Dr.Jit to an LLVM that works before anything loads it."""

import importlib
import os
import signal

os.environ["MPLBACKEND"] = "Agg"  # no test may need a display

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # What a shell starts in the background ignores Ctrl-C, and so would all that tests start.
    signal.signal(signal.SIGINT, signal.default_int_handler)

importlib.import_module("estimator")
