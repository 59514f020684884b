from .band_interpolation import band_fields
from .conducting_contour import Contour, circle, closed_contour, open_strip
from .ghost_comparison import compare_ghosts
from .hodlr_solver import chosen_columns, compress, solve
from .line_source import LineSource, greens_function, radial_derivative
from .log_quadrature import log_weights, missing_logarithm
from .method_of_moments import (
    conductors_matrix,
    incident,
    received,
    scattered_fields,
    strip_entries,
)
from .strip_scattering import FullWaveError, StripFields, StripScene, strip_fields, strip_response
from .wall_comparison import Agreement, compare_with_full_wave, complex_source_beam, read_reference

__all__ = [
    "Agreement",
    "Contour",
    "FullWaveError",
    "LineSource",
    "StripFields",
    "StripScene",
    "band_fields",
    "chosen_columns",
    "circle",
    "closed_contour",
    "compare_ghosts",
    "compare_with_full_wave",
    "complex_source_beam",
    "compress",
    "conductors_matrix",
    "greens_function",
    "incident",
    "log_weights",
    "missing_logarithm",
    "open_strip",
    "radial_derivative",
    "read_reference",
    "received",
    "scattered_fields",
    "solve",
    "strip_entries",
    "strip_fields",
    "strip_response",
]
