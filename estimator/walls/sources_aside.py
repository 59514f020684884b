r"""Bright sources beyond the angles without grating lobes, and the echo without them.

Elements farther apart than a quarter of the shortest wavelength see a source at sine s again at
s ± λ/2d. Over the band that lobe is smeared, but the flash of a wall or a post that faces the array
is so much brighter than the diffuse echo of other walls that its smear passes for targets, for ends
of walls, and its sidelobes for walls. The source itself is in the image as well, beyond the sector
that is searched. So its echo is estimated there and taken off the data, the brightest first,
as long as it is brighter than all that the sector shows at its range:
scatterers on all cells about the source, as wide as the array, since a facing wall is seen by each
element at another place, are fitted to the range profiles by least squares (one step of CLEAN
[1]_ with an extended source).

References
----------
.. [1] J. A. Högbom, "Aperture synthesis with a non-regular distribution of interferometer
       baselines", Astronomy and Astrophysics Supplement 15, 1974.
"""

from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light
from scipy.linalg import cho_solve
from scipy.ndimage import maximum_filter, maximum_filter1d

from estimator.array.linear_array import WIDEST_SINE, echo_resolution, imaged_sine
from estimator.array.resolution_cell import Resolution
from estimator.geometry.wall_2d import unit_normal
from estimator.imaging.focusing import PreparedEcho
from estimator.imaging.peak_detection import mean_background
from estimator.imaging.survey_2d import STEP, focus_sector, sector_points, survey_grid
from estimator.measurement.model import Echo
from estimator.walls.scatterer_row import (
    adjoint,
    factorized,
    ranges_to,
    row_echoes,
    row_profiles,
    sweep_of,
)

MOST_SOURCES = 8
"""Sources that are taken off at the most, for time: each takes an image of all directions and a
fit, some two seconds. In one of nine random rooms for tuning it binds: thirteen would be taken off,
and without the last five 2 % of the echo's energy is left (``python -m
validation.experiments.thresholds limits``), with two false targets, which 16 sources do not show.
[-]"""
LEAST_LEVEL = 300.0
"""Intensity of a source over the image's background from which its grating lobe, smeared over some
30 cells, stands out of it. [-]"""
NEAR_LOBE = 0.5
"""Distance in range within which the lobe of a source appears, over the aperture: the delays of the
elements are those of the source's sine, which differs from the lobe's by about 1. [-]"""
BORDER = 3
"""Distance beyond the sector within which a source is in it with a part of its lobe, which ends at
1.4 cells: it is imaged, and no lobe of something else. [pixels]"""
MOST_OF_IT = 0.5
"""Share of the energy from which a source is fitted once more after the others. [-]"""
DEPTH_SPACING, SPACING = 0.75, 0.5
"""Distances of the scatterers along the ray and across it. With 0.75 across, three of 40 dB are
left of a post's flash, and its lobes still stand out. [cells]"""
CELLS_DEEP = 2.25
"""How far they go on before and behind the source. [cells]"""
CELLS_BESIDE = 4.0
"""How far they go on to either side, beside half the aperture. [cells]"""
OWN = 4.0
"""Distance from a line's extension within which a source is a part of the same wall: its direction
is known to a cell or so over its length, and the wall may go on beyond the sector for as far again.
[cells]"""
MOST_SCATTERERS = 600
"""Scatterers about one source, for time: of larger apertures less is covered. [-]"""


@dataclass(frozen=True, kw_only=True)
class Cleaned:
    """An echo without bright sources beyond the imaged sector."""

    prepared: PreparedEcho  # the very one that was given, if there are none
    strongest: float
    """Intensity of the brightest source in the tapered image, 0 of none: an echo of bright
    sources is not noisy. [-]"""
    places: Float[np.ndarray, "sources 3"]  # where they are [m]
    image: Complex[np.ndarray, "ranges sines"] | None
    """Tapered, on the survey's grid; ``None`` if it is not known. [-]"""
    taken: tuple[Complex[np.ndarray, "positions freqs"], ...] = ()  # each source's echo
    _kept: dict[tuple[int, ...], PreparedEcho] = field(default_factory=dict)

    def with_those_on(
        self,
        start: Float[np.ndarray, " 3"],
        end: Float[np.ndarray, " 3"],
        resolution: Resolution,
    ) -> PreparedEcho:
        """Return the echo without the sources that are not on the line through two points.

        A wall may go on beyond the sector and be bright there; where something else is bright, its
        lobes go on beside the wall.
        """
        middle, normal = 0.5 * (start + end), unit_normal(start, end)
        own = tuple(
            number
            for number, place in enumerate(self.places)
            if abs(float((place - middle) @ normal)) < OWN * float(resolution.cell(place, normal))
        )
        if not own:
            return self.prepared
        if own not in self._kept:
            echo = self.prepared.echo
            back = np.sum([self.taken[number] for number in own], axis=0)
            self._kept[own] = PreparedEcho(replace(echo, samples=echo.samples + back))
        return self._kept[own]


def nothing_aside(prepared: PreparedEcho) -> Cleaned:
    """Return an echo as it is."""
    return Cleaned(prepared=prepared, strongest=0.0, places=np.zeros((0, 3)), image=None)


def without_sources_aside(prepared: PreparedEcho) -> Cleaned:
    """Take the bright sources beyond the imaged sector off an echo.

    Parameters
    ----------
    prepared
        The echo. It is left as it is if the sector is as wide as any that is imaged.
    """
    echo = prepared.echo
    limit = imaged_sine(echo)
    if limit >= WIDEST_SINE:
        return nothing_aside(prepared)
    ranges, sines = survey_grid(echo, WIDEST_SINE)
    points = sector_points(ranges[:, None], sines)
    inner = len(survey_grid(echo, limit)[1])
    outer = (len(sines) - inner) // 2
    within = slice(outer, outer + inner)
    border = slice(max(outer - BORDER, 0), outer + inner + BORDER)
    near = NEAR_LOBE * float(np.ptp(echo.positions[:, 0]))
    rows = int(np.ceil(near / (STEP * echo_resolution(echo).along_ray)))
    places: list[Float[np.ndarray, " 3"]] = []
    dominant = []
    taken: list[Complex[np.ndarray, "positions freqs"]] = []
    strongest = 0.0
    image = None
    for _ in range(MOST_SOURCES):
        image = focus_sector(prepared, ranges, sines)
        intensity = np.abs(image) ** 2
        # The lobe of what is within the sector is weaker than that.
        shadow = maximum_filter1d(intensity[:, border].max(axis=1), 2 * rows + 1)
        tops = (intensity == maximum_filter(intensity, size=3)) & (intensity > shadow[:, None])
        tops[:, border] = False
        brightest = np.argmax(np.where(tops, intensity, 0.0))
        if not intensity.flat[brightest] > LEAST_LEVEL * mean_background(intensity):
            break
        if not tops.flat[brightest]:
            break
        place = points.reshape(-1, 3)[brightest]
        places.append(place)
        strongest = max(strongest, float(intensity.flat[brightest]))
        taken.append(_source_echo(echo, place))
        left = echo.samples - taken[-1]
        if np.linalg.norm(left) ** 2 < (1 - MOST_OF_IT) * np.linalg.norm(echo.samples) ** 2:
            dominant.append(len(places) - 1)
        echo, image = replace(echo, samples=left), None
        prepared = PreparedEcho(echo)
    # What was fitted while others were there is left in part.
    for number in dominant:
        more = _source_echo(echo, places[number])
        taken[number] = taken[number] + more
        echo, image = replace(echo, samples=echo.samples - more), None
    if dominant:
        prepared = PreparedEcho(echo)
    return Cleaned(
        prepared=prepared,
        strongest=strongest,
        places=np.array(places).reshape(-1, 3),
        image=None if image is None else image[:, within],
        taken=tuple(taken),
    )


def _source_echo(
    echo: Echo, place: Float[np.ndarray, " 3"]
) -> Complex[np.ndarray, "positions freqs"]:
    """Fit scatterers about a place to the echo, and return theirs."""
    resolution = echo_resolution(echo)
    reach = float(np.linalg.norm(place))
    ray = place / reach
    across = np.array([ray[1], -ray[0], 0.0])
    cell = resolution.across_ray * reach
    half = 0.5 * float(np.ptp(echo.positions[:, 0])) + CELLS_BESIDE * cell
    deep = int(np.ceil(CELLS_DEEP / DEPTH_SPACING))
    rows = 2 * deep + 1
    wide = min(int(np.ceil(half / (SPACING * cell))), (MOST_SCATTERERS // rows - 1) // 2)
    along = DEPTH_SPACING * resolution.along_ray * np.arange(-deep, deep + 1)
    beside = SPACING * cell * np.arange(-wide, wide + 1)
    patch = (place + along[:, None, None] * ray + beside[:, None] * across).reshape(-1, 3)
    # What is within the sector is searched there.
    patch = patch[np.abs(patch[:, 0]) > imaged_sine(echo) * np.linalg.norm(patch, axis=-1)]
    ends = place + beside[[0, -1], None] * across
    profiles = row_profiles(echo, ends[0], ends[1])
    echoes = row_echoes(echo, profiles, patch)
    strengths = cho_solve(factorized(echoes), adjoint(echoes, profiles.values.ravel()))
    return _echo_of(echo, patch, strengths)


def _echo_of(
    echo: Echo, points: Float[np.ndarray, "points 3"], strengths: Complex[np.ndarray, " points"]
) -> Complex[np.ndarray, "positions freqs"]:
    """Return the echo of scatterers, each of which gives its strength at range 0."""
    sweep = sweep_of(echo)
    ranges = ranges_to(echo, points)
    # A phase over uniform frequencies is that of a coarse grid times that of a fine one, and all of
    # them are powers.
    fine = int(np.ceil(np.sqrt(sweep.count)))
    coarse = -(-sweep.count // fine)
    scale = -4j * np.pi / speed_of_light
    step = np.exp(scale * sweep.step * ranges)
    first = strengths * np.exp(scale * float(echo.frequencies[0]) * ranges)
    near = _powers(np.ones_like(step), step, fine)
    far = _powers(first, near[-1] * step, coarse)
    spectra = np.matmul(far.transpose(1, 0, 2), near.transpose(1, 2, 0))
    return np.asarray(spectra.reshape(len(ranges), -1)[:, : sweep.count])


def _powers(
    first: Complex[np.ndarray, "*n"], factor: Complex[np.ndarray, "*n"], count: int
) -> Complex[np.ndarray, "count *n"]:
    """Return a first value times the powers of a factor, from 0 on."""
    powers = np.empty((count, *first.shape), dtype=np.complex128)
    powers[0] = first
    for number in range(1, count):
        np.multiply(powers[number - 1], factor, out=powers[number])
    return powers
