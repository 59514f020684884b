from .impairments import complex_noise, position_jitter
from .receiver import received

__all__ = [
    "complex_noise",
    "position_jitter",
    "received",
]
