from .curvature_search_2d import search_curvature
from .curvature_search_3d import WavefrontStart, search_wavefront
from .wave_fit_2d import (
    FittedWaves,
    SphericalWave,
    WaveStart,
    fit_spherical_wave,
    fit_spherical_waves,
)
from .wave_fit_3d import Wavefront, fit_wavefront, towards, wavefront_field
from .wave_model_2d import wave_field

__all__ = [
    "FittedWaves",
    "SphericalWave",
    "WaveStart",
    "Wavefront",
    "WavefrontStart",
    "fit_spherical_wave",
    "fit_spherical_waves",
    "fit_wavefront",
    "search_curvature",
    "search_wavefront",
    "towards",
    "wave_field",
    "wavefront_field",
]
