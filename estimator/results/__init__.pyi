from .estimate import (
    AngleRangeMap,
    CorrectedImage,
    DirectionMap,
    Estimate,
    Image,
    Mirror,
    PathReport,
    Progress,
    Target,
    UserEstimate,
)
from .pixel_grid import PixelGrid

__all__ = [
    "AngleRangeMap",
    "CorrectedImage",
    "DirectionMap",
    "Estimate",
    "Image",
    "Mirror",
    "PathReport",
    "PixelGrid",
    "Progress",
    "Target",
    "UserEstimate",
]
