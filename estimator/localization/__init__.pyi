from .pipeline import locate

__all__ = [
    "locate",
]
