from .array_frame import ArrayFrame
from .field_regions import curvature, far_field_distance, field_region, fresnel_distance
from .linear_array import echo_reach, echo_resolution, imaged_sine
from .planar_array import PlanarArray, planar_frame, planar_reach, planar_resolution, spans_a_plane
from .resolution import (
    aliased,
    aliasing_note,
    angular_resolution,
    cell_at,
    cross_range_resolution,
    largest_frequency_step,
    largest_spacing,
    phase_per_frequency_step,
    range_resolution,
    unaliased_sine,
    unambiguous_range,
)
from .resolution_cell import Resolution, coarse_resolution
from .windows import Window, aperture_taper, frequency_taper, survey_weights

__all__ = [
    "ArrayFrame",
    "PlanarArray",
    "Resolution",
    "Window",
    "aliased",
    "aliasing_note",
    "angular_resolution",
    "aperture_taper",
    "cell_at",
    "coarse_resolution",
    "cross_range_resolution",
    "curvature",
    "echo_reach",
    "echo_resolution",
    "far_field_distance",
    "field_region",
    "frequency_taper",
    "fresnel_distance",
    "imaged_sine",
    "largest_frequency_step",
    "largest_spacing",
    "phase_per_frequency_step",
    "planar_frame",
    "planar_reach",
    "planar_resolution",
    "range_resolution",
    "spans_a_plane",
    "survey_weights",
    "unaliased_sine",
    "unambiguous_range",
]
