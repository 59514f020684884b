r"""Position error by a known wall's roughness, which distorts the reflected wavefront.

Heights h of a wall add to its physical-optics field at element m and frequency n, to first order,

.. math:: \delta u_{mn} = j k_n \int h(x)\, (\cos\theta_i + \cos\theta_s)\, K_{mn}(x)\, dx ,
          \qquad \int K_{mn}(x)\, dx = u_{mn} ,

and a least-squares fit of a spherical wave of unknown gain, the best that an estimator without
knowledge of h can do, is displaced by :math:`\delta\theta = (\Re J^H J)^{-1} \Re(J^H \delta u) =
\int h(x)\, w(x)\, dx`. With Gaussian heights of correlation function C, the position is Gaussian
too, with

.. math:: \operatorname{cov} = \iint w(x)\, C(x - x')\, w(x')^T\, dx\, dx' .

It does not depend on the noise: more SNR does not lower this floor. Assumptions: two dimensions,
one bounce, the wall's mean plane known, the wall flat except for h, and k h small (first order: a
phase :math:`k\sigma(\cos\theta_i+\cos\theta_s)` of half a radian or less; beyond, the diffuse part
grows as :math:`e^{\varphi^2} - 1` instead of :math:`\varphi^2`).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light
from scipy.signal import fftconvolve

from scenes.realisations.object_surface import plate_segment
from scenes.scenario import Scenario
from scenes.schema.objects import Plate
from scenes.schema.roughness import Roughness
from simulator.scene.array_antennas import array_group, user_group
from validation.bounds.no_bound import NoBound
from validation.bounds.position_bound import (
    Plane,
    PositionBound,
    image_and_slopes,
    jacobian,
    path_slopes,
    spherical_waves,
)

FREQUENCIES = 24
"""Frequencies that represent the sweep: 3 GHz apart over 75 GHz, unambiguous for 0.1 m of path,
four times the difference of paths over 20 cm of wall to either side at 1 m; 101 change the result
by 1e-3. [-]"""

STEPS_PER_DETAIL = 4.0
"""Points on the wall per correlation length and per half wavelength. [-]"""


@dataclass(frozen=True, kw_only=True)
class RoughnessFloor(PositionBound):
    """The covariance of a position by a wall's heights, and the position's response to these."""

    phase: float  # rms of k h (cosθi + cosθs) at mid-band and at the specular point [rad]
    places: Float[np.ndarray, " places"]  # along the wall, from its centre [m]
    response: Float[np.ndarray, "places axes"]  # of the position: w(x) [-/m · m]


def roughness_floor(scenario: Scenario, user: str, wall: str) -> RoughnessFloor:
    """Bound the error that the roughness of one known plate causes in a position over it.

    Parameters
    ----------
    scenario
        In two dimensions.
    user, wall
        Names of the user and of the plate that reflects its pilot.

    Raises
    ------
    ValueError
        If the scene is three-dimensional, or the wall is not a rough plate that faces both ends.
    """
    if wall not in scenario.objects:
        known = ", ".join(scenario.objects) or "none"
        raise ValueError(f"scenario {scenario.name!r} has no object {wall!r}; it has: {known}")
    body = scenario.objects[wall]
    if scenario.dimensions != 2:
        raise NoBound(f"scenario {scenario.name!r} has 3 dimensions; this floor is for 2")
    if not isinstance(body, Plate) or body.roughness is None or not body.roughness.rms > 0:
        raise NoBound(f"objects.{wall} is no rough plate; give one with roughness.rms_mm > 0")
    radio = scenario.radio.frequencies
    frequencies = np.linspace(radio[0], radio[-1], min(FREQUENCIES, radio.size))
    start, end = plate_segment(body)
    positions = _thinned(scenario.base_station.element_positions, start, end, float(radio[-1]))
    centre, along = (start + end) / 2, (end - start) / np.linalg.norm(end - start)
    normal = np.array([along[1], -along[0], 0.0])
    normal *= np.sign(normal @ (positions.mean(axis=0) - centre))
    place = scenario.users[user].position
    if not normal @ (place - centre) > 0:
        raise NoBound(f"objects.{wall} does not face both {user!r} and the array; move one")
    finest = min(body.roughness.correlation_length, speed_of_light / frequencies[-1] / 2)
    count = int(np.ceil(STEPS_PER_DETAIL * np.linalg.norm(end - start) / finest))
    step = float(np.linalg.norm(end - start)) / count
    places = (np.arange(count) + 0.5) * step - count * step / 2
    rough = centre + places[:, None] * along
    planes = [Plane(point=centre, normal=normal)]
    towards = _unit(rough - place)
    amplitude = user_group(scenario, user).pattern.towards(towards)
    amplitude /= np.sqrt(np.linalg.norm(rough - place, axis=-1))
    projection = _projection(place, planes[0], positions=positions, frequencies=frequencies)
    pattern = array_group(scenario, positions).pattern
    wavenumbers = 2 * np.pi * frequencies / speed_of_light
    image = image_and_slopes(place, (0,), planes)[0]
    response = np.zeros((count, 2))
    for element, weights in zip(positions, np.moveaxis(projection, 1, 0), strict=True):
        back = rough - element
        distance = np.linalg.norm(back, axis=-1)
        cosines = -(towards @ normal) - (back / distance[:, None]) @ normal
        length = np.linalg.norm(rough - place, axis=-1) + distance
        kernel = amplitude * cosines * pattern.towards(back / distance[:, None])
        kernel = kernel / np.sqrt(distance) * np.exp(-1j * np.outer(wavenumbers, length))
        # Relative to the image's wave, whose gain is 1 in the fit.
        reach = np.linalg.norm(image - element)
        wave = np.exp(-1j * wavenumbers * reach) / (2 * wavenumbers * reach)
        kernel *= (wave / (kernel.sum(axis=1) * step))[:, None]
        bent = 1j * wavenumbers[:, None] * cosines * kernel
        response += np.stack([(row @ bent).real for row in weights], axis=-1)
    specular = image - positions.mean(axis=0)
    incidence = abs(float(specular @ normal)) / float(np.linalg.norm(specular))
    return RoughnessFloor(
        covariance=_covariance(response, step, body.roughness),
        phase=float(wavenumbers.mean() * body.roughness.rms * 2 * incidence),
        places=places,
        response=response,
    )


def _thinned(
    positions: Float[np.ndarray, "elements 3"],
    start: Float[np.ndarray, " 3"],
    end: Float[np.ndarray, " 3"],
    frequency: float,
) -> Float[np.ndarray, "some 3"]:
    """Return elements spaced at most by the finest speckle λR/L of a wall of length L."""
    nearest = min(float(np.linalg.norm(positions - place, axis=-1).min()) for place in (start, end))
    speckle = speed_of_light / frequency * nearest / float(np.linalg.norm(end - start))
    reach = float(np.linalg.norm(positions[-1] - positions[0]))
    count = min(len(positions), int(np.ceil(reach / speckle)) + 2)
    kept = np.unique(np.round(np.linspace(0, len(positions) - 1, count)).astype(int))
    return np.asarray(positions[kept])


def _projection(
    user: Float[np.ndarray, " 3"],
    plane: Plane,
    *,
    positions: Float[np.ndarray, "elements 3"],
    frequencies: Float[np.ndarray, " freqs"],
) -> Complex[np.ndarray, "2 elements freqs"]:
    """Return weights; the real part of their product with a change of u is the change of position.

    Derivatives are by both coordinates of the fitted position.
    """
    waves = spherical_waves(
        user, positions=positions, frequencies=frequencies, planes=[plane], paths=[(0,)]
    )
    slopes = path_slopes(user, (0,), planes=[plane], positions=positions, dimensions=2)
    rows = jacobian(waves, slopes[None, :, :2], frequencies=frequencies)
    normal = np.einsum("amn,bmn->ab", rows.conj(), rows).real
    return np.asarray(np.einsum("ab,bmn->amn", np.linalg.inv(normal)[:2], rows.conj()))


def _covariance(
    response: Float[np.ndarray, "places axes"], step: float, roughness: Roughness
) -> Float[np.ndarray, "axes axes"]:
    correlation = correlation_function(
        (np.arange(2 * len(response) - 1) - (len(response) - 1)) * step, roughness
    )
    smooth = fftconvolve(response, correlation[:, None], mode="same", axes=0)
    return np.asarray(np.einsum("xa,xb->ab", response, smooth) * step**2)


def correlation_function(
    distances: Float[np.ndarray, " n"], roughness: Roughness
) -> Float[np.ndarray, " n"]:
    """Evaluate the correlation function of a surface's heights; see the scenes' rough surfaces.

    The inner cut-off of an exponential one is left out: it affects only lengths far below the
    Fresnel zone. [m²]
    """
    apart = np.abs(distances) / roughness.correlation_length
    shape = np.exp(-(apart**2)) if roughness.spectrum == "gaussian" else np.exp(-apart)
    return np.asarray(roughness.rms**2 * shape)


def _unit(vectors: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    return np.asarray(vectors / np.linalg.norm(vectors, axis=-1, keepdims=True))
