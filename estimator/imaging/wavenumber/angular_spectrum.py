r"""Planes of an image by the angular spectrum, frequency by frequency: holography.

Each frequency's samples over a planar grid are plane waves; :math:`e^{+j k_y y}` carries them to
any depth (see :mod:`estimator.imaging.wavenumber.range_migration` for the kernel's transform).
Nothing is interpolated over frequency, so that few frequencies do, and no range is ambiguous to the
method.
"""

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.imaging.wavenumber.range_migration import at_pixels, over_aperture, transform_axis
from estimator.measurement.model import Echo
from estimator.results.pixel_grid import PixelGrid

CHUNK = 64_000_000
"""Plane waves times depths that are worked on at once: half a gigabyte. [-]"""
GRAZING = 1e-3
"""Least wavenumber along the depth, over the wave's, that is kept: 0.06° above the aperture. [-]"""


def angular_spectrum(
    echo: Echo, grid: PixelGrid, *, weights: Float[np.ndarray, "#positions #freqs"]
) -> Complex[np.ndarray, "x y z"]:
    """Form a monostatic image of a planar aperture, as back-projection gives it.

    Parameters
    ----------
    echo
        At positions on a grid over x and z, all at one y; a geometry that
        :func:`estimator.imaging.wavenumber.range_migration.is_lattice` takes.
    grid
        Pixels at larger y.
    weights
        Taper over positions and frequencies. [-]
    """
    depth = grid.y - echo.positions[0, 1]
    samples = (echo.samples * weights).astype(np.complex64)
    gain = float(np.broadcast_to(weights, samples.shape).sum())
    wavelength = speed_of_light / float(echo.frequencies[0])
    ends = echo.positions
    spans = [
        max(float(pixels[-1] - ends[:, i].min()), float(ends[:, i].max() - pixels[0]))
        for i, pixels in enumerate((grid.x, grid.y, grid.z))
    ]
    far = float(np.linalg.norm(spans))
    axes = tuple(
        transform_axis(ends[:, i], pixels, depth, far, wavelength)
        for i, pixels in ((0, grid.x), (2, grid.z))
    )
    spectra = over_aperture(samples, ends[:, ::2], axes)
    along, up = (axis.wavenumbers for axis in axes)
    shift = np.multiply.outer(
        np.exp(1j * along * (grid.x[0] - axes[0].start)),
        np.exp(1j * up * (grid.z[0] - axes[1].start)),
    )
    area = axes[0].period * axes[1].period
    image = np.zeros((grid.x.size, depth.size, grid.z.size), dtype=np.complex128)
    step = max(1, CHUNK // shift.size)
    pace = float(depth[1] - depth[0]) if depth.size > 1 else 0.0
    for first in range(0, depth.size, step):
        part = depth[first : first + step]
        total = np.zeros((part.size, *shift.shape), dtype=np.complex64)
        for index, frequency in enumerate(echo.frequencies):
            wave = 4 * np.pi * float(frequency) / speed_of_light
            square = wave**2 - along[:, None] ** 2 - up**2
            ahead = np.sqrt(np.maximum(square, (GRAZING * wave) ** 2))
            kept = (square > (GRAZING * wave) ** 2) * 1.0
            for axis, places in ((axes[0], np.abs(along)[:, None]), (axes[1], np.abs(up)[None])):
                beyond = (axis.tangent + axis.slope - places / ahead) / axis.slope
                kept = kept * np.clip(beyond, 0.0, 1.0)
            weight = shift * (kept * wave / ahead**2) * np.exp(1j * ahead * part[0])
            field = (spectra[..., index] * weight).astype(np.complex64)
            farther = np.exp(1j * ahead * pace).astype(np.complex64)
            for plane in total:
                plane += field
                field *= farther  # one step on: 1e-7 of rounding each
        planes = at_pixels(at_pixels(total, 1, axes[0], grid.x), 2, axes[1], grid.z)
        image[:, first : first + step] = planes.transpose(1, 0, 2)
    return np.asarray(image * (2j * np.pi * depth / (area * gain))[:, None])
