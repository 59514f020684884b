r"""The delay of cables and antennas, and the sign of the phase, from the focus itself.

The strongest echo of a point is a wave whose phase over the aperture tells the point's distance R
by its curvature, whatever its delay. With amplitudes :math:`a_n` free at every frequency,

.. math:: C(p) = \frac{\sum_n | \sum_m s_{mn} e^{j k_n (L_m(p) - L_0(p))} |^2}
                      {M \sum_{mn} |s_{mn}|^2}

(:math:`L_m` the path from the antenna to p, and back in an echo; 0 is the aperture's middle) is 1
for a single point, and its maximum needs no delay. The phases of the :math:`a_n` there tell the
delay: what it has more than :math:`L_0(p)` lies in cables and antennas, or, less, in a reflector
that is round. A wave that converges instead of spreading was recorded with the other sign.

The aperture grows from a few wavelengths to its whole, each time from the last answer: the
curvature of the next step is known well enough by then. Variances are clustered by position (the
"sandwich" of robust statistics), as what does not fit a point is alike at all frequencies.
"""

import math
from dataclasses import dataclass, replace

import numpy as np
import scipy.optimize
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.measurement.model import Echo, Uplink

MOST_SAMPLES = (240, 24)
"""Positions and frequencies that are looked at: curvature needs no more. [-]"""

MOST_PLACES = 4000
"""Positions of which those of a part of the aperture are chosen. [-]"""

FEW = (40, 8)
"""Positions and frequencies of the first, coarse search. [-]"""

FIRST_APERTURE = 6.0
"""The aperture that the search begins with, in wavelengths. [-]"""

NEAREST = 0.25
"""Of the points that are looked for, over the aperture's extent. [-]"""

BLOCK = 1000
"""Trials that are summed at once: some ten megabytes. [-]"""

MOST_TRIALS = 100_000
"""Directions and curvatures of the coarse search: a second of the processor. An array needs more
only where its spacing is tens of wavelengths over a large aperture, and there aliases of the
direction agree as well as the truth. [-]"""

SINGLE = 0.7
"""Least coherence C of an echo that is taken for one point's: below, others have a third of its
power, and the curvature is theirs as well. [-]"""


@dataclass(frozen=True, kw_only=True)
class FocusDelay:
    """What the focus of the strongest echo or pilot says."""

    coherence: float  # of the samples with one point's wave, 0…1 [-]
    curvature: float  # one over its distance from the aperture's middle; below 0: converging [1/m]
    curvature_deviation: float  # [1/m]
    path: float  # by the delay: from the aperture's middle, in an echo there and back [m]
    excess: float  # of that over the path by the curvature; modulo c over the frequency step [m]
    excess_deviation: float  # [m]


def focus_delay(data: Echo | Uplink, boresight: Float[np.ndarray, " 3"]) -> FocusDelay | None:
    """Compare the curvature of the strongest wave with its delay.

    Parameters
    ----------
    data
        A measurement of five positions or more.
    boresight
        The side of the array that is looked at.

    Returns
    -------
    What curvature and delay say, whether they fit or not; None where no wave stands out, the
    aperture is too small, or its positions are too sparse to search (`MOST_TRIALS`).
    """
    if len(data.samples) < 5 or data.frequencies.size < 3:
        return None
    view = _View.of(data, boresight)
    if view is None:
        return None
    place = None  # direction sines, curvature
    wave = speed_of_light / float(view.frequencies[-1])
    size, whole = FIRST_APERTURE * wave, view.extent
    while True:
        part = view.part(min(size, whole))
        if len(part.positions) >= 5:
            begin = _coarse(part, whole) if place is None else _around(part, place)
            if begin is None:
                return None
            place = _refined(part, begin)
        if size >= whole:
            break
        size *= 2
    if place is None:
        return None
    return _judged(view, place, data)


@dataclass(frozen=True, kw_only=True)
class _View:
    """Some of the samples, in the array's own frame."""

    samples: Complex[np.ndarray, "positions freqs"]
    positions: Float[np.ndarray, "positions 3"]  # from the middle [m]
    transmit: Float[np.ndarray, "positions 3"] | None
    frequencies: Float[np.ndarray, " freqs"]
    across: Float[np.ndarray, "axes 3"]  # unit vectors along the array
    boresight: Float[np.ndarray, " 3"]
    ways: int  # 2 of an echo

    @staticmethod
    def of(
        data: Echo | Uplink, boresight: Float[np.ndarray, " 3"], *, all_frequencies: bool = False
    ) -> "_View | None":
        middle = data.positions.mean(axis=0)
        centred = data.positions - middle
        _, spread, axes = np.linalg.svd(centred, full_matrices=False)
        looking = boresight / np.linalg.norm(boresight)
        wave = speed_of_light / float(data.frequencies[-1])
        used = [axis for axis, one in zip(axes, spread, strict=True) if one > 1e-3 * spread[0]]
        across = [axis for axis in used if abs(axis @ looking) < 0.1]
        if len(across) < len(used) or not across or np.ptp(centred @ across[0]) < 3 * wave:
            return None  # neither line nor plane across the boresight, or too small
        rng = np.random.default_rng(0)  # which positions: any, but always the same
        chosen = np.arange(len(centred))
        step = 1 if all_frequencies else max(1, data.frequencies.size // MOST_SAMPLES[1])
        transmit = data.transmit_positions if isinstance(data, Echo) else None
        view = _View(
            samples=data.samples[:, ::step],
            positions=centred,
            transmit=None if transmit is None else transmit - middle,
            frequencies=data.frequencies[::step],
            across=np.array(across),
            boresight=looking,
            ways=2 if isinstance(data, Echo) else 1,
        )
        many = len(chosen) > MOST_PLACES
        return view._some(np.sort(rng.permutation(chosen)[:MOST_PLACES])) if many else view

    @property
    def extent(self) -> float:
        return float(np.ptp(self.positions @ self.across.T, axis=0).max())

    def part(self, size: float) -> "_View":
        """Return the middle of the aperture, of that extent."""
        off = np.abs(self.positions @ self.across.T).max(axis=1)
        inside = np.flatnonzero(off <= size / 2 * (1 + 1e-9))
        return self._some(inside)

    def thinned(self, every: int, every_frequency: int) -> "_View":
        """Return one of so many positions and frequencies."""
        return replace(
            self,
            samples=self.samples[::every, ::every_frequency],
            positions=self.positions[::every],
            transmit=None if self.transmit is None else self.transmit[::every],
            frequencies=self.frequencies[::every_frequency],
        )

    def _some(self, chosen: np.ndarray) -> "_View":
        if len(chosen) > MOST_SAMPLES[0]:
            chosen = chosen[:: -(-len(chosen) // MOST_SAMPLES[0])]
        return replace(
            self,
            samples=self.samples[chosen],
            positions=self.positions[chosen],
            transmit=None if self.transmit is None else self.transmit[chosen],
        )

    def paths(
        self, places: Float[np.ndarray, "*trials unknowns"]
    ) -> Float[np.ndarray, "*trials positions"]:
        """Return the paths to places of direction sines and curvature, less the middle's. [m]."""
        sines, curvature = places[..., :-1], places[..., -1:]
        sign = np.where(curvature >= 0, 1.0, -1.0)
        # Nearly plane: the distances' difference would be lost to rounding.
        distance = 1 / np.maximum(np.abs(curvature), 1e-6)
        forward = np.sqrt(np.maximum(1 - (sines**2).sum(axis=-1, keepdims=True), 0.0))
        points = distance * (sign * (sines @ self.across) + forward * self.boresight)
        legs = np.linalg.norm(points[..., None, :] - self.positions, axis=-1) - distance
        if self.ways == 1:
            return np.asarray(sign * legs)
        other = legs
        if self.transmit is not None:
            other = np.linalg.norm(points[..., None, :] - self.transmit, axis=-1) - distance
        return np.asarray(sign * (legs + other))

    def turned(
        self, places: Float[np.ndarray, "*trials unknowns"]
    ) -> Complex[np.ndarray, "*trials positions freqs"]:
        """Return the samples without the phases of the paths to each of the places."""
        waves = 2 * np.pi / speed_of_light * self.frequencies
        return np.asarray(self.samples * np.exp(1j * self.paths(places)[..., None] * waves))

    def sums(
        self, places: Float[np.ndarray, "*trials unknowns"]
    ) -> Complex[np.ndarray, "*trials freqs"]:
        """Return the sums over the positions, focused on each of the places."""
        return np.asarray(self.turned(places).sum(axis=-2))

    def coherence(
        self, places: Float[np.ndarray, "*trials unknowns"]
    ) -> Float[np.ndarray, "*trials"]:
        """Return C at each of the places; 0 outside the half space."""
        power = len(self.positions) * float((np.abs(self.samples) ** 2).sum())
        if power <= 0:
            return np.zeros(places.shape[:-1])
        values = (np.abs(self.sums(places)) ** 2).sum(axis=-1) / power
        return np.where((places[..., :-1] ** 2).sum(axis=-1) < 1, values, 0.0)

    def cell(self) -> Float[np.ndarray, " unknowns"]:
        """Return the resolution in direction sine and curvature."""
        wave = speed_of_light / float(self.frequencies[-1])
        extents = np.maximum(np.ptp(self.positions @ self.across.T, axis=0), wave)
        return np.append(wave / self.ways / extents, 4 * wave / self.ways / extents.max() ** 2)


def _coarse(view: _View, whole: float) -> Float[np.ndarray, " unknowns"] | None:
    """Search all directions and curvatures of a small part of the whole aperture [m]."""
    cell = view.cell()
    steps = int(np.ceil(1 / (NEAREST * whole) / cell[-1]))
    lines = [np.arange(-0.95, 0.95, one / 1.5) for one in cell[:-1]]
    lines.append(cell[-1] * np.arange(-steps, steps + 1))
    if math.prod(line.size for line in lines) > MOST_TRIALS:
        return None
    places = np.stack([one.ravel() for one in np.meshgrid(*lines, indexing="ij")], axis=-1)
    few = view.thinned(-(-len(view.positions) // FEW[0]), -(-view.frequencies.size // FEW[1]))
    blocks = np.array_split(places, -(-len(places) // BLOCK))
    values = np.concatenate([few.coherence(block) for block in blocks])
    return np.asarray(places[int(np.argmax(values))])


def _around(view: _View, place: Float[np.ndarray, " unknowns"]) -> Float[np.ndarray, " unknowns"]:
    """Look at the neighbours that the smaller aperture could not tell apart."""
    cell = view.cell()
    shifts = [(-1.0, 0.0, 1.0)] * (len(place) - 1) + [(-3.0, -2.0, -1.0, 0.0, 1.0, 2.0, 3.0)]
    offsets = np.stack([one.ravel() for one in np.meshgrid(*shifts, indexing="ij")], axis=-1)
    places = place + offsets * cell * 0.75
    return np.asarray(places[int(np.argmax(view.coherence(places)))])


def _refined(view: _View, place: Float[np.ndarray, " unknowns"]) -> Float[np.ndarray, " unknowns"]:
    cell = view.cell()

    def loss(shift: Float[np.ndarray, " unknowns"]) -> float:
        return -float(view.coherence(place + shift * cell))

    found = scipy.optimize.minimize(
        loss,
        np.zeros(len(place)),
        method="Nelder-Mead",
        options={"xatol": 1e-4, "fatol": 1e-10, "maxiter": 400,
                 "initial_simplex": np.vstack([np.zeros(len(place)), 0.4 * np.eye(len(place))])},
    )  # fmt: skip
    return np.asarray(place + found.x * cell)


def _judged(view: _View, place: Float[np.ndarray, " unknowns"], data: Echo | Uplink) -> FocusDelay:
    covariance = _covariance(view, place)
    deviation = float(np.sqrt(covariance[-1, -1]))
    # All frequencies: thinned out, they leave the delay ambiguous.
    whole = _View.of(data, view.boresight, all_frequencies=True)
    assert whole is not None  # the view of fewer frequencies was one
    step = float(whole.frequencies[1] - whole.frequencies[0])
    path, path_deviation = _delay(whole.frequencies, whole.part(whole.extent).sums(place), step)
    curvature = float(place[-1])
    around = speed_of_light / step
    expected = view.ways / abs(curvature) if curvature else np.inf
    excess = (path - expected + around / 2) % around - around / 2 if curvature else np.nan
    spread = view.ways * deviation / curvature**2 if curvature else np.inf
    return FocusDelay(
        coherence=float(view.coherence(place)),
        curvature=curvature,
        curvature_deviation=deviation,
        path=path,
        excess=float(excess),
        excess_deviation=float(np.hypot(spread, path_deviation)),
    )


def _delay(
    frequencies: Float[np.ndarray, " freqs"], spectrum: Complex[np.ndarray, " freqs"], step: float
) -> tuple[float, float]:
    """Find the delay of the strongest echo's spectrum, as a path [m], and its deviation."""
    count = 16 * spectrum.size
    profile = np.abs(np.fft.ifft(spectrum, count))
    at = int(np.argmax(profile))
    before, here, after = profile[at - 1], profile[at], profile[(at + 1) % count]
    bend = before - 2 * here + after
    turns = (at + (0.5 * (before - after) / bend if bend else 0.0)) / count
    path = float(turns / step * speed_of_light)
    offsets = frequencies - frequencies[0]
    flat = spectrum * np.exp(2j * np.pi * offsets * path / speed_of_light)
    residual = flat * np.exp(-1j * np.angle(flat.sum()))
    lever = np.sqrt(float(((offsets - offsets.mean()) ** 2).sum()))
    noise = float(np.sqrt(np.mean(residual.imag**2) / max(np.mean(residual.real**2), 1e-300)))
    return path, noise / (2 * np.pi * lever) * speed_of_light


def _covariance(
    view: _View, place: Float[np.ndarray, " unknowns"]
) -> Float[np.ndarray, "unknowns unknowns"]:
    """Return the covariance of direction sines and curvature, clustered by position."""
    cell = view.cell()
    small = 1e-3
    slopes = []
    for axis, one in enumerate(cell):
        shift = np.zeros(len(place))
        shift[axis] = small * one
        slopes.append((view.paths(place + shift) - view.paths(place - shift)) / (2 * small))
    # Constant phases are the amplitudes' own: what the mean path does is not seen.
    lever = np.array(slopes).T
    lever = lever - lever.mean(axis=0)
    waves = 2 * np.pi / speed_of_light * view.frequencies
    turned = view.turned(place)
    mean = turned.mean(axis=0)
    # The phase of each sample against the mean, weighted by its power.
    errors = (turned * mean.conj()).imag
    score = (errors * waves).sum(axis=1)
    power = float((np.abs(mean) ** 2 * waves**2).sum())
    information = power * lever.T @ lever
    scatter = (lever * score[:, None]).T @ (lever * score[:, None])
    inverse = np.linalg.pinv(information)
    return np.asarray((inverse @ scatter @ inverse) * np.outer(cell, cell))
