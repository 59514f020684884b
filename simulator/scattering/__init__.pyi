from .bistatic_kernel import BistaticKernel, Port, pattern_table, reflection_rows
from .patch_sum import Factor, Look, scattered_by_patches
from .physical_optics import facet_transform, scattered
from .rough_triangles import rough_weights
from .weighted_curvature_3d import (
    ConductorKernel,
    DielectricKernel,
    curvature_weight,
    scattering_kernel,
)

__all__ = [
    "BistaticKernel",
    "ConductorKernel",
    "DielectricKernel",
    "Factor",
    "Look",
    "Port",
    "curvature_weight",
    "facet_transform",
    "pattern_table",
    "reflection_rows",
    "rough_weights",
    "scattered",
    "scattered_by_patches",
    "scattering_kernel",
]
