from .dataset import chosen_workers, print_lines
from .design import design_document, design_lines, design_rows, scenario_radio
from .info import system_information
from .track import track_lines, track_to_folder

__all__ = [
    "chosen_workers",
    "design_document",
    "design_lines",
    "design_rows",
    "print_lines",
    "scenario_radio",
    "system_information",
    "track_lines",
    "track_to_folder",
]
