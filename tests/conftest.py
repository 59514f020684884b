"""Import the estimator first: it points Dr.Jit to an LLVM that works before anything loads it."""

import os

os.environ["MPLBACKEND"] = "Agg"  # no test may need a display

import estimator  # noqa: F401
