r"""Accuracy of a rough wall's angle and offset from its own echo, in closed form.

Assumptions: the wall is flat except for Gaussian heights h, so that its focused image is a row of
:math:`N` resolution cells along it, evenly illuminated, with independent speckle; each cell
measures the wall's depth along its normal with an independent error of variance s²; and a straight
line is fitted by least squares, each cell weighted by its intensity. Then at the wall's centre

.. math:: \operatorname{var}(\text{angle}) = \frac{12 s^2}{N L^2}, \qquad
          \operatorname{var}(\text{offset}) = \frac{s^2}{N} .

A cell's depth has two errors. By noise, with the cell's signal-to-noise ratio :math:`\rho` after
focusing, :math:`s_n = c / (4 \pi B_{rms} \sqrt{2\rho}\cos\psi)` at an incidence ψ. By roughness, at
any signal-to-noise ratio: to second order the echo is :math:`q_z H_1 + q_z^2 H_2` with
:math:`H_1 = j\int h e^{-jq_x x} dx` and :math:`H_2 = -\frac12 \int h^2 e^{-jq_x x} dx`, whose ratio
gives a phase linear in :math:`q_z`, like a depth. Both are sums over many heights, so for a
Gaussian correlation function their independent spectra give

.. math:: s_h = \frac12 \sqrt{\frac{S_{h^2}(q_x)}{2 S_h(q_x)}}
              = 2^{-5/4}\, \sigma\, e^{q_x^2 l^2 / 16}, \qquad q_x = 2 k \sin\psi .

A smooth wall (no heights) has no such echo, and no bound here. This is the variance of a fit to the
image's intensity, not a Cramér-Rao bound: the heights also determine the speckle itself.
"""

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light

from scenes.realisations.object_surface import plate_segment
from scenes.scenario import Scenario
from scenes.schema.objects import Plate
from simulator.materials.fresnel_slab import Absorber
from simulator.scene.radio_scene import scenario_materials
from validation.bounds.no_bound import NoBound

HALF_POWER = 0.886
"""Half-power width of a sinc's main lobe over the distance of its first zero from the peak. [-]"""


def line_covariance(
    *, length: float, cells: float, depth_deviation: float
) -> Float[np.ndarray, "2 2"]:
    """Return the covariance of (angle [rad], offset at the centre [m]) of a fitted line.

    Parameters
    ----------
    length
        Of the line. [m]
    cells
        Independent places on it, evenly spread; at least 2. [-]
    depth_deviation
        Standard deviation of each cell's depth. [m]

    Raises
    ------
    ValueError
        If there are fewer than two places, which do not determine a line.
    """
    if cells < 2:
        raise NoBound(
            f"{cells:.2g} resolution cells on a wall of {length:g} m fix no line; "
            "give at least 2: a longer wall or a larger aperture"
        )
    # N places at the centres of N equal parts: their variance is L²/12 · (1 - 1/N²).
    variance = depth_deviation**2 / cells
    return np.diag([12 * variance / (length**2 * (1 - cells**-2)), variance])


def speckle_depth_deviation(
    *, rms: float, correlation_length: float, wavelength: float, incidence: float
) -> float:
    """Return the standard deviation of one cell's depth by roughness. [m].

    Parameters
    ----------
    rms, correlation_length
        Of the heights, with a Gaussian correlation function. [m]
    wavelength
        [m]
    incidence
        From the wall's normal. [rad]
    """
    along = 4 * np.pi / wavelength * np.sin(incidence)
    return float(2**-1.25 * rms * np.exp((along * correlation_length) ** 2 / 16))


def noise_depth_deviation(*, bandwidth: float, snr: float, incidence: float) -> float:
    """Return the standard deviation of one cell's depth by noise, along the normal. [m].

    Parameters
    ----------
    bandwidth
        Of a uniform sweep. [Hz]
    snr
        Of the cell in the focused image (not in dB). [-]
    incidence
        From the wall's normal. [rad]
    """
    rms_bandwidth = bandwidth / np.sqrt(12)
    along_ray = speed_of_light / (4 * np.pi * rms_bandwidth * np.sqrt(2 * snr))
    return float(along_ray / np.cos(incidence))


def wall_covariance_bound(
    scenario: Scenario, wall: str, *, snr_db: float | None = None
) -> Float[np.ndarray, "2 2"]:
    """Return the covariance of a line fitted to the echo of a scenario's rough plate alone.

    Parameters
    ----------
    scenario
        In two dimensions.
    wall
        Name of the plate.
    snr_db
        Of the echo: mean power over its samples over the noise's; ``None``: the scenario's. [dB]

    Returns
    -------
    Covariance of (angle [rad], offset at the centre [m]).

    Raises
    ------
    ValueError
        If the scene is three-dimensional, or the object is no rough reflecting plate.
    """
    if wall not in scenario.objects:
        known = ", ".join(scenario.objects) or "none"
        raise ValueError(f"scenario {scenario.name!r} has no object {wall!r}; it has: {known}")
    body = scenario.objects[wall]
    if scenario.dimensions != 2:
        raise NoBound(f"scenario {scenario.name!r} has 3 dimensions; this bound is for 2")
    rough = body.roughness
    if not isinstance(body, Plate) or rough is None or rough.spectrum != "gaussian":
        raise NoBound(
            f"objects.{wall} is no plate of Gaussian roughness, whose echo this bound is for; "
            "give it kind = plate and roughness with spectrum = gaussian"
        )
    if isinstance(scenario_materials(scenario)[wall], Absorber) or not rough.rms > 0:
        raise NoBound(f"objects.{wall} has no diffuse echo: smooth, or an absorber")
    positions, frequencies = scenario.base_station.element_positions, scenario.radio.frequencies
    wavelength = speed_of_light / float(frequencies.mean())
    start, end = plate_segment(body)
    length = float(np.linalg.norm(end - start))
    along = (end - start) / length
    ray = (start + end) / 2 - positions.mean(axis=0)
    distance = float(np.linalg.norm(ray))
    incidence = float(np.arcsin(min(1.0, abs(float(ray @ along)) / distance)))
    aperture = positions[-1] - positions[0]
    across = float(np.linalg.norm(aperture - (aperture @ ray) * ray / distance**2))
    cell = HALF_POWER * wavelength * distance / (2 * across * np.cos(incidence))
    cells = length / cell
    level = scenario.noise.snr_db if snr_db is None else snr_db
    speckle = speckle_depth_deviation(
        rms=rough.rms,
        correlation_length=rough.correlation_length,
        wavelength=wavelength,
        incidence=incidence,
    )
    noise = 0.0
    if np.isfinite(level):
        samples = len(positions) * frequencies.size
        noise = noise_depth_deviation(
            bandwidth=float(np.ptp(frequencies)),
            snr=10 ** (level / 10) * samples / cells,
            incidence=incidence,
        )
    return line_covariance(
        length=length, cells=cells, depth_deviation=float(np.hypot(speckle, noise))
    )
