from .impairments import position_jitter
from .receiver import received

__all__ = [
    "position_jitter",
    "received",
]
