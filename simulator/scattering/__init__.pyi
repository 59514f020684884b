from .bistatic_kernel import BistaticKernel, Port, pattern_table, reflection_rows
from .patch_sum import Factor, Look, scattered_by_patches
from .physical_optics import facet_transform, scattered

__all__ = [
    "BistaticKernel",
    "Factor",
    "Look",
    "Port",
    "facet_transform",
    "pattern_table",
    "reflection_rows",
    "scattered",
    "scattered_by_patches",
]
