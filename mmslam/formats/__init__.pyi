from .array_files import ArrayFiles
from .export_arrays import export_matlab, export_netcdf
from .export_touchstone import refuse_foreign_touchstone
from .import_full_wave import import_npz
from .import_measured import Import
from .mapping import SweepMapping, checked_mapping, load_mapping, mapping_schema
from .measured_signals import FolderReader
from .numpy_files import npz_arrays
from .tables.position_table import PositionTable
from .touchstone_files import read_touchstone, touchstone_text
from .touchstone_folder import list_folder, read_scan

__all__ = [
    "ArrayFiles",
    "FolderReader",
    "Import",
    "PositionTable",
    "SweepMapping",
    "checked_mapping",
    "export_matlab",
    "export_netcdf",
    "import_npz",
    "list_folder",
    "load_mapping",
    "mapping_schema",
    "npz_arrays",
    "read_scan",
    "read_touchstone",
    "refuse_foreign_touchstone",
    "touchstone_text",
]
