from .chirps import analytic_signal, chirp_frequencies, without_residual_video_phase
from .gssi_files import GssiScans, read_dzt
from .raw_numbers import raw_array
from .traces import TraceTimes, spectrum_of_traces, trace_times

__all__ = [
    "GssiScans",
    "TraceTimes",
    "analytic_signal",
    "chirp_frequencies",
    "raw_array",
    "read_dzt",
    "spectrum_of_traces",
    "trace_times",
    "without_residual_video_phase",
]
