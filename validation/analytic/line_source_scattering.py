r"""Closed forms of the field of a line source scattered by a cylinder, a wedge and a slab.

Two dimensions, :math:`e^{+j\omega t}`, unit line sources :math:`-\tfrac j4 H_0^{(2)}(kR)` of
:math:`E_z` (TM) or :math:`H_z` (TE). All are analytic in the source's position, so they hold for a
beam as well, which is a source at a complex position (:mod:`validation.full_wave.line_source`).
"""

from typing import Literal

import numpy as np
from jaxtyping import Float
from scipy.constants import speed_of_light
from scipy.special import h2vp, hankel2, hankel2e, jv, jvp

from simulator.materials.fresnel_slab import slab
from validation.full_wave.line_source import LineSource

MORE_ORDERS = 40
"""Orders beyond the argument, at which Bessel functions are below rounding. [-]"""

ANGLES = 4000
"""Plane waves of the spectrum of a beam at a slab. [-]"""


def cylinder_field(
    source: LineSource,
    receiver: Float[np.ndarray, " 2"],
    wavenumber: float,
    *,
    radius: float,
    permittivity: complex | None,
    polarisation: Literal["TM", "TE"],
) -> complex:
    r"""Return the field scattered by a circular cylinder at the origin.

    .. math:: u = \tfrac j4 \sum_m c_m H_m^{(2)}(k r) H_m^{(2)}(k r_0)\, e^{jm(\varphi-\varphi_0)}

    with :math:`c_m = J_m/H_m` (conductor, TM), :math:`J_m'/H_m'` (TE), or
    :math:`(J_m' - r J_m)/(H_m' - r H_m)` with :math:`r = k_1 J_m'(k_1 a)/(k\rho J_m(k_1 a))`,
    :math:`\rho` 1 (TM) or the permittivity (TE).

    Parameters
    ----------
    source
        Isotropic, outside.
    receiver, radius
        [m].
    wavenumber
        [rad/m].
    permittivity
        Of a dielectric cylinder; None of a conductor. [-]
    polarisation
        TM or TE.
    """
    outer = wavenumber * radius
    order = np.arange(-int(outer) - MORE_ORDERS, int(outer) + MORE_ORDERS + 1)
    bessel, hankel = jv(order, outer), hankel2(order, outer)
    slopes = jvp(order, outer), h2vp(order, outer)
    if permittivity is None:
        term = bessel / hankel if polarisation == "TM" else slopes[0] / slopes[1]
    else:
        index = np.sqrt(complex(permittivity))
        ratio = index / (permittivity if polarisation == "TE" else 1.0)
        ratio = ratio * jvp(order, index * outer) / jv(order, index * outer)
        term = (slopes[0] - ratio * bessel) / (slopes[1] - ratio * hankel)
    ends = source.position @ np.array([1, 1j]), receiver @ np.array([1, 1j])
    for end in ends:
        term = term * hankel2(order, wavenumber * abs(end))
    return complex(0.25j * np.sum(term * np.exp(1j * order * np.angle(ends[1] / ends[0]))))


def wedge_field(
    source: LineSource,
    receiver: Float[np.ndarray, " 2"],
    wavenumber: float,
    *,
    open_angle: float,
    polarisation: Literal["TM", "TE"],
) -> complex:
    r"""Return the field scattered by a conducting wedge, its edge at the origin, a face along +x.

    Of the total field, inside :math:`0 < \varphi < \beta`,

    .. math:: u = -\frac{j\pi}{2\beta} \sum_n \epsilon_n J_{\nu}(kr) H_{\nu}^{(2)}(kr_0)
              \sin\nu\varphi \sin\nu\varphi_0, \quad \nu = n\pi/\beta

    (TM; cosines in TE; :math:`\epsilon_n` is 2, and 1 for :math:`n = 0`)
    the incident one is subtracted. :math:`\beta = 2\pi` is a half plane.

    Parameters
    ----------
    source
        Farther from the edge than the receiver; a beam has a complex displacement.
    receiver
        [m].
    wavenumber
        [rad/m].
    open_angle
        :math:`\beta`, the exterior angle (in air). [rad]
    polarisation
        TM or TE.
    """
    place = source.position.astype(np.complex128)
    decay = 0.0
    if source.aim is not None:
        decay = wavenumber * float(source.displacement or 0.0)
        place = place - 1j * decay / wavenumber * source.aim / np.hypot(*source.aim)
    distance = np.sqrt(place @ place)
    angle = -1j * np.log((place[0] + 1j * place[1]) / distance)
    angle = angle if angle.real >= 0 else angle + 2 * np.pi
    near = float(np.hypot(*receiver))
    turned = float(np.arctan2(receiver[1], receiver[0])) % (2 * np.pi)
    count = int((wavenumber * near + MORE_ORDERS) * open_angle / np.pi)
    order = np.arange(count) * np.pi / open_angle
    term = jv(order, wavenumber * near) * hankel2e(order, wavenumber * distance)
    if polarisation == "TE":
        term = term * np.cos(order * turned) * np.cos(order * angle)
        term[0] *= 0.5
    else:
        term = term * np.sin(order * turned) * np.sin(order * angle)
    phase = np.exp(-1j * wavenumber * distance - decay)
    total = -1j * np.pi / open_angle * np.sum(term) * phase
    return complex(total - source.field(receiver[None], wavenumber)[0])


def slab_fields(
    source: LineSource,
    reflected_at: Float[np.ndarray, " 2"],
    transmitted_at: Float[np.ndarray, " 2"],
    wavenumber: float,
    *,
    permittivity: complex,
    thickness: float,
    polarisation: Literal["TM", "TE"],
) -> tuple[complex, complex]:
    r"""Return the change of a beam by an infinite slab in :math:`-d < y < 0`, above and below it.

    The beam is a sum of plane waves, each reflected and transmitted by Airy's coefficients:

    .. math:: u = -\frac{j}{4\pi} \int R(\theta)\, e^{-jk[\sin\theta (x-x_0) + \cos\theta (y+y_0)]}
              \,d\theta

    Evanescent waves are left out: a beam that aims steeply has none.

    Parameters
    ----------
    source
        A beam from above.
    reflected_at, transmitted_at
        Above and below the slab. [m]
    wavenumber
        [rad/m].
    permittivity, thickness
        Of the slab. [-], [m]
    polarisation
        TM or TE.

    Returns
    -------
    The reflected field, and the transmitted one less the incident one.
    """
    frequency = np.array([wavenumber * speed_of_light / (2 * np.pi)])
    assert source.aim is not None
    assert source.displacement is not None
    turn = np.pi * ((np.arange(ANGLES) + 0.5) / ANGLES - 0.5)
    sine, cosine = np.sin(turn), np.cos(turn)
    both = slab(np.array([complex(permittivity)]), thickness, frequency, cosine)
    reflection, transmission = ((one.te if polarisation == "TM" else one.tm)[:, 0] for one in both)
    aim = source.aim / np.hypot(*source.aim)
    place = source.position - 1j * source.displacement * aim
    weight = -0.25j * np.exp(-wavenumber * source.displacement) / ANGLES
    above = sine * (reflected_at[0] - place[0]) + cosine * (reflected_at[1] + place[1])
    below = sine * (transmitted_at[0] - place[0])
    # The transmission's phase is from the slab's upper to its lower face.
    below = below + cosine * (place[1] - transmitted_at[1] - thickness)
    reflected = weight * np.sum(reflection * np.exp(-1j * wavenumber * above))
    transmitted = weight * np.sum(transmission * np.exp(-1j * wavenumber * below))
    incident = source.field(transmitted_at[None], wavenumber)[0]
    return complex(reflected), complex(transmitted - incident)
