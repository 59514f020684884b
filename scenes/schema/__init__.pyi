from .air import Air
from .antenna import Antenna, Cosine, Directive, GaussianBeam, Horn, Isotropic
from .base_station import BaseStation
from .directions import unit_vector
from .errors import ScenarioError, did_you_mean, problems, shown
from .height_map import HeightMap, read_height_map
from .impairments import Impairments
from .materials import Slab, usual_texture
from .multistatic import Arc, Places, Transmitter
from .objects import Body, Box, Cylinder, MeshFile, Plate, SceneObject, largest_size, smallest_size
from .permittivity_table import band_problem, read_permittivity_table, table_problem, value_problem
from .point_target import PointTarget
from .quantities import Checked, Name, Position
from .radio import Radio
from .roughness import Distribution, Roughness, Scale, Spectrum

__all__ = [
    "Air",
    "Antenna",
    "Arc",
    "BaseStation",
    "Body",
    "Box",
    "Checked",
    "Cosine",
    "Cylinder",
    "Directive",
    "Distribution",
    "GaussianBeam",
    "HeightMap",
    "Horn",
    "Impairments",
    "Isotropic",
    "MeshFile",
    "Name",
    "Places",
    "Plate",
    "PointTarget",
    "Position",
    "Radio",
    "Roughness",
    "Scale",
    "ScenarioError",
    "SceneObject",
    "Slab",
    "Spectrum",
    "Transmitter",
    "band_problem",
    "did_you_mean",
    "largest_size",
    "problems",
    "read_height_map",
    "read_permittivity_table",
    "shown",
    "smallest_size",
    "table_problem",
    "unit_vector",
    "usual_texture",
    "value_problem",
]
