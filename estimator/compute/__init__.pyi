from .blas_threads import one_blas_thread
from .engine import EngineError, thread_count
from .integer_division import row_and_column
from .sincos import sincos_of_turns

__all__ = [
    "EngineError",
    "one_blas_thread",
    "row_and_column",
    "sincos_of_turns",
    "thread_count",
]
