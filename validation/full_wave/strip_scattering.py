r"""Full-wave echo and uplinks of one rough conducting strip, frequency by frequency.

The electric-field equation of :mod:`validation.full_wave.method_of_moments` by the hierarchical
solver of :mod:`validation.full_wave.hodlr_solver`. The fields of an array at a distant wall have a
much lower rank than its number of positions: some are chosen and solved for, all others are
interpolated, so that with the chosen fields :math:`F_J` and :math:`F = F_J T`

.. math:: \mathrm{echo}_p = -f_p^T A^{-1} f_p = -t_p^T (F_J^T A^{-1} F_J)\, t_p, \qquad
          \mathrm{uplink}_p = -t_p^T F_J^T A^{-1} f_u

Each solution is checked by its residual in some rows of the equation.
"""

import functools
import hashlib
import math
import os
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float, Int
from scipy.constants import speed_of_light
from threadpoolctl import threadpool_limits

from validation.full_wave.conducting_contour import Contour, open_strip
from validation.full_wave.direct_solution import FullWaveError
from validation.full_wave.hodlr_solver import chosen_columns, compress, solve
from validation.full_wave.line_source import LineSource, greens_function
from validation.full_wave.method_of_moments import strip_entries

POINTS_PER_WAVELENGTH = 6.5
"""Grid points for each wavelength: the error of the echo is 1e-5 at 0.15 mm rms, l = 1 mm. [-]"""

TOLERANCE = 1e-7
"""Relative tolerance of ranks; the error of the echo is some 1e-6. [-]"""

CHECKED, MOST_RESIDUAL = 16, 1e-4
"""Rows in which a solution is checked, and the largest residual over the incident field. [-]"""

BLOCK = 16
"""Frequencies of one file. [-]"""

SOLVER = (
    "conducting_contour",
    "hodlr_solver",
    "line_source",
    "log_quadrature",
    "method_of_moments",
    "strip_scattering",
)
"""Modules on which a stored solution depends: if their sources change, it is solved again."""


@dataclass(frozen=True, kw_only=True)
class StripScene:
    """A frozen strip, the array and the users. Third coordinates are ignored."""

    profile: Float[np.ndarray, "vertices axis"]  # points along the strip [m]
    positions: Float[np.ndarray, "positions axis"]  # of the array [m]
    users: tuple[LineSource, ...] = ()
    detail: float = math.inf  # largest spacing of the grid at any wavelength [m]

    def grid(self, frequency: float) -> Contour:
        """Sample the strip for a frequency in Hz."""
        spacing = speed_of_light / frequency / POINTS_PER_WAVELENGTH
        return open_strip(self.profile, spacing=min(spacing, self.detail))

    @property
    def digest(self) -> str:
        """Return a digest of the scene."""
        numbers = [self.profile, self.positions, np.array([self.detail])]
        for user in self.users:
            aim = np.zeros(2) if user.aim is None else user.aim
            numbers += [user.position, aim]
            numbers.append(np.array([user.width or 0.0, user.displacement or 0.0]))
        told = hashlib.sha256()
        for array in numbers:
            told.update(np.ascontiguousarray(array, dtype=np.float64).tobytes() + b"|")
        return told.hexdigest()


@dataclass(frozen=True, kw_only=True)
class StripFields:
    """Scattered fields of unit line sources."""

    echo: Complex[np.ndarray, "positions freqs"]
    uplinks: Complex[np.ndarray, "users positions freqs"]


def strip_response(scene: StripScene, frequency: float) -> Complex[np.ndarray, "ways positions"]:
    """Solve for one frequency.

    Parameters
    ----------
    scene
        The strip and its sources.
    frequency
        [Hz].

    Returns
    -------
    First the echo, then each user's uplink, at all positions.

    Raises
    ------
    FullWaveError
        If the solution does not satisfy the equation.
    """
    wavenumber = 2 * np.pi * frequency / speed_of_light
    strip = scene.grid(frequency)
    root = np.sqrt(strip.weights)[:, None]
    # Positions are chosen by some points; then fields of the chosen ones at every point.
    thinned = np.arange(0, strip.count, max(1, strip.count // (2 * len(scene.positions) + 64)))
    chosen, spread = chosen_columns(
        _lit(strip, scene.positions[:, :2], wavenumber, thinned), TOLERANCE
    )
    lit = root * _lit(strip, scene.positions[chosen, :2], wavenumber, np.arange(strip.count))
    users = [root[:, 0] * user.field(strip.points, wavenumber) for user in scene.users]
    sides = np.concatenate([lit, *(user[:, None] for user in users)], axis=1)

    def entries(
        rows: Int[np.ndarray, " rows"], columns: Int[np.ndarray, " columns"]
    ) -> Complex[np.ndarray, "rows columns"]:
        return strip_entries(strip, wavenumber, rows, columns)

    solution = solve(compress(entries, 0, strip.count, tolerance=TOLERANCE), sides)
    checked = np.linspace(0, strip.count - 1, CHECKED).astype(np.int64)
    residual = entries(checked, np.arange(strip.count)) @ solution - sides[checked]
    worst = float((np.linalg.norm(residual, axis=0) / np.linalg.norm(sides[checked], axis=0)).max())
    if not worst < MOST_RESIDUAL:
        raise FullWaveError(
            f"at {frequency / 1e9:.6g} GHz the solution errs by {worst:.1e} of the incident "
            f"field, more than {MOST_RESIDUAL:g}; does the profile cross itself?"
        )
    coupled = lit.T @ solution
    own = coupled[:, : len(chosen)]
    echo = -np.einsum("rp,rp->p", spread, own @ spread)
    return np.concatenate([echo[None], -(coupled[:, len(chosen) :].T @ spread)])


def strip_fields(
    scene: StripScene,
    frequencies: Float[np.ndarray, " freqs"],
    *,
    folder: Path | None = None,
    workers: int | None = None,
    advance: Callable[[int, int], None] = lambda done, steps: None,
) -> StripFields:
    """Solve for many frequencies; stored results of an earlier run are reused.

    Parameters
    ----------
    scene
        The strip and its sources.
    frequencies
        [Hz].
    folder
        Cache with a file for every :data:`BLOCK` frequencies, whose name depends on scene,
        frequencies and the solver's version. None: nothing is stored.
    workers
        Frequencies at once; by default, one on each core. The result is the same.
    advance
        Called with the blocks done and the blocks in all.
    """
    blocks = [frequencies[start : start + BLOCK] for start in range(0, len(frequencies), BLOCK)]
    solved = []
    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    # One BLAS thread in each worker: sums do not depend on the number of workers.
    with threadpool_limits(limits=1), ThreadPoolExecutor(workers or os.cpu_count()) as pool:
        for done, block in enumerate(blocks):
            file = None if folder is None else folder / f"{_name(scene, block)}.npz"
            if file is not None and file.exists():
                with np.load(file, allow_pickle=False) as archive:
                    fields = np.asarray(archive["fields"])
            else:
                rows = pool.map(lambda f: strip_response(scene, float(f)), block)
                fields = np.stack(list(rows), axis=-1)
                if file is not None:
                    _keep(file, fields)
            solved.append(fields)
            advance(done + 1, len(blocks))
    whole = np.concatenate(solved, axis=-1)
    return StripFields(echo=whole[0], uplinks=whole[1:])


def _lit(
    strip: Contour,
    positions: Float[np.ndarray, "positions 2"],
    wavenumber: float,
    points: Int[np.ndarray, " points"],
) -> Complex[np.ndarray, "points positions"]:
    away = strip.points[points, None] - positions
    return greens_function(wavenumber * np.hypot(away[..., 0], away[..., 1]))


@functools.cache
def _solver_digest() -> str:
    told = hashlib.sha256()
    for module in SOLVER:
        told.update(Path(__file__).with_name(f"{module}.py").read_bytes())
    return told.hexdigest()


def _name(scene: StripScene, block: Float[np.ndarray, " freqs"]) -> str:
    told = hashlib.sha256(f"{_solver_digest()} {scene.digest}".encode())
    told.update(np.ascontiguousarray(block, dtype=np.float64).tobytes())
    return told.hexdigest()[:20]


def _keep(file: Path, fields: Complex[np.ndarray, "ways positions freqs"]) -> None:
    # A temporary file is renamed: no partial file is left if interrupted.
    aside = file.with_name(f"{file.stem}.{os.getpid()}.part")
    with aside.open("wb") as opened:
        np.savez(opened, fields=fields)
    aside.replace(file)
