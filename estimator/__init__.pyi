from .imaging import backproject, range_profiles
from .imaging.wavenumber.range_migration import range_migration
from .localization import locate
from .measurement import (
    Echo,
    Measurement,
    MeasurementError,
    Uplink,
    read_measurement,
    write_measurement,
)
from .prediction import predict_channel
from .results import AngleRangeMap, Estimate, Image, Mirror, PixelGrid, Target, UserEstimate
from .tracking import track

__all__ = [
    "AngleRangeMap",
    "Echo",
    "Estimate",
    "Image",
    "Measurement",
    "MeasurementError",
    "Mirror",
    "PixelGrid",
    "Target",
    "Uplink",
    "UserEstimate",
    "backproject",
    "locate",
    "predict_channel",
    "range_migration",
    "range_profiles",
    "read_measurement",
    "track",
    "write_measurement",
]
