"""Import the estimator first: it points Dr.Jit to an LLVM that works before anything loads it."""

import importlib
import os

os.environ["MPLBACKEND"] = "Agg"  # no test may need a display

importlib.import_module("estimator")
