from .bounds import position_error_bound, scenario_position_bound
from .claims import ALL_CLAIMS
from .harness import Claim
from .metrics import Truth, position_error, read_truth, wall_errors
from .sweep import plan_sweep, run_sweep

__all__ = [
    "ALL_CLAIMS",
    "Claim",
    "Truth",
    "plan_sweep",
    "position_error",
    "position_error_bound",
    "read_truth",
    "run_sweep",
    "scenario_position_bound",
    "wall_errors",
]
