from .band_interpolation import band_fields, interpolated_fields
from .boundary_equations import Body, BoundaryProblem, Polarisation, dense_fields
from .conducting_contour import Contour, circle, closed_contour, closed_profile, open_strip
from .direct_solution import FullWaveError, array_fields, echo_fields, link_fields
from .ghost_comparison import compare_ghosts
from .graded_contour import box, cornered_contour
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
from .profile_scattering import profile_body, profile_fields
from .scenario_solution import full_wave_scenario, solve_scenario
from .strip_scattering import StripFields, StripScene, strip_fields, strip_response
from .wall_comparison import Agreement, compare_with_full_wave, complex_source_beam, read_reference

__all__ = [
    "Agreement",
    "Body",
    "BoundaryProblem",
    "Contour",
    "FullWaveError",
    "LineSource",
    "Polarisation",
    "StripFields",
    "StripScene",
    "array_fields",
    "band_fields",
    "box",
    "chosen_columns",
    "circle",
    "closed_contour",
    "closed_profile",
    "compare_ghosts",
    "compare_with_full_wave",
    "complex_source_beam",
    "compress",
    "conductors_matrix",
    "cornered_contour",
    "dense_fields",
    "echo_fields",
    "full_wave_scenario",
    "greens_function",
    "incident",
    "interpolated_fields",
    "link_fields",
    "log_weights",
    "missing_logarithm",
    "open_strip",
    "profile_body",
    "profile_fields",
    "radial_derivative",
    "read_reference",
    "received",
    "scattered_fields",
    "solve",
    "solve_scenario",
    "strip_entries",
    "strip_fields",
    "strip_response",
]
