from .dataset import chosen_workers, print_lines
from .info import system_information
from .track import track_lines, track_to_folder

__all__ = [
    "chosen_workers",
    "print_lines",
    "system_information",
    "track_lines",
    "track_to_folder",
]
