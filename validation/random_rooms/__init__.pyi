from .judging import judge_room, judge_rooms, measured_room, write_scores
from .oracle import Answerable, ask_oracle, shown_walls, true_paths
from .prior import SEEDS, SETS, draw_room
from .room_pictures import draw_rooms
from .room_score import RoomScore, score_room
from .room_summary import RoomSummary, summarise, table_rows

__all__ = [
    "SEEDS",
    "SETS",
    "Answerable",
    "RoomScore",
    "RoomSummary",
    "ask_oracle",
    "draw_room",
    "draw_rooms",
    "judge_room",
    "judge_rooms",
    "measured_room",
    "score_room",
    "shown_walls",
    "summarise",
    "table_rows",
    "true_paths",
    "write_scores",
]
