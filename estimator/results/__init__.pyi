from .deferred import Deferred
from .estimate import (
    AngleRangeMap,
    Check,
    CorrectedImage,
    DirectionMap,
    Estimate,
    Image,
    Images,
    Mirror,
    PathReport,
    Progress,
    Target,
    UserEstimate,
)
from .pixel_grid import PixelGrid

__all__ = [
    "AngleRangeMap",
    "Check",
    "CorrectedImage",
    "Deferred",
    "DirectionMap",
    "Estimate",
    "Image",
    "Images",
    "Mirror",
    "PathReport",
    "PixelGrid",
    "Progress",
    "Target",
    "UserEstimate",
]
