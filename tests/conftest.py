"""Import the estimator first: it points Dr.Jit to an LLVM that works before anything loads it."""

import importlib
import os
import signal
import sys
from pathlib import Path

os.environ["MPLBACKEND"] = "Agg"  # no test may need a display

if os.environ.pop("PYTHONDONTWRITEBYTECODE", None) is not None:
    # No bytecode beside the sources, then; but commands that tests start would compile all they
    # import, each anew: seconds of the processor for each.
    kept = Path(__file__).resolve().parents[1] / ".pytest_cache" / "bytecode"
    sys.pycache_prefix = os.environ["PYTHONPYCACHEPREFIX"] = str(kept)
    sys.dont_write_bytecode = False

if signal.getsignal(signal.SIGINT) is signal.SIG_IGN:
    # What a shell starts in the background ignores Ctrl-C, and so would all that tests start.
    signal.signal(signal.SIGINT, signal.default_int_handler)

importlib.import_module("estimator")
