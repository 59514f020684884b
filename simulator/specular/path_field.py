r"""Fields along specular paths: polarization, reflection, roughness, spreading and delay.

The S-parameter of a path of length :math:`L` between isotropic ports is

.. math:: S(f) = \frac{\lambda}{4 \pi L} \, e^{-j 2 \pi f L / c} \;
          \hat e_r \cdot \prod_i e^{-2 (k \sigma_i \cos\theta_i)^2} \, \mathsf R_i(f) \; \hat e_t

with the reflection dyads :math:`\mathsf R_i` of the mirrors (TE and TM coefficients of the slab
at that angle and frequency) and the field's unit vectors :math:`\hat e` at both antennas.
"""

from collections.abc import Callable, Iterable, Iterator, Sequence

import numpy as np
from jaxtyping import Complex, Float, Int
from scipy.constants import speed_of_light

from estimator.measurement.model import Waves
from simulator.antennas.beam_culling import AntennaGroup
from simulator.antennas.polarization import VERTICAL, Polarization
from simulator.geometry.mirrors import Mirrors, dot
from simulator.geometry.slabs import Slabs
from simulator.materials import fresnel_slab
from simulator.materials.slab_insertion import Crossing, transported_through
from simulator.specular.free_space import direct_wave
from simulator.specular.image_method import Chain

SAMPLES_AT_ONCE = 1_000_000
"""Paths times frequencies evaluated in one batch: 16 MB for each complex quantity. [-]"""

PARALLEL = 1e-9
"""Angle below which two directions count as parallel; rounding (1e-16) is a ten-millionth of it.
[rad]"""

Through = tuple[tuple[Crossing, ...], ...]
"""The slabs on each leg of a path; empty: none on any."""

Gain = Callable[[Float[np.ndarray, "paths 3"]], Float[np.ndarray, " paths"]]
"""Field pattern of an antenna over unit directions outward from it."""


def isotropic(directions: Float[np.ndarray, "paths 3"]) -> Float[np.ndarray, " paths"]:
    """Field pattern of an isotropic antenna."""
    return np.ones(len(directions))


def reflected_field(
    mirrors: Mirrors,
    chain: Chain,
    frequencies: Float[np.ndarray, " freqs"],
    *,
    sent: Polarization = VERTICAL,
    received: Polarization = VERTICAL,
    at_place: Polarization | None = None,
    through: Through = (),
) -> Complex[np.ndarray, "paths freqs"]:
    """Received over transmitted field, without spreading and delay.

    The product of all reflections, with the coherent loss of roughness, between the fields of
    both antennas.

    Parameters
    ----------
    mirrors, chain
        Paths over a sequence of these mirrors.
    frequencies
        Any grid. [Hz]
    sent, received
        Polarizations of the antennas.
    at_place
        In place of a receiver's polarization: that of the antenna's image over the chain, along
        which the field at the path's end is taken.
    through
        The slabs on each leg, the same for all paths; empty: none.
    """
    everything = slice(0, len(chain.lengths))
    if at_place is None:
        return _field(mirrors, chain, everything, frequencies, (sent, received), through)
    # The image's ray has the direction of the path's last leg.
    image = Polarization(axis=at_place.axis, cross_polar=-at_place.cross_polar)
    return _field(mirrors, chain, everything, frequencies, (sent, image), through)


def _field(
    mirrors: Mirrors,
    chain: Chain,
    some: slice | Int[np.ndarray, " some"],
    frequencies: Float[np.ndarray, " freqs"],
    ends: tuple[Polarization, Polarization],
    through: Through = (),
) -> Complex[np.ndarray, "paths freqs"]:
    directions = chain.directions[some]
    sent, received = ends[0].field(directions[:, 0]), ends[1].field(-directions[:, -1])
    if not chain.mirrors and not any(through):
        link = dot(sent, received)[:, None] + 0j
        return np.repeat(link, frequencies.size, axis=1)
    wavenumbers = 2.0 * np.pi * frequencies / speed_of_light
    # Two components across the ray; their unit vectors before and after each mirror.
    vectors, field = [sent, sent], [np.ones((len(sent), 1)), np.zeros((len(sent), 1))]
    legs = through or ((),) * (len(chain.mirrors) + 1)
    lengths = chain.lengths[some]
    field, vectors = _past(legs[0], directions[:, 0], lengths, frequencies, field, vectors)
    for bounce, mirror in enumerate(chain.mirrors):
        inward, outward = directions[:, bounce], directions[:, bounce + 1]
        normals = mirrors.normals[mirror]
        if bounce == chain.bent_at:
            normals = _between(inward, outward, normals)
        across = _across(inward, normals)
        within = np.cross(inward, across)
        te, tm = _project(field, vectors, across), _project(field, vectors, within)
        cosines = chain.cosines[some, bounce]
        coefficients = fresnel_slab.reflection(mirrors.materials[mirror], frequencies, cosines)
        loss = roughness_loss(wavenumbers * mirrors.rms_heights[mirror] * cosines[:, None])
        field = [te * coefficients.te * loss, tm * coefficients.tm * loss]
        vectors = [across, np.cross(outward, across)]
        field, vectors = _past(legs[bounce + 1], outward, lengths, frequencies, field, vectors)
    return _project(field, vectors, received)


def _past(
    crossings: Sequence[Crossing],
    directions: Float[np.ndarray, "paths 3"],
    lengths: Float[np.ndarray, " paths"],
    frequencies: Float[np.ndarray, " freqs"],
    field: list[np.ndarray],
    vectors: list[np.ndarray],
) -> tuple[list[np.ndarray], list[np.ndarray]]:
    """Transmit a field, given by two components, through the slabs on a leg."""
    if not crossings:
        return field, vectors
    whole = field[0][..., None] * vectors[0][:, None] + field[1][..., None] * vectors[1][:, None]
    whole = np.broadcast_to(whole, (len(directions), frequencies.size, 3)).astype(np.complex128)
    arrived = transported_through(crossings, directions, lengths, frequencies, whole)
    across = _across(directions, crossings[-1].normal)
    within = np.cross(directions, across)
    parts = [np.einsum("pfx,px->pf", arrived, axis) for axis in (across, within)]
    return parts, [across, within]


def roughness_loss(phase: Float[np.ndarray, "*n"]) -> Float[np.ndarray, "*n"]:
    r"""Coherent reflection of a rough mirror relative to a smooth one, :math:`e^{-2 g^2}`. [-].

    For Gaussian heights, with :math:`g = k \sigma \cos\theta` in radians.
    """
    loss: np.ndarray = np.exp(-2.0 * phase**2)
    return loss


def specular_response(
    mirrors: Mirrors,
    chains: Iterable[Chain],
    frequencies: Float[np.ndarray, " freqs"],
    shape: tuple[int, int],
    *,
    transmit: Gain = isotropic,
    receive: Gain = isotropic,
    sent: Polarization = VERTICAL,
    received: Polarization = VERTICAL,
    waves: Waves = "spherical",
    slabs: Slabs | None = None,
) -> Complex[np.ndarray, "sources receivers freqs"]:
    """Sum the specular paths of each link.

    Parameters
    ----------
    mirrors, chains
        Input and output of :func:`simulator.specular.image_method.find_chains`.
    frequencies
        Any grid. [Hz]
    shape
        Numbers of sources and of receivers.
    transmit, receive
        Field patterns of the sources and of the receivers.
    sent, received
        Polarizations of the sources and of the receivers.
    waves
        Spherical (S-parameters), or cylindrical (fields of unit line sources).
    slabs
        The slabs to which the chains' sets refer.

    Returns
    -------
    S-parameters of all links; zero for links without a path. [-]
    """
    response = np.zeros((*shape, frequencies.size), dtype=np.complex128)
    paths_at_once = max(1, SAMPLES_AT_ONCE // frequencies.size)
    for chain in chains:
        gains = transmit(chain.departures) * receive(chain.arrivals)
        source, receiver = np.nonzero(chain.valid)
        for alike, through in _by_slabs(chain, slabs):
            for first in range(0, len(alike), paths_at_once):
                some = alike[first : first + paths_at_once]
                field = _field(mirrors, chain, some, frequencies, (sent, received), through)
                wave = direct_wave(chain.lengths[some], frequencies, waves=waves)
                field *= gains[some, None] * wave
                response[source[some], receiver[some]] += field  # no link occurs twice
    return response


def chain_response(
    mirrors: Mirrors,
    chain: Chain,
    frequencies: Float[np.ndarray, " freqs"],
    sender: AntennaGroup,
    receiver: AntennaGroup,
    slabs: Slabs | None,
) -> Complex[np.ndarray, " freqs"]:
    """Return the S-parameter of one chain from one antenna to another. [-].

    Parameters
    ----------
    mirrors, frequencies, slabs
        As in :func:`specular_response`.
    chain
        Of the link between the first antennas of two groups.
    sender, receiver
        Their patterns and polarizations.
    """
    response = specular_response(
        mirrors,
        [chain],
        frequencies,
        (1, 1),
        transmit=sender.pattern.towards,
        receive=receiver.pattern.towards,
        sent=sender.pattern.polarization,
        received=receiver.pattern.polarization,
        slabs=slabs,
    )
    return np.asarray(response[0, 0])


def _by_slabs(
    chain: Chain, slabs: Slabs | None
) -> Iterator[tuple[Int[np.ndarray, " paths"], Through]]:
    """Group a chain's paths by the slabs on each of their legs."""
    if slabs is None or chain.crossed is None:
        yield np.arange(len(chain.lengths)), ()
        return
    kinds, kind = np.unique(chain.crossed, axis=0, return_inverse=True)
    for index, sets in enumerate(kinds.tolist()):
        yield np.flatnonzero(kind.ravel() == index), tuple(slabs.crossings(one) for one in sets)


def _between(
    inward: Float[np.ndarray, "paths 3"],
    outward: Float[np.ndarray, "paths 3"],
    normal: Float[np.ndarray, " 3"],
) -> Float[np.ndarray, "paths 3"]:
    """Return the normals of the mirrors that would lead from one leg to the next."""
    turned = outward - inward
    length = np.linalg.norm(turned, axis=-1, keepdims=True)
    return np.where(length > PARALLEL, turned / np.maximum(length, PARALLEL), normal)


def _across(
    inward: Float[np.ndarray, "paths 3"], normal: Float[np.ndarray, "*#paths 3"]
) -> Float[np.ndarray, "paths 3"]:
    """Return unit vectors across the plane of incidence; at normal incidence any in the mirror."""
    across = np.cross(inward, normal)
    length = np.linalg.norm(across, axis=-1, keepdims=True)
    substitute = np.cross(normal, np.eye(3)[np.argmin(np.abs(normal), axis=-1)])
    substitute /= np.linalg.norm(substitute, axis=-1, keepdims=True)
    # Below, the cross product's direction is rounding, and not needed: TE and TM agree.
    return np.where(length > PARALLEL, across / np.maximum(length, PARALLEL), substitute)


def _project(
    field: list[np.ndarray], vectors: list[np.ndarray], onto: Float[np.ndarray, "paths 3"]
) -> np.ndarray:
    """Component along a unit vector of a field given by two components."""
    parts = [
        component * dot(vector, onto)[:, None]
        for component, vector in zip(field, vectors, strict=True)
    ]
    total: np.ndarray = parts[0] + parts[1]
    return total
