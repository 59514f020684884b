from .design_numbers import DesignNumbers, Number, measured_numbers
from .design_table import DesignRow

__all__ = [
    "DesignNumbers",
    "DesignRow",
    "Number",
    "measured_numbers",
]
