from .consensus import PathListAnswer, locate_path_lists

__all__ = ["PathListAnswer", "locate_path_lists"]
