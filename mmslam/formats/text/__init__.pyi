from .csv_columns import CsvGrid, read_csv_grid
from .text_numbers import TextColumns, read_columns, read_matrix

__all__ = ["CsvGrid", "TextColumns", "read_columns", "read_csv_grid", "read_matrix"]
