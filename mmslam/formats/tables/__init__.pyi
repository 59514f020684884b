from .air_table import AirTable
from .frequency_table import FrequencyTable
from .path_table import PathTable
from .position_table import PositionTable
from .signal_tables import EchoTable, RawTable, ResponseTable, SamplesTable, SignalTable
from .time_tables import ChirpTable, TimeTable

__all__ = [
    "AirTable",
    "ChirpTable",
    "EchoTable",
    "FrequencyTable",
    "PathTable",
    "PositionTable",
    "RawTable",
    "ResponseTable",
    "SamplesTable",
    "SignalTable",
    "TimeTable",
]
