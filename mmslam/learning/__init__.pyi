from .hugging_face_folder import export_hugging_face
from .normalisation import Constants, normalisation_constants
from .room_split import PARTS, split_by_room
from .sample_stream import SampleStream
from .samples import Samples

__all__ = [
    "PARTS",
    "Constants",
    "SampleStream",
    "Samples",
    "export_hugging_face",
    "normalisation_constants",
    "split_by_room",
]
