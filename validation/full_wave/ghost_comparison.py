r"""Ghosts behind a rough mirror against a two-dimensional full-wave solution.

``python -m validation.full_wave.ghost_comparison TWO.npz WALL.npz`` takes the echo of conducting
cylinders that are visible only over a rough wall (arrays ``echo``, ``cylinder_centre``,
``cylinder_radius``, ``aperture_position``, ``frequency``), and that of the same wall alone (the
layout of :mod:`validation.full_wave.wall_comparison`). The cylinders' part is the difference of the
two echoes. It contains the ghosts, over the wall out and back, and no direct echo: the array's
direct link to the cylinders is left out of the reference.
"""

import sys
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float

from estimator.measurement.model import MeasurementError
from scenes.realisations.object_surface import Surface
from simulator.antennas.ports import Ports, isotropic
from simulator.geometry.faces import scattering_faces
from simulator.geometry.facets import joined, profile_surface, surface_facets
from simulator.geometry.ray_scene import build_scene, facets_visible
from simulator.multibounce.multibounce_2d import ghost_echo
from simulator.visibility.mutual_visibility import MutualVisibility
from validation.full_wave.wall_comparison import read_reference

LEAST_CORRELATION = 0.97
MOST_LEVEL_DB = 1.5
"""Limits of agreement. Physical optics on the wall, then on the cylinders, reaches 0.986 and -0.65
dB. [-], [dB]"""

FACETS_ROUND = 100
"""Facets round a cylinder: λ/4 at 295 GHz on a radius of 4 mm. [-]"""


def cylinders_echo(
    two: dict[str, np.ndarray], wall: dict[str, np.ndarray]
) -> Complex[np.ndarray, "positions freqs"]:
    """Simulate the hidden cylinders' part of the echo, in cylindrical waves.

    Parameters
    ----------
    two, wall
        The arrays of the two files.
    """
    positions = two["aperture_position"]
    surfaces = [profile_surface(wall["wall_profile"])]
    for index, centre in enumerate(two["cylinder_centre"]):
        radius = float(two["cylinder_radius"][index])
        surfaces.append(circle(centre, radius, FACETS_ROUND, name=f"cylinder {index}"))
    facets = joined([surface_facets(surface) for surface in surfaces])
    scene = build_scene(surfaces, mean=True)
    visible = facets_visible(scene, facets, positions)
    visible[:, len(surfaces[0].cells) :] = False  # no direct link
    faces = scattering_faces(facets)
    return ghost_echo(
        faces,
        MutualVisibility(scene, faces),
        Ports(positions=positions, pattern=isotropic, visible=visible),
        two["frequency"],
        waves="cylindrical",
    )


def compare_ghosts(two_path: Path, wall_path: Path) -> tuple[float, float]:
    """Compare the cylinders' part with the full-wave one.

    Returns
    -------
    Magnitude of the complex correlation, and level in dB of the simulated over the full wave.

    Raises
    ------
    MeasurementError
        If a file does not have its layout, or the two are of different radios.
    """
    wall = read_reference(wall_path)
    two = _read_cylinders(two_path, wall)
    simulated = cylinders_echo(two, wall)
    full_wave = two["echo"].astype(np.complex128) - wall["echo"]
    norms = float(np.linalg.norm(simulated)), float(np.linalg.norm(full_wave))
    correlation = float(abs(np.vdot(simulated, full_wave)) / (norms[0] * norms[1]))
    return correlation, float(20 * np.log10(norms[0] / norms[1]))


def circle(centre: Float[np.ndarray, " 3"], radius: float, count: int, *, name: str) -> Surface:
    """Return the closed conducting surface of a circle in 2-D, by chords of equal arc length."""
    angles = 2 * np.pi * np.arange(count) / count
    around = np.stack([np.cos(angles), np.sin(angles), 0 * angles], axis=-1)
    vertices = centre + radius * around
    first = np.arange(count)
    return Surface(
        name=name,
        material="metal",
        vertices=vertices,
        mean_vertices=vertices,
        cells=np.stack([first, (first + 1) % count], axis=-1),
        closed=True,
    )


def _read_cylinders(path: Path, wall: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    try:
        with np.load(path, allow_pickle=False) as archive:
            arrays = {name: np.asarray(archive[name]) for name in archive.files}
    except Exception as error:  # NumPy, zip and zlib raise many exceptions on a foreign file
        raise MeasurementError(f"{path}: not an .npz of plain arrays ({error})") from error
    needed = ("echo", "cylinder_centre", "cylinder_radius", "aperture_position", "frequency")
    missing = [name for name in needed if name not in arrays]
    if missing:
        raise MeasurementError(f"{path}: {', '.join(missing)} missing; see this module's layout")
    count = len(arrays["cylinder_centre"])
    if arrays["cylinder_centre"].shape != (count, 3) or arrays["cylinder_radius"].shape != (count,):
        raise MeasurementError(
            f"{path}: 'cylinder_centre' has shape {arrays['cylinder_centre'].shape} and "
            f"'cylinder_radius' {arrays['cylinder_radius'].shape}; they must be (n, 3) and (n,)"
        )
    for name in ("aperture_position", "frequency", "wall_profile"):
        if name in arrays and not np.array_equal(arrays[name], wall[name]):
            raise MeasurementError(
                f"{path}: {name!r} is not that of the wall's file; give the file of the same wall "
                "at the same positions and frequencies"
            )
    if "echo" not in wall or arrays["echo"].shape != wall["echo"].shape:
        raise MeasurementError(
            f"{path}: 'echo' has shape {arrays['echo'].shape}, but the wall's file has "
            f"{wall['echo'].shape if 'echo' in wall else 'none'}; both are needed, alike"
        )
    return arrays


def main() -> int:
    """Compare the files named on the command line; return 1 if agreement is insufficient."""
    if len(sys.argv) != 3:
        print(__doc__, file=sys.stderr)
        return 2
    try:
        correlation, level_db = compare_ghosts(Path(sys.argv[1]), Path(sys.argv[2]))
    except MeasurementError as error:
        print(error, file=sys.stderr)
        return 2
    passed = correlation >= LEAST_CORRELATION and abs(level_db) <= MOST_LEVEL_DB
    print(
        f"hidden cylinders   correlation {correlation:.4f}  level {level_db:+.2f} dB  "
        f"{'pass' if passed else 'FAIL'}"
    )
    return 0 if passed else 1


if __name__ == "__main__":
    raise SystemExit(main())
