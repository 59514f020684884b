"""The coefficient of a wedge against its exact series."""

import numpy as np
import pytest
from scipy.special import hankel2, jv

from simulator.scattering.shadow_edge import wedge_coefficient


def exact_over_free_space(
    near: float, far: float, incident: float, outgoing: float, *, exterior: float, soft: bool
) -> complex:
    """Field of a line source beside a wedge over that of the source at the summed distance.

    By eigenfunctions (Harrington, Time-Harmonic Electromagnetic Fields, 5-10); distances in
    radians.
    """
    orders = np.arange(0, int(exterior * (near + 60)) + 1) / exterior
    weight = np.where(orders == 0, 0.5, 1.0)
    if soft:
        angular = np.sin(orders * incident) * np.sin(orders * outgoing)
    else:
        angular = weight * np.cos(orders * incident) * np.cos(orders * outgoing)
    total = 4 / exterior * np.sum(jv(orders, near) * hankel2(orders, far) * angular)
    # Of the direct wave the asymptotic form, as the coefficient's.
    there = np.sqrt(2 / np.pi) * np.exp(0.25j * np.pi)
    return complex(total / there)


@pytest.mark.parametrize("exterior", [1.5, 2.0])
@pytest.mark.parametrize("soft", [True, False])
@pytest.mark.parametrize("outgoing_deg", [203.0, 215.0, 240.0, 262.0])
def test_in_the_shadow_of_a_wedge_the_field_is_the_exact_one(
    exterior: float, soft: bool, outgoing_deg: float
) -> None:
    near, far = 60.0, 90.0  # wavenumber times the distance of both ends
    incident, outgoing = np.radians(20.0), np.radians(outgoing_deg)
    exact = exact_over_free_space(
        near, far, incident, float(outgoing), exterior=exterior, soft=soft
    )
    coefficient = wedge_coefficient(
        float(incident),
        np.array([outgoing]),
        near,
        np.array([far]),
        np.ones(1),
        exterior=exterior,
        reflection=-1.0 if soft else 1.0,
    )[0, 0]
    found = coefficient * np.exp(-1j * (near + far)) / np.sqrt(near * far)
    # UTD leaves out terms of one over that, a sixtieth, of the diffracted wave.
    assert abs(found - exact) <= 0.05 * abs(exact) + 1e-4
