"""The part of an array that a wave reaches: an edge before the source may shadow the rest.

An obstacle whose edge is before a user shadows a part of the aperture. A single spherical wave that
is fitted to all of it has its direction and curvature from where the shadow begins, or is taken for
two waves. So the samples of each element are matched to the wave in amplitude alone, whose phases
need not be known to a part of a wavelength, and the wave is fitted to the elements that it reaches.
The fringes beside the edge of a shadow are not modelled: they bend what is left of the front, and a
wave that they bend much is no mirror-like one (:attr:`estimator.channel.path.Path.specular`).

Linear and planar arrays differ in which elements are neighbours, and in no more.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.constants import speed_of_light
from scipy.ndimage import label, median_filter
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import KDTree

from estimator.array.planar_array import planar_array, spans_a_plane
from estimator.channel.path import Shadow
from estimator.measurement.model import Uplink
from estimator.wavefronts.noise_variance import noise_variance

DARK = 0.06
"""Power at an element, over the greatest, below which the wave does not reach it. A quarter of the
amplitude: half of what a knife edge leaves on the boundary of its shadow. [-]"""
DARK_REST = 0.04
"""Largest mean power of the elements that the wave does not reach, over that of the others. Fronts
that roughness bends, or two waves in one cell, fade at many places and nowhere for long. [-]"""
FADES = 5
"""Elements of a line over whose median the power is taken: single ones may fade. [-]"""
FADES_IN_PLANE = 9
"""The same of a plane: an element and the eight about it. [-]"""
BESIDE = 1.5
"""Distance of neighbours in a plane, over the larger spacing: along the diagonal it is 1.41. [-]"""
FEWEST = 12
"""Fewest elements that a wave is fitted to: as many as tell its three parameters with four to each,
or a planar array's four with three. [-]"""
LEAST_SHADOW = 0.05
"""Share of the elements in the shadow from which it counts: less moves nothing by more than the
noise does. [-]"""


@dataclass(frozen=True, kw_only=True)
class LitPart:
    """What a wave reaches of a pilot's array, seen from its own centre."""

    lit: Bool[np.ndarray, " elements"] | None  # the elements; None: all
    pilot: Uplink  # what they received, with positions over their centre
    centre: Float[np.ndarray, " 3"]  # of these; of all the array's origin [m]


def lit_part(uplink: Uplink, source: Float[np.ndarray, " 3"]) -> LitPart:
    """Return what a wave reaches of an array; see :func:`lit_elements`."""
    lit = lit_elements(uplink, source)
    part = part_of(uplink, lit)
    centre = np.zeros(3) if lit is None else part.positions.mean(axis=0)
    return LitPart(lit=lit, pilot=replace(part, positions=part.positions - centre), centre=centre)


def lit_elements(
    uplink: Uplink, source: Float[np.ndarray, " 3"]
) -> Bool[np.ndarray, " elements"] | None:
    """Tell which elements of an array a wave reaches.

    Parameters
    ----------
    uplink
        With positions in the array's frame; along a line they are in order.
    source
        Where the wave comes from, to a part of a cell in direction and distance. [m]

    Returns
    -------
    One run of elements, or one patch of a planar array; ``None`` if all, or if it is not one that
    it reaches.
    """
    count, freqs = uplink.samples.shape
    lengths = np.linalg.norm(uplink.positions - source, axis=-1)
    turns = np.outer(lengths, uplink.frequencies / speed_of_light)
    received = np.einsum("mn,mn->m", np.exp(2j * np.pi * (turns - np.round(turns))), uplink.samples)
    # The wave falls with distance: what it would be as far away as the array's centre.
    amplitude = np.abs(received) / freqs * lengths / float(np.linalg.norm(source))
    power = np.maximum(amplitude**2 - noise_variance(uplink.samples) / freqs, 0.0)
    patch = _patches_in_a_plane if spans_a_plane(uplink.positions) else _runs_on_a_line
    reached = patch(power, uplink.positions)
    if reached.max() == 0:
        return None
    held = np.bincount(reached, weights=power)
    held[0] = 0.0
    lit: np.ndarray = reached == int(np.argmax(held))
    shadow = count - int(lit.sum())
    if shadow < LEAST_SHADOW * count or lit.sum() < FEWEST:
        return None
    if power[~lit].mean() > DARK_REST * power[lit].mean():
        return None
    return lit


def _runs_on_a_line(
    power: Float[np.ndarray, " elements"], positions: Float[np.ndarray, "elements 3"]
) -> Int[np.ndarray, " elements"]:
    """Return for each element the number of its run of lit ones, from 1; 0: it is dark."""
    smooth = median_filter(power, size=min(FADES, len(positions)), mode="nearest")
    return np.asarray(label(smooth > DARK * smooth.max())[0], dtype=np.int64)


def _patches_in_a_plane(
    power: Float[np.ndarray, " elements"], positions: Float[np.ndarray, "elements 3"]
) -> Int[np.ndarray, " elements"]:
    """Return for each element the number of its patch of lit ones; 0: dark, or in no plane."""
    tree = KDTree(positions)
    about = tree.query(positions, k=min(FADES_IN_PLANE, len(positions)))[1]
    smooth = np.median(power[about], axis=1)
    bright = smooth > DARK * smooth.max()
    pairs = tree.query_pairs(BESIDE * max(planar_array(positions).spacing), output_type="ndarray")
    pairs = pairs[bright[pairs].all(axis=1)]
    count = len(positions)
    graph = coo_array((np.ones(len(pairs)), (pairs[:, 0], pairs[:, 1])), shape=(count, count))
    patches = np.where(bright, 1 + connected_components(graph, directed=False)[1], 0)
    for patch in np.unique(patches[bright]):
        if not spans_a_plane(positions[patches == patch]):
            patches[patches == patch] = 0
    return np.asarray(patches, dtype=np.int64)


def part_of(uplink: Uplink, lit: Bool[np.ndarray, " elements"] | None) -> Uplink:
    """Return what some elements received.

    Parameters
    ----------
    uplink
        The pilot.
    lit
        The elements; ``None``: all.
    """
    if lit is None:
        return uplink
    return replace(uplink, samples=uplink.samples[lit], positions=uplink.positions[lit])


def shadow_of(uplink: Uplink, lit: Bool[np.ndarray, " elements"] | None) -> Shadow | None:
    """Return what an edge takes of a wave that reaches some elements; ``None``: it reaches all."""
    if lit is None:
        return None
    return Shadow(
        lit=lit,
        reached=uplink.positions[lit].mean(axis=0),
        dark=uplink.positions[~lit].mean(axis=0),
    )
