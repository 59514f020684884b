"""The ray-traced forward model: from a scenario to the measurement of it."""

from estimator.compute import engine

# Sionna aborts the whole process on an LLVM that is too old, so ask first.
engine.backend()
