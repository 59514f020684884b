r"""Fields scattered by one frozen profile: a conducting strip, or a board with a rough front.

For example::

    fields = profile_fields(
        np.stack([x, heights], axis=-1), frequencies, polarisation="TE",
        sources=places, receivers=places, permittivity=2.56 - 0.13j, thickness=12.7e-3,
        detail=correlation_length / 6,
    )

Fields are those of unit line sources, :math:`-\tfrac j4 H_0^{(2)}(kr)`: of :math:`E_z` in TM, of
:math:`H_z` in TE, without the incident field.

The board's front follows the profile and faces left of its direction (up, if x rises); its back is
flat, parallel to the line between the profile's ends, and its four corners are sharp.
"""

import functools
import hashlib
import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Literal

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light
from threadpoolctl import threadpool_limits

from validation.full_wave.boundary_equations import Body, BoundaryProblem, Polarisation
from validation.full_wave.conducting_contour import open_strip
from validation.full_wave.direct_solution import echo_fields, link_fields
from validation.full_wave.graded_contour import cornered_contour
from validation.full_wave.line_source import LineSource

POINTS_PER_WAVELENGTH = 6.5
"""Grid points for each wavelength in the denser medium: the error of fields is some 1e-5. [-]"""

Permittivity = complex | Callable[[Float[np.ndarray, " freqs"]], Complex[np.ndarray, " freqs"]]
"""ε' - jε'', one for all frequencies or a function of them in Hz. [-]"""

Ends = Sequence[LineSource] | Float[np.ndarray, "_ _"]
"""Sources or receivers; bare positions are isotropic, third coordinates are ignored."""


def profile_fields(
    profile: Float[np.ndarray, "vertices axis"],
    frequencies: Float[np.ndarray, " freqs"],
    *,
    polarisation: Polarisation,
    sources: Ends,
    receivers: Ends | Literal["echo"],
    permittivity: Permittivity | None = None,
    thickness: float | None = None,
    detail: float = np.inf,
    folder: Path | None = None,
    workers: int = 1,
) -> Complex[np.ndarray, "*ends freqs"]:
    """Solve for the field scattered by a profile from sources to receivers.

    Parameters
    ----------
    profile
        Points from end to end, which resolve the roughness. [m]
    frequencies
        Each is solved for. [Hz]
    polarisation
        TM (electric field along z) or TE (magnetic field along z).
    sources, receivers
        Outside of the body; ``"echo"``: each source receives its own echo.
    permittivity
        Of a board; None: the profile is a perfect conductor.
    thickness
        From the line between the profile's ends to the back; required for a board. None: a
        conducting strip of zero thickness. [m]
    detail
        Largest step of the grid on the profile, a sixth of the roughness' correlation length. [m]
    folder
        Cache of solved frequencies, whose file names depend on all of the above and the solver's
        version.
    workers
        Frequencies at once.

    Returns
    -------
    ``(sources, receivers, freqs)``, or ``(sources, freqs)`` of an echo.

    Raises
    ------
    ValueError
        If a dielectric has no thickness, or the profile cannot be sampled.
    FullWaveError
        If a solution does not satisfy its equation.
    """
    if permittivity is not None and thickness is None:
        raise ValueError(
            f"permittivity = {permittivity} but no thickness: a dielectric strip needs one, in m"
        )
    sent = _line_sources(sources)
    heard = "echo" if isinstance(receivers, str) else _line_sources(receivers)
    told = hashlib.sha256(f"{_solver_digest()} {polarisation} {thickness} {detail}".encode())
    told.update(np.ascontiguousarray(profile[:, :2], dtype=np.float64).tobytes())
    for group in (sent, [] if isinstance(heard, str) else heard):
        told.update(b"|")
        for end in group:
            aim = np.zeros(2) if end.aim is None else end.aim
            numbers = [*end.position, *aim, end.width or 0.0, end.displacement or 0.0]
            told.update(np.array(numbers, dtype=np.float64).tobytes())
    scene = told.hexdigest()

    def solved(frequency: float) -> Complex[np.ndarray, "*ends"]:
        value = _value(permittivity, frequency)
        name = hashlib.sha256(f"{scene} {value!r} {frequency!r}".encode()).hexdigest()[:24]
        file = None if folder is None else folder / f"{name}.npy"
        if file is not None and file.exists():
            return np.asarray(np.load(file, allow_pickle=False))
        body = profile_body(
            profile, frequency, permittivity=value, thickness=thickness, detail=detail
        )
        problem = BoundaryProblem([body], polarisation, 2 * np.pi * frequency / speed_of_light)
        if isinstance(heard, str):
            fields = echo_fields(problem, sent)
        else:
            fields = link_fields(problem, sent, heard)
        if file is not None:
            keep(file, fields)
        return fields

    if folder is not None:
        folder.mkdir(parents=True, exist_ok=True)
    with threadpool_limits(limits=1), ThreadPoolExecutor(workers) as pool:
        return np.stack(list(pool.map(solved, frequencies.tolist())), axis=-1)


def profile_body(
    profile: Float[np.ndarray, "vertices axis"],
    frequency: float,
    *,
    permittivity: complex | None,
    thickness: float | None,
    detail: float = np.inf,
) -> Body:
    """Sample the profile's body for a frequency; parameters as in :func:`profile_fields`."""
    wavelength = speed_of_light / frequency
    index = 1.0 if permittivity is None else max(1.0, float(np.sqrt(permittivity).real))
    coarse = wavelength / index / POINTS_PER_WAVELENGTH
    fine = min(coarse, detail)
    if thickness is None:
        return Body(contour=open_strip(profile, spacing=fine))
    if not thickness > 0:
        raise ValueError(f"thickness = {thickness} m must be positive")
    front = profile[::-1, :2]  # with its inside to the left, as for a contour
    chord = front[0] - front[-1]
    back = np.array([chord[1], -chord[0]]) / np.hypot(*chord) * thickness
    corners = front[-1] + back, front[0] + back
    sides = [np.stack(corners), np.stack([corners[1], front[0]]), front]
    sides.append(np.stack([front[-1], corners[0]]))
    contour = cornered_contour(sides, [coarse, coarse, fine, coarse])
    return Body(contour=contour, permittivity=permittivity)


def _value(permittivity: Permittivity | None, frequency: float) -> complex | None:
    if permittivity is None:
        return None
    if callable(permittivity):
        return complex(permittivity(np.array([frequency]))[0])
    return complex(permittivity)


def _line_sources(ends: Ends) -> list[LineSource]:
    if isinstance(ends, np.ndarray):
        return [LineSource(position=place[:2].astype(np.float64)) for place in ends]
    return list(ends)


@functools.cache
def _solver_digest() -> str:
    told = hashlib.sha256()
    for file in sorted(Path(__file__).parent.glob("*.py")):
        if file.stem in SOLVER:
            told.update(file.read_bytes())
    return told.hexdigest()


SOLVER = (
    "boundary_equations",
    "conducting_contour",
    "direct_solution",
    "graded_contour",
    "hodlr_solver",
    "layer_potentials",
    "line_source",
    "log_quadrature",
    "profile_scattering",
)
"""Modules on which a stored field depends: if their sources change, fields are solved again."""


def keep(file: Path, fields: Complex[np.ndarray, "*n"]) -> None:
    """Write an array to a temporary file and rename it: no partial file is left if interrupted."""
    aside = file.with_name(f"{file.stem}.{os.getpid()}.part")
    with aside.open("wb") as opened:
        np.save(opened, fields)
    aside.replace(file)
