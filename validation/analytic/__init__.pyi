from .canonical_scatterers import (
    cylinder_echo_over_series,
    facets_cross_section,
    half_shadowed_plate,
    mean_specular_field,
    plate_cross_section,
    plate_facets,
    ports,
    sphere_series,
)
from .line_source_scattering import cylinder_field, slab_fields, wedge_field
from .plates_in_turn import over_plates, plate_cells
from .point_scatterer import complex_noise, point_echo, point_uplink
from .rough_plate import Antennas, coherent_loss, mean_diffuse_power, mirror_link
from .sionna_paths import (
    RandomScene,
    compare_paths,
    distance_from_edges,
    our_paths,
    random_scene,
    solver_scene,
)

__all__ = [
    "Antennas",
    "RandomScene",
    "coherent_loss",
    "compare_paths",
    "complex_noise",
    "cylinder_echo_over_series",
    "cylinder_field",
    "distance_from_edges",
    "facets_cross_section",
    "half_shadowed_plate",
    "mean_diffuse_power",
    "mean_specular_field",
    "mirror_link",
    "our_paths",
    "over_plates",
    "plate_cells",
    "plate_cross_section",
    "plate_facets",
    "point_echo",
    "point_uplink",
    "ports",
    "random_scene",
    "slab_fields",
    "solver_scene",
    "sphere_series",
    "wedge_field",
]
