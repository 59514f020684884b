from .builder import (
    DatasetJob,
    Forecast,
    Summary,
    forecast,
    make_dataset,
    plan_dataset,
    progress_of,
)
from .config import DatasetConfig, content_text
from .layout import Layout
from .provenance import code_digest, package_versions
from .sample import make_row
from .store import DatasetError
from .task_runner import Result, Task, WorkError, Workers, compute_in_one_thread, work_off

__all__ = [
    "DatasetConfig",
    "DatasetError",
    "DatasetJob",
    "Forecast",
    "Layout",
    "Result",
    "Summary",
    "Task",
    "WorkError",
    "Workers",
    "code_digest",
    "compute_in_one_thread",
    "content_text",
    "forecast",
    "make_dataset",
    "make_row",
    "package_versions",
    "plan_dataset",
    "progress_of",
    "work_off",
]
