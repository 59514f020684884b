from .boresight import boresight_of
from .focus_check import delay_by_focus, focus_notes

__all__ = ["boresight_of", "delay_by_focus", "focus_notes"]
