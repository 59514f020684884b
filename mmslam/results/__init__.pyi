from .document import dimensions, plain, result_document, to_json, versions
from .pictures_2d import save, write_pictures
from .report import radio_parameters, render_report

__all__ = [
    "dimensions",
    "plain",
    "radio_parameters",
    "render_report",
    "result_document",
    "save",
    "to_json",
    "versions",
    "write_pictures",
]
