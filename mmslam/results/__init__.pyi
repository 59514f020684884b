from .document import dimensions, plain, result_document, to_json, versions
from .estimate import Estimate
from .pictures_2d import save, write_pictures
from .report import radio_parameters, render_report
from .sweeps import Sweep, told_bound
from .tracks import Tracks

__all__ = [
    "Estimate",
    "Sweep",
    "Tracks",
    "dimensions",
    "plain",
    "radio_parameters",
    "render_report",
    "result_document",
    "save",
    "to_json",
    "told_bound",
    "versions",
    "write_pictures",
]
