from .exit_codes import stdout_kept_clean, told_clearly
from .interruption import ResumableInterruption, interruptions_held
from .stage_progress import StageProgress
from .summary import measurement_summary, summary_lines
from .task_progress import WorkProgress, told_size, told_time

__all__ = [
    "ResumableInterruption",
    "StageProgress",
    "WorkProgress",
    "interruptions_held",
    "measurement_summary",
    "stdout_kept_clean",
    "summary_lines",
    "told_clearly",
    "told_size",
    "told_time",
]
