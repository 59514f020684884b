from .foreign_scene import Geometry, with_geometry
from .mesh_file import mesh_contains, mesh_distance, placed_mesh
from .mesh_formats import read_mesh
from .mitsuba_xml import read_mitsuba_xml
from .ply_writer import ply_bytes
from .polygons import Polygons, triangles_of
from .triangle_mesh import TriangleMesh, cleaned, distances_to_triangles

__all__ = [
    "Geometry",
    "Polygons",
    "TriangleMesh",
    "cleaned",
    "distances_to_triangles",
    "mesh_contains",
    "mesh_distance",
    "placed_mesh",
    "ply_bytes",
    "read_mesh",
    "read_mitsuba_xml",
    "triangles_of",
    "with_geometry",
]
