from .object_surface import Surface, plate_segment
from .plate_tiles import PlateSheet, Tile, plate_sheet
from .surface_mesh import surface_to_mesh

__all__ = [
    "PlateSheet",
    "Surface",
    "Tile",
    "plate_segment",
    "plate_sheet",
    "surface_to_mesh",
]
