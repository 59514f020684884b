from .level_codes import coded_levels
from .plan import plan_document
from .single_file import render_page

__all__ = ["coded_levels", "plan_document", "render_page"]
