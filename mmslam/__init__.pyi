from .commands.dataset import make_dataset
from .commands.design import design
from .commands.focus import image
from .commands.sweep import sweep
from .commands.track import track
from .datasets import open_dataset
from .deepmimo_folder import to_deepmimo
from .full_wave import simulate_full_wave
from .library import Scenario, load_scenario, scenarios
from .location import locate
from .measured_data import import_measured
from .measurement import Air, Echo, Measurement, PathList, Uplink
from .measurement_files import read, write
from .pipeline import simulate
from .results.estimate import Estimate
from .results.plots import plot_angle_range_map, plot_estimate, plot_image, plot_scenario, plot_user
from .sionna_channel import SionnaChannel, to_sionna_cir

__all__ = [
    "Air",
    "Echo",
    "Estimate",
    "Measurement",
    "PathList",
    "Scenario",
    "SionnaChannel",
    "Uplink",
    "design",
    "image",
    "import_measured",
    "load_scenario",
    "locate",
    "make_dataset",
    "open_dataset",
    "plot_angle_range_map",
    "plot_estimate",
    "plot_image",
    "plot_scenario",
    "plot_user",
    "read",
    "scenarios",
    "simulate",
    "simulate_full_wave",
    "sweep",
    "to_deepmimo",
    "to_sionna_cir",
    "track",
    "write",
]
