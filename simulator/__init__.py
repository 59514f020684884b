"""The ray-traced forward model: from a scenario to its simulated measurement.

Physical optics on one frozen realisation of every rough surface, the same for all antennas and
frequencies, with specular paths by the image method. It shares the data model and Dr.Jit's
backend with the estimator, and no algorithm.
"""

import lazy_loader

from estimator.compute import engine

# Sionna aborts the whole process if LLVM is too old: check first.
engine.backend()

__getattr__, __dir__, __all__ = lazy_loader.attach_stub(__name__, __file__)
