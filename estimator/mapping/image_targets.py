"""Targets in one image of a scene near an aperture: what stands out of it, and is no sidelobe."""

from dataclasses import replace

import numpy as np
import scipy.ndimage
from jaxtyping import Bool, Complex, Float
from scipy.constants import speed_of_light
from scipy.spatial import cKDTree

from estimator import false_alarm
from estimator.array.resolution import largest_spacing
from estimator.array.windows import survey_weights
from estimator.imaging.backprojection import Focuser, focus
from estimator.imaging.energy_region import (
    cells_at,
    evenly_chosen,
    focused,
    focuser_for,
    middles,
    some_positions,
)
from estimator.imaging.peak_detection import peak_shift
from estimator.imaging.range_compression import unambiguous_path
from estimator.mapping.facing_depth import facing_surface
from estimator.measurement.model import Echo
from estimator.results.estimate import Target
from estimator.results.pixel_grid import PixelGrid

FAINTEST = 1e-2
"""Intensity over the brightest target's of what still is one: −20 dB, above what a lobe of an
extended target reaches at a few frequencies. [-]"""
FAINTEST_ALIASED = 0.25
"""The same where neighbouring positions are more than λ/4 apart: at λ/2, grating lobes near the
aperture reach −7.5 dB. [-]"""
REGION = 0.1
"""Intensity over a target's peak that still belongs to it: −10 dB, inside of any main lobe. [-]"""
WINDOW = 60
"""Half the side of the neighbourhood of a peak in which its region is followed, for time. With 30
and 120 the targets of 30 scans are the same (``python -m validation.experiments.thresholds
images``). [pixels]"""
WIDE = 4.0
"""Extent from which a target may be more than a point, of which the tapered lobe spans 2.7 down to
:data:`REGION`. [cells]"""
BROADER = 3.0
"""How far below :data:`REGION` a point's own response may be at the ends of a region that a point
alone explains: with few frequencies it is long in depth, and longer behind the point than before
it. It is what a pixel at either end changes; with 1.5 and 6 the targets of 30 scans are the same
(``python -m validation.experiments.thresholds images``). [-]"""
RESPONSE = 41
"""Points along a region at which a point's own response is computed. [-]"""
SHADOW = 0.1
"""Intensity over a brighter target's of what is out of focus before or behind it, along the same
ray: with few frequencies the image is long in range, and only its ends are told apart. [-]"""
SHADOW_CELLS = 2.0
"""Distance across the ray within which something is before or behind another: its main lobe, which
ends at 1.4, and half a cell by which either is off. With 1 and 4 the targets of 30 scans are the
same (``python -m validation.experiments.thresholds images``). [cells]"""
REPEATED_WITHIN = 2.0
"""Distance from where a repetition would come from in which its origin is looked for: as
:data:`SHADOW_CELLS`, and measured with it. [cells]"""
MOST_TARGETS = 24
"""Targets at which the search ends, for time: 30 scans show 38 targets in all, with half and twice
as many the same (``python -m validation.experiments.thresholds images``). [-]"""
ZOOM = 7
"""Points along each axis on which a maximum is focused anew, within a pixel of it. [-]"""
ZOOMS = 4
"""How often: each is three times as fine, the last 1/27 of a third of a pixel. [-]"""
RANDOM = 20.0
"""Coherence factor times positions of what is one wave: of random phases it is exponential with
mean one, and passes 20 at one of 5e8 places. [-]"""
LEAST_COHERENCE = 0.5
"""Coherence factor from which something is one wave however few positions there are (fewer than
twice :data:`RANDOM`): more than half of the energy in phase. [-]"""
MOST_CHANNELS = 5000
"""Positions that are asked for :data:`RANDOM`: an extended target has the coherence of a part of
itself. [-]"""


def image_targets(
    echo: Echo,
    grid: PixelGrid,
    values: Complex[np.ndarray, "x y z"],
    weights: Float[np.ndarray, "positions freqs"],
) -> tuple[Target, ...]:
    """Find targets in an image.

    Parameters
    ----------
    echo
        In the frame of the grid.
    grid, values
        An image with low sidelobes.
    weights
        That it was formed with.

    Returns
    -------
    Targets in the same frame, the strongest first.
    """
    intensity = np.abs(values) ** 2
    if not intensity.any():
        return ()
    axes = (grid.x, grid.y, grid.z)
    strongest = float(intensity.max())
    cells = float(intensity.size)
    least = max(
        (FAINTEST_ALIASED if _aliased(echo) else FAINTEST) * strongest,
        false_alarm.threshold(false_alarm.TARGET, cells=cells) * _noise(echo, weights),
    )
    tops = (intensity == scipy.ndimage.maximum_filter(intensity, size=3)) & (intensity >= least)
    tops &= ~_rim(intensity.shape)
    places = np.argwhere(tops)
    places = places[np.argsort(-intensity[tops], kind="stable")]
    if not places.size:
        return ()
    corners = np.stack(np.meshgrid(*[axis[[0, -1]] for axis in axes], indexing="ij"), axis=-1)
    pixel = np.array([axis[1] - axis[0] if axis.size > 1 else 0.0 for axis in axes])
    reach = np.concatenate([corners.reshape(-1, 3) - 2 * pixel, corners.reshape(-1, 3) + 2 * pixel])
    focuser = focuser_for(echo, reach, weights)
    taken = np.zeros(intensity.shape, dtype=bool)
    found: list[Target] = []
    levels: list[float] = []
    for place in places:
        if len(found) == MOST_TARGETS:
            break
        if taken[tuple(place)]:
            continue
        level = float(intensity[tuple(place)])
        region = _region(intensity, place, REGION * level)
        if (region & taken).any():
            taken |= region
            continue
        taken |= region
        peak = np.array(
            [_between(intensity, axes[axis], place, axis) for axis in range(3)], dtype=np.float64
        )
        cells = cells_at(echo, peak[None])[0]
        if _repeats(peak, level, intensity, axes, echo):
            continue
        if found and (_in_shadow(peak, level, found, levels, cells) or not _one_wave(echo, peak)):
            continue  # the strongest is nobody's sidelobe
        target = _target(echo, focuser, peak, level, region, intensity, axes)
        found.append(target if found else _at_its_depth(target, echo, peak, region, axes))
        levels.append(level)
    return tuple(found)


def _at_its_depth(
    target: Target,
    echo: Echo,
    peak: Float[np.ndarray, " 3"],
    region: Bool[np.ndarray, "x y z"],
    axes: tuple[np.ndarray, ...],
) -> Target:
    """Put a flat thing that faces the array where it is: its image is brightest beyond it."""
    seen = np.argwhere(region)
    ends = [[axis[i] for axis, i in zip(axes, end, strict=True)]
            for end in (seen.min(axis=0), seen.max(axis=0))]  # fmt: skip
    surface = facing_surface(echo, peak, np.array(ends[0]), np.array(ends[1]))
    if surface is None:
        return target
    place = np.array([target.position[0], surface.depth, target.position[2]])
    along = None
    if target.ends is not None:
        along = target.ends.copy()
        along[:, 1] = surface.depth
    return replace(target, position=place, ghost=place, ends=along)


def _aliased(echo: Echo) -> bool:
    """Tell whether the spacing leaves grating lobes somewhere in front. [-]."""
    places = middles(echo)
    nearest = np.asarray(cKDTree(places).query(places, k=2)[0])[:, 1]
    wavelength = speed_of_light / float(echo.frequencies[-1])
    return float(np.median(nearest)) > largest_spacing(wavelength)


def _noise(echo: Echo, weights: Float[np.ndarray, "positions freqs"]) -> float:
    """Return what the samples would leave in the image if all of them were noise. [-]."""
    power = float(np.mean(np.abs(echo.samples) ** 2))
    return power * float((weights**2).sum() / weights.sum() ** 2)


def _rim(shape: tuple[int, ...]) -> Bool[np.ndarray, "x y z"]:
    """Mark the outermost pixels: a maximum there goes on outside."""
    rim = np.ones(shape, dtype=bool)
    rim[tuple(slice(1, -1) if size > 2 else slice(None) for size in shape)] = False
    return rim


def _region(
    intensity: Float[np.ndarray, "x y z"], place: np.ndarray, least: float
) -> Bool[np.ndarray, "x y z"]:
    """Mark the pixels around a maximum that hang together with it, as far as it is looked."""
    window = tuple(slice(max(i - WINDOW, 0), i + WINDOW + 1) for i in place)
    inside = tuple(int(i) - part.start for i, part in zip(place, window, strict=True))
    parts = scipy.ndimage.label(intensity[window] >= least, structure=np.ones((3, 3, 3)))[0]
    region = np.zeros(intensity.shape, dtype=bool)
    region[window] = parts == parts[inside]
    return region


def _between(
    intensity: Float[np.ndarray, "x y z"], axis_places: np.ndarray, place: np.ndarray, axis: int
) -> float:
    """Return where a parabola through the logarithms around a maximum peaks. [m]."""
    line = intensity[tuple(slice(None) if i == axis else int(k) for i, k in enumerate(place))]
    index = int(place[axis])
    shift = peak_shift(line, index)
    if shift == 0:  # as on a single plane, which has no step
        return float(axis_places[index])
    return float(axis_places[index]) + shift * float(axis_places[1] - axis_places[0])


def _in_shadow(
    peak: Float[np.ndarray, " 3"],
    level: float,
    found: list[Target],
    levels: list[float],
    cells: Float[np.ndarray, " 3"],
) -> bool:
    """Tell whether a peak may be a brighter target out of focus."""
    for other, brighter in zip(found, levels, strict=True):
        if level > SHADOW * brighter:
            continue
        apart = np.abs(peak - other.position) / cells
        if apart[0] < SHADOW_CELLS and apart[2] < SHADOW_CELLS:
            return True
    return False


def _one_wave(echo: Echo, place: Float[np.ndarray, " 3"]) -> bool:
    """Tell whether what all positions receive from a place adds up as no random phases do."""
    chosen = evenly_chosen(len(echo.positions), MOST_CHANNELS)
    ends = [echo.positions[chosen]]
    ends.append(ends[0] if echo.transmit_positions is None else echo.transmit_positions[chosen])
    length = sum(np.linalg.norm(place - end, axis=1) for end in ends)
    turned = np.einsum(
        "mf,mf->m",
        echo.samples[chosen],
        np.exp(2j * np.pi / speed_of_light * np.outer(length, echo.frequencies)),
    )
    energy = float(np.vdot(turned, turned).real)
    return abs(complex(turned.sum())) ** 2 > min(RANDOM, LEAST_COHERENCE * chosen.size) * energy


def _repeats(
    peak: Float[np.ndarray, " 3"],
    level: float,
    intensity: Float[np.ndarray, "x y z"],
    axes: tuple[np.ndarray, ...],
    echo: Echo,
) -> bool:
    """Tell whether a peak may be something nearer, repeated by the unambiguous range."""
    period = unambiguous_path(echo.frequencies) / 2
    centre = middles(echo).mean(axis=0)
    away = float(np.linalg.norm(peak - centre))
    if away <= period:
        return False
    origin = centre + (peak - centre) * (1 - period / away)
    window = []
    cells = cells_at(echo, origin[None])[0]
    for axis, places in enumerate(axes):
        near = np.abs(places - origin[axis]) <= REPEATED_WITHIN * max(
            cells[axis], float(np.ptp(places)) / max(places.size - 1, 1)
        )
        if not near.any():
            return False
        window.append(np.flatnonzero(near))
    return bool(intensity[np.ix_(*window)].max() > SHADOW * level)


def _refined(
    focuser: Focuser, peak: Float[np.ndarray, " 3"], pixel: Float[np.ndarray, " 3"]
) -> Float[np.ndarray, " 3"]:
    """Focus around a maximum ever more finely. [m]."""
    steps = np.linspace(-1.0, 1.0, ZOOM)
    lines = [steps if size > 0 else np.zeros(1) for size in pixel]
    offsets = np.stack(np.meshgrid(*lines, indexing="ij"), axis=-1).reshape(-1, 3)
    size = pixel
    for _ in range(ZOOMS):
        tried = peak + offsets * size
        peak = tried[int(np.argmax(np.abs(focus(focuser, tried))))]
        size = size * 2 / (ZOOM - 1)
    return peak


def _target(
    echo: Echo,
    focuser: Focuser,
    peak: Float[np.ndarray, " 3"],
    level: float,
    region: Bool[np.ndarray, "x y z"],
    intensity: Float[np.ndarray, "x y z"],
    axes: tuple[np.ndarray, ...],
) -> Target:
    members = np.argwhere(region)
    points = np.stack([axis[members[:, i]] for i, axis in enumerate(axes)], axis=-1)
    shares = intensity[region] / intensity[region].sum()
    centre = (shares[:, None] * points).sum(axis=0)
    spread = (points - centre) * np.sqrt(shares)[:, None]
    axis = np.linalg.svd(spread, full_matrices=False)[2][0]
    along = (points - centre) @ axis
    ends = centre + np.array([[along.min()], [along.max()]]) * axis
    extents = np.ptp(points, axis=0) / cells_at(echo, peak[None])[0]
    if extents.max() < WIDE or _looks_so_long(echo, peak, ends):
        pixel = np.array([a[1] - a[0] if a.size > 1 else 0.0 for a in axes])
        return _point(_refined(focuser, peak, pixel), level, None)
    return _point(centre, level, ends)


def _looks_so_long(
    echo: Echo, peak: Float[np.ndarray, " 3"], ends: Float[np.ndarray, "2 3"]
) -> bool:
    """Tell whether the aperture shows a single point as long as a region is."""
    chosen = evenly_chosen(len(echo.positions), MOST_CHANNELS)
    part = some_positions(echo, chosen)
    legs = [part.positions]
    legs.append(legs[0] if part.transmit_positions is None else part.transmit_positions)
    length = sum(np.linalg.norm(peak - end, axis=1) for end in legs)
    wave = np.exp(-2j * np.pi / speed_of_light * np.outer(length, part.frequencies))
    point = replace(part, samples=wave)
    line = ends[0] + np.linspace(0.0, 1.0, RESPONSE)[:, None] * (ends[1] - ends[0])
    # The region bends around its axis; the peak itself is the nearest that a straight line passes.
    nearest = int(np.argmin(np.linalg.norm(line - peak, axis=1)))
    line += peak - line[nearest]
    shown = np.abs(focused(point, line, survey_weights(part))) ** 2
    return bool(min(shown[0], shown[-1]) * BROADER > REGION * shown[nearest])


def _point(
    place: Float[np.ndarray, " 3"], level: float, ends: Float[np.ndarray, "2 3"] | None
) -> Target:
    return Target(position=place, ghost=place, level_db=float(10 * np.log10(level)), ends=ends)
