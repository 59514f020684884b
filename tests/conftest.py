"""Import the estimator first: it points Dr.Jit to an LLVM that works before anything loads it."""

import importlib
import os
import signal
import sys
from pathlib import Path

from threadpoolctl import threadpool_limits

from tests import type_checks

os.environ["MPLBACKEND"] = "Agg"  # no test may need a display
# Two workers test on two cores: more threads of BLAS wait for work by spinning.
os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # of what is loaded or started from here on
threadpool_limits(limits=1, user_api="blas")  # numpy's, which is loaded already

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


def pytest_runtest_setup() -> None:
    """Check the first calls of each function anew."""
    type_checks.begin()
