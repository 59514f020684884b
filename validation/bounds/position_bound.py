r"""Position error bound: Cramér-Rao, near field and wide band, over any number of mirrors.

Element m receives path i from the user's image :math:`p_i` in the mirrors of that path,

.. math:: u_{mn} = \sum_i g_i\, a_{imn}\, e^{-j k_n r_{im}}, \qquad
          r_{im} = \lVert p_i - q_m \rVert ,

in white circular noise of variance σ². The unknowns are the user's position x, the mirrors'
rotations and offsets y, the clock's offset as a length b and the complex gains :math:`g_i`. With
the Jacobian :math:`J` of u, the Fisher information is :math:`F = (2/\sigma^2) \Re(J^H J)`; Gaussian
priors of y and b add the inverses of their covariances (hybrid bound); the block of x of the
inverse of F bounds the covariance of any unbiased estimate, and the root of its trace is the
*position error bound*. All paths are received together, so the bound includes the loss by their
overlap.

Only phases are used: the amplitudes' dependence on the position adds a relative information of
:math:`1/(kr)^2` (2e-8 at 1 m and 250 GHz) and is left out, as in
:mod:`validation.bounds.cramer_rao`. If gains are known, the carrier's phase measures distance: then
the bound is the width of one of many maxima of the likelihood, half a wavelength apart, and no
estimator reaches it below some SNR.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from validation.bounds.no_bound import NoBound

LEAST_CONDITION = 1e-12
"""Least eigenvalue of the information, scaled to a unit diagonal, at which a position counts as
determined: below it the inverse has lost twelve of sixteen digits. [-]"""


@dataclass(frozen=True, kw_only=True)
class Plane:
    """A flat mirror's plane, and the reference point of its rotations and offset."""

    point: Float[np.ndarray, " 3"]  # [m]
    normal: Float[np.ndarray, " 3"]  # unit vector, to the side that reflects


@dataclass(frozen=True, kw_only=True)
class PositionBound:
    """The smallest covariance of a position, and its measure."""

    covariance: Float[np.ndarray, "axes axes"]  # of x, y (and in 3-D z) [m²]

    @property
    def deviation(self) -> float:
        """Position error bound: root of the mean square of the distance from the truth. [m]."""
        return float(np.sqrt(np.trace(self.covariance)))

    @property
    def median(self) -> float:
        """Median distance from the truth of Gaussian errors of this covariance. [m]."""
        eigenvalues = np.linalg.eigvalsh(self.covariance)
        return float(np.median(np.sqrt(_NORMAL[:, : eigenvalues.size] ** 2 @ eigenvalues)))


_NORMAL = np.random.default_rng(0).standard_normal((100_000, 3))  # error of medians 0.4 %


def position_error_bound(
    user: Float[np.ndarray, " 3"],
    *,
    positions: Float[np.ndarray, "elements 3"],
    frequencies: Float[np.ndarray, " freqs"],
    snr: float,
    planes: Sequence[Plane] = (),
    paths: Sequence[tuple[int, ...]] = ((),),
    waves: Complex[np.ndarray, "paths elements freqs"] | None = None,
    dimensions: int = 2,
    gains_known: bool = False,
    plane_covariance: Float[np.ndarray, "inputs inputs"] | None = None,
    clock_deviation: float = 0.0,
) -> PositionBound:
    """Bound the covariance of a user's position from its pilot at an array.

    Parameters
    ----------
    user
        True position. [m]
    positions
        Elements. [m]
    frequencies
        [Hz]
    snr
        Mean power of the noise-free samples over the noise's variance (not in dB). [-]
    planes
        The mirrors' planes.
    paths
        Indices of each path's mirrors, from the array outward; ``()`` is the direct path.
    waves
        Each path's noise-free part of the samples, zero where it is not received; ``None``: those
        of :func:`spherical_waves`.
    dimensions
        2: in the plane z = 0, planes upright; 3.
    gains_known
        Whether the paths' complex gains, the carrier's phase at the user included, are known.
    plane_covariance
        Prior covariance of the planes, one after another: of (rotation about +z [rad], offset
        along the normal [m]) in two dimensions; of (rotation of the horizontal axis, rotation of
        the axis across it, both towards the normal [rad], offset [m]) in three. ``None``: they are
        known exactly.
    clock_deviation
        Prior standard deviation of the user's clock offset; infinite: unknown. [s]

    Raises
    ------
    ValueError
        If sizes do not agree, or these paths do not determine the position.
    """
    if waves is None:
        waves = spherical_waves(
            user, positions=positions, frequencies=frequencies, planes=planes, paths=paths
        )
    inputs = len(planes) * dimensions
    if dimensions not in (2, 3):
        raise ValueError(f"{dimensions} dimensions; give 2 or 3")
    if len(waves) != len(paths):
        raise ValueError(f"{len(waves)} waves for {len(paths)} paths; give one for each path")
    if plane_covariance is not None and len(plane_covariance) != inputs:
        raise ValueError(
            f"plane_covariance is for {len(plane_covariance)} inputs, but {len(planes)} planes "
            f"have {inputs} in {dimensions} dimensions; give {dimensions} rows for each plane"
        )
    prior = np.zeros((dimensions, dimensions))
    slopes = np.stack(
        [
            path_slopes(user, path, planes=planes, positions=positions, dimensions=dimensions)
            for path in paths
        ]
    )
    if plane_covariance is None:
        slopes = slopes[..., :dimensions]
    else:
        prior = _joined(prior, np.linalg.inv(plane_covariance))
    if clock_deviation > 0:
        slopes = np.concatenate([slopes, np.ones((*slopes.shape[:2], 1))], axis=-1)
        prior = _joined(prior, np.array([[(speed_of_light * clock_deviation) ** -2]]))
    information = fisher_information(
        waves,
        slopes,
        frequencies=frequencies,
        noise_variance=float(np.mean(np.abs(waves.sum(axis=0)) ** 2)) / snr,
        gains_known=gains_known,
    )
    information[: len(prior), : len(prior)] += prior
    covariance = _inverse(information)
    return PositionBound(covariance=covariance[:dimensions, :dimensions])


def spherical_waves(
    user: Float[np.ndarray, " 3"],
    *,
    positions: Float[np.ndarray, "elements 3"],
    frequencies: Float[np.ndarray, " freqs"],
    planes: Sequence[Plane] = (),
    paths: Sequence[tuple[int, ...]] = ((),),
    gains: Complex[np.ndarray, " paths"] | None = None,
) -> Complex[np.ndarray, "paths elements freqs"]:
    r"""Evaluate Friis' :math:`g_i \frac{\lambda}{4\pi r_{im}} e^{-jk r_{im}}` of each path.

    Parameters
    ----------
    user, positions, frequencies, planes, paths
        See :func:`position_error_bound`.
    gains
        Of each path, over isotropic antennas and ideal mirrors; ``None``: 1. [-]
    """
    images = np.stack([image_and_slopes(user, path, planes)[0] for path in paths])
    lengths = np.sqrt(((images[:, None] - positions) ** 2).sum(axis=-1))
    wavenumbers = 2 * np.pi * frequencies / speed_of_light
    waves = np.exp(-1j * lengths[..., None] * wavenumbers)
    waves /= 2 * lengths[..., None] * wavenumbers
    return np.asarray(waves if gains is None else gains[:, None, None] * waves)


def fisher_information(
    waves: Complex[np.ndarray, "paths elements freqs"],
    slopes: Float[np.ndarray, "paths elements parameters"],
    *,
    frequencies: Float[np.ndarray, " freqs"],
    noise_variance: float,
    gains_known: bool = False,
) -> Float[np.ndarray, "all all"]:
    """Return the Fisher information of the parameters of path lengths, then of the gains.

    Parameters
    ----------
    waves
        Noise-free parts of the samples.
    slopes
        Derivatives of the lengths by each parameter. [m per unit of it]
    frequencies
        [Hz]
    noise_variance
        Per complex sample. [-]
    gains_known
        If not, each path adds two parameters: the relative change of its gain, and its phase.
    """
    rows = jacobian(waves, slopes, frequencies=frequencies, gains_known=gains_known)
    information = np.empty((len(rows), len(rows)))
    for row, values in enumerate(rows):
        for column in range(row + 1):
            both = values.real * rows[column].real + values.imag * rows[column].imag
            information[row, column] = information[column, row] = both.sum()
    return 2 / noise_variance * information


def jacobian(
    waves: Complex[np.ndarray, "paths elements freqs"],
    slopes: Float[np.ndarray, "paths elements parameters"],
    *,
    frequencies: Float[np.ndarray, " freqs"],
    gains_known: bool = False,
) -> Complex[np.ndarray, "all elements freqs"]:
    """Differentiate the samples by the parameters of path lengths, then by the paths' gains."""
    wavenumbers = 2 * np.pi * frequencies / speed_of_light
    rows = [
        -1j * wavenumbers * (waves * slopes[..., index, None]).sum(axis=0)
        for index in range(slopes.shape[-1])
    ]
    if not gains_known:
        rows += [turn * wave for wave in waves for turn in (1.0, 1j)]
    return np.stack(rows)


def path_slopes(
    user: Float[np.ndarray, " 3"],
    path: tuple[int, ...],
    *,
    planes: Sequence[Plane],
    positions: Float[np.ndarray, "elements 3"],
    dimensions: int,
) -> Float[np.ndarray, "elements inputs"]:
    """Differentiate a path's length to each element by the position, then by all planes.

    Parameters
    ----------
    user, path, planes, positions, dimensions
        See :func:`position_error_bound`.

    Returns
    -------
    First by the user's coordinates [-], then by the turns [m/rad] and the offset [-] of each plane.
    """
    image, by_user, by_planes = image_and_slopes(user, path, planes)
    rays = image - positions
    units = rays / np.linalg.norm(rays, axis=-1, keepdims=True)
    columns = [by_user[:, :dimensions]]
    # In the plane z = 0 an upright mirror has no rotation of the axis across.
    kept = [0, 2] if dimensions == 2 else [0, 1, 2]
    for plane, by_plane in zip(planes, by_planes, strict=True):
        chosen = by_plane[:, kept]
        if dimensions == 2:  # about +z: opposite to the rotation towards the normal
            chosen = chosen * [-1.0, 1.0]
            if abs(plane.normal[2]) > 1e-9:
                raise ValueError(
                    f"normal = {plane.normal.tolist()} is not in the plane z = 0; "
                    "give upright planes, or dimensions=3"
                )
        columns.append(chosen)
    return np.asarray(np.einsum("mx,xi->mi", units, np.concatenate(columns, axis=1)))


def image_and_slopes(
    user: Float[np.ndarray, " 3"], path: tuple[int, ...], planes: Sequence[Plane]
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, "3 3"], Float[np.ndarray, "planes 3 3"]]:
    """Return the image of a user in a path's mirrors, and its derivatives.

    Parameters
    ----------
    user, path, planes
        See :func:`position_error_bound`.

    Returns
    -------
    The image [m]; its derivatives by the position [-]; those by each plane's turns of its
    horizontal axis and of the one across, towards the normal [m/rad], and by its offset [-].
    """
    image, by_user = user, np.eye(3)
    by_planes = np.zeros((len(planes), 3, 3))
    for index in reversed(path):
        plane = planes[index]
        normal = plane.normal
        height = float(normal @ (image - plane.point))
        turning = np.eye(3) - 2 * np.outer(normal, normal)
        by_user, by_planes = turning @ by_user, turning @ by_planes
        for column, axis in enumerate(plane_axes(normal)):
            # If an axis rotates towards the normal, the normal rotates away from the axis.
            slope = 2 * (axis * height + normal * float(axis @ (image - plane.point)))
            by_planes[index, :, column] += slope
        by_planes[index, :, 2] += 2 * normal
        image = image - 2 * height * normal
    return image, by_user, by_planes


def plane_axes(normal: Float[np.ndarray, " 3"]) -> Float[np.ndarray, "2 3"]:
    """Return a horizontal axis in a plane and the one across it; their product is the normal."""
    level = np.array([-normal[1], normal[0], 0.0])
    length = float(np.linalg.norm(level))
    first = np.array([1.0, 0.0, 0.0]) if length < 1e-9 else level / length
    return np.stack([first, np.cross(normal, first)])


def _joined(
    first: Float[np.ndarray, "m m"], second: Float[np.ndarray, "n n"]
) -> Float[np.ndarray, "both both"]:
    size = len(first) + len(second)
    both = np.zeros((size, size))
    both[: len(first), : len(first)] = first
    both[len(first) :, len(first) :] = second
    return both


def _inverse(information: Float[np.ndarray, "n n"]) -> Float[np.ndarray, "n n"]:
    """Invert an information matrix whose parameters have different units."""
    scale = 1 / np.sqrt(np.maximum(np.diag(information), np.finfo(float).tiny))
    scaled = information * np.outer(scale, scale)
    least = float(np.linalg.eigvalsh(scaled)[0])
    if not least > LEAST_CONDITION:
        raise NoBound(
            f"these paths do not fix the position (least eigenvalue of the scaled information "
            f"{least:.1g}, the limit is {LEAST_CONDITION:g}); give more paths, a bandwidth, an "
            "aperture (in space a planar one), or what is known of planes and clock"
        )
    return np.linalg.inv(scaled) * np.outer(scale, scale)
