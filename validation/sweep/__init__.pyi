from .figures import draw_distribution, draw_errors, draw_found
from .noise_free import noise_free_key, with_receiver
from .sweep import (
    Outcome,
    SweepConfig,
    SweepJob,
    missing_points,
    plan_sweep,
    run_point,
    run_sweep,
    statistics,
)
from .tables import error_dataset, error_table

__all__ = [
    "Outcome",
    "SweepConfig",
    "SweepJob",
    "draw_distribution",
    "draw_errors",
    "draw_found",
    "error_dataset",
    "error_table",
    "missing_points",
    "noise_free_key",
    "plan_sweep",
    "run_point",
    "run_sweep",
    "statistics",
    "with_receiver",
]
