r"""Paths in space that used to be missing, or too strong, each beside an independent truth.

Run as ``python -m validation.experiments.paths_in_space``; a minute or two.

Not in the thesis, whose scenes are plane. Each row has a truth of its own that shares no code with
the simulator: closed forms (P.2040's slab after Airy, the image of a point, an infinite cylinder
and a sphere in geometrical optics, corners by their cross-section: Knott, Shaeffer and Tuley,
*Radar Cross Section*, 1993, table 6.1), or physical optics on each plate summed by
brute force (:mod:`validation.analytic.plates_in_turn`).

Chosen: 60 GHz where a room is meant, 275 GHz for corners of millimetres; antennas are isotropic.
What comes over n surfaces is the difference between simulations with ``max_bounces`` n and n - 1.
"""

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import trimesh
from jaxtyping import Float
from scipy.constants import speed_of_light

from scenes.meshes.ply_writer import ply_bytes
from scenes.scenario import parse_scenario
from simulator.simulation import simulate
from validation.analytic.plates_in_turn import CELLS_PER_WAVELENGTH, over_plates, plate_cells
from validation.harness.claim import Row
from validation.harness.row_table import conclude

WITHIN = 1.5
"""Largest error of what ends in facets: physical optics in turn and geometrical optics up to the
last surface differ by what bends on the way. [dB]"""

CLOSE = 1.0
"""Largest error of what has a closed form. [dB]"""

ROOM, SMALL = 60e9, 275e9  # [Hz]

Table = dict[str, Any]


class Compared(NamedTuple):
    """A level beside its truth."""

    name: str
    truth: str  # where that is from
    expected: float  # [dB]
    found: float  # [dB]
    within: float  # [dB]

    def row(self) -> Row:
        """Make it a row of a table of claims."""
        return Row(
            name=self.name,
            stated=f"{self.expected:.1f} dB, {self.truth}",
            measured=max(self.found, -999.0),
            unit="dB",
            low=self.expected - self.within,
            high=self.expected + self.within,
            origin="1 dB for closed forms, 1.5 dB for facets",
        )


def compared_paths(*, quick: bool = False) -> Iterator[Compared]:
    """Compare one path after the other; quickly: fewer sizes and angles."""
    kinds: list[Callable[[bool], Iterator[Compared]]] = [
        _behind_drywall, _posts, _tilted_plates, _sphere_in_a_pilot, _dihedrals, _opened_corners,
        _trihedrals, _point_over_a_wall,
    ]  # fmt: skip
    for kind in kinds:
        yield from kind(quick)


def decibels(amplitude: complex) -> float:
    """Level of an amplitude. [dB]."""
    return float(20 * np.log10(max(abs(amplitude), 1e-30)))


def over(
    objects: Table,
    *,
    bounces: tuple[int, int],
    frequency: float = ROOM,
    user: tuple[float, float, float] | None = None,
    **more: Any,
) -> complex:
    """Simulate what reaches the only antenna over more than so many surfaces, up to so many.

    Parameters
    ----------
    objects
        The scene.
    bounces
        The most surfaces that do not count (-1: all do), and the most that do.
    frequency
        In the middle of a narrow band. [Hz]
    user
        Sends a pilot, of which that is asked for; else the echo.
    more
        Tables of the scenario.

    Returns
    -------
    S-parameter at that frequency. [-]
    """
    total = 0j
    for sign, most in zip((-1, 1), bounces, strict=True):
        if most < 0:
            continue
        scenario = parse_scenario(
            {
                "name": "path", "dimensions": 3, "max_bounces": most,
                "radio": {
                    "start_ghz": 0.999e-9 * frequency, "stop_ghz": 1.001e-9 * frequency,
                    "points": 3,
                },
                "base_station": {"elements": [1, 1], "spacing_mm": 1.0},
                "objects": objects,
                "users": {} if user is None else {"user": {"position_m": list(user)}},
                **more,
            }
        )  # fmt: skip
        got = simulate(scenario, seed=0).measurement
        if user is not None:
            total += sign * complex(got.uplinks[0].samples[0, 1])
        elif got.echo is not None:
            total += sign * complex(got.echo.samples[0, 1])
    return total


def plate(
    centre: tuple[float, float, float], angle: float, length: float, height: float, **more: Any
) -> Table:
    """Make an upright metal plate."""
    return {
        "kind": "plate", "material": "metal", "centre_m": list(centre), "angle_deg": angle,
        "length_m": length, "height_m": height, **more,
    }  # fmt: skip


SCREEN = plate((0.3, 0.35, 0.0), 90.0, 0.5, 2.0, material="absorber")
"""Hides from the array at the origin what it sees over :data:`WALL`."""

WALL = plate((0.0, 0.8, 0.0), 45.0, 0.4, 0.6)
"""Shows the array what stands at (0.8, 0.8, 0) as if it were 1.6 m ahead."""

IMAGE = np.array([-0.8, 0.8, 0.0])
"""Of the array, behind that wall. [m]"""


def _behind_drywall(quick: bool) -> Iterator[Compared]:
    """See 12 mm of P.2040 plasterboard, at a right angle: Airy."""
    board = {"name": "drywall", "thickness_mm": 12.0}
    smooth = {"rms_mm": 0.0, "correlation_mm": 1.0}
    wall = plate((0.0, 1.0, 0.0), 0.0, 0.5, 0.5, material=board, roughness=smooth)
    there = (0.0, 2.0, 0.0)
    found = over({"wall": wall}, bounces=(-1, 0), user=there)
    free = over({}, bounces=(-1, 0), user=there)
    giga = ROOM / 1e9
    index = np.sqrt(2.73 - 17.98j * 0.0085 * giga**0.9395 / giga)
    face = (1 - index) / (1 + index)
    once = np.exp(-2j * np.pi * ROOM / speed_of_light * 12e-3 * index)
    airy = (1 - face**2) * once / (1 - (face * once) ** 2)
    yield Compared(
        "user behind 12 mm of drywall, over free space",
        "Airy's formula", decibels(airy), decibels(found / free), CLOSE,
    )  # fmt: skip


def _posts(quick: bool) -> Iterator[Compared]:
    """See a post over a wall: an endless cylinder, as it is many Fresnel zones tall."""
    radius, wavelength = 0.02, speed_of_light / ROOM
    length = 1.6 - radius
    amplitude = wavelength / (4 * np.pi) / (2 * length) * np.sqrt(radius / (length + radius))
    for height in (0.49, 0.51) if quick else (0.49, 0.51, 1.0, 2.0):
        post = {
            "kind": "cylinder", "material": "metal", "centre_m": [0.8, 0.8, 0.0],
            "radius_m": radius, "height_m": height,
        }  # fmt: skip
        found = over({"wall": WALL, "screen": SCREEN, "post": post}, bounces=(2, 3))
        yield Compared(
            f"post of {height} m over a wall",
            "endless cylinder in geometrical optics", decibels(amplitude), decibels(found), WITHIN,
        )  # fmt: skip


def _tilted_plates(quick: bool) -> Iterator[Compared]:
    """See a plate over a wall: its cells, seen from the antenna's image."""
    side = 0.1
    for tilt in (0.0, 2.0) if quick else (0.0, 1.0, 2.0, 3.0, 5.0, 7.0, 10.0, 15.0, 20.0):
        there = plate((0.8, 0.8, 0.0), 90.0 + tilt, side, side)
        found = over({"wall": WALL, "screen": SCREEN, "plate": there}, bounces=(2, 3))
        along = np.array([-np.sin(np.radians(tilt)), np.cos(np.radians(tilt)), 0.0])
        expected = over_plates([_cells(there, along, side, side, ROOM)], IMAGE, IMAGE, ROOM)
        yield Compared(
            f"plate of {side} m tilted by {tilt:g}° over a wall",
            "sum over its cells from the image", decibels(expected), decibels(found), WITHIN,
        )  # fmt: skip


def _cells(
    table: Table, along: Float[np.ndarray, " 3"], length: float, height: float, frequency: float
) -> Any:
    sides = np.stack([length * along, np.array([0.0, 0.0, height])])
    corner = np.array(table["centre_m"]) - sides.sum(axis=0) / 2
    spacing = speed_of_light / frequency / CELLS_PER_WAVELENGTH
    return plate_cells(corner, sides, spacing=spacing)


def _sphere_in_a_pilot(quick: bool) -> Iterator[Compared]:
    """Follow user, wall, sphere, array; the other way round misses the wall."""
    radius, centre = 0.06, np.array([0.0, 1.5, 0.0])
    user, image, wavelength = (0.5, 0.2, 0.0), np.array([1.5, 0.2, 0.0]), speed_of_light / ROOM
    wall = plate((1.0, 0.5, 0.0), 90.0, 0.36, 0.4)
    mesh = trimesh.creation.icosphere(subdivisions=5)
    points, corners = np.asarray(mesh.vertices), np.asarray(mesh.faces, dtype=np.int64)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "sphere.ply"
        file.write_bytes(ply_bytes(points, corners))
        ball = {
            "kind": "mesh", "material": "metal", "file": str(file), "scale": radius,
            "centre_m": centre.tolist(),
        }  # fmt: skip
        found = over({"wall": wall, "ball": ball}, bounces=(1, 2), user=user)
    place = centre + radius * points
    ways = [np.linalg.norm(place - end, axis=-1) for end in (image, np.zeros(3))]
    best = int(np.argmin(ways[0] + ways[1]))
    before, after = float(ways[0][best]), float(ways[1][best])
    cosine = abs(float(points[best] @ (image - place[best]))) / before
    curved = (
        1 / (1 / before + 2 / (radius * cosine)),
        1 / (1 / before + 2 * cosine / radius),
    )  # of the reflected wave, in and across the plane of incidence
    spread = np.sqrt(np.prod([one / (one + after) for one in curved])) / before
    expected = wavelength / (4 * np.pi) * float(spread)
    yield Compared(
        "pilot over a wall and a sphere",
        "geometrical optics of a sphere", decibels(expected), decibels(found), WITHIN,
    )  # fmt: skip


def _corner(side: float, opened: float, distance: float) -> tuple[Table, list[Table]]:
    """Open a corner of two plates towards the origin, by an angle beyond 90°."""
    made, ways = {}, []
    for name, sign in (("left", -1.0), ("right", 1.0)):
        angle = np.radians(-90.0) + sign * np.radians(45.0 + opened / 2)
        along = np.array([np.cos(angle), np.sin(angle), 0.0])
        centre = np.array([0.0, distance, 0.0]) + side / 2 * along
        made[name] = plate(tuple(centre.tolist()), float(np.degrees(angle)), side, side)
        ways.append({"along": along, "table": made[name]})
    return made, ways


def _twice(ways: list[Table], side: float, frequency: float) -> complex:
    cells = [_cells(way["table"], way["along"], side, side, frequency) for way in ways]
    antenna = np.zeros(3)
    return sum(
        (over_plates(pair, antenna, antenna, frequency) for pair in (cells, cells[::-1])), 0j
    )


def _dihedrals(quick: bool) -> Iterator[Compared]:
    for side, frequency in ((5e-3, SMALL), (20e-3, ROOM)):
        made, _ = _corner(side, 0.0, 1.0)
        wavelength = speed_of_light / frequency
        section = 8 * np.pi * side**4 / wavelength**2
        expected = wavelength * np.sqrt(section) / (4 * np.pi) ** 1.5
        found = over(made, bounces=(1, 2), frequency=frequency)
        yield Compared(
            f"dihedral of {1e3 * side:g} mm at {frequency / 1e9:g} GHz, 1 m away",
            "σ = 8πa⁴/λ²", decibels(expected), decibels(found), CLOSE,
        )  # fmt: skip


def _opened_corners(quick: bool) -> Iterator[Compared]:
    """Open a corner until its echo fades.

    Towards the null at 4° both sums part by 2 to 3 dB, 10 to 20 dB below the square corner's echo:
    what bends from plate to plate is left out of one.
    """
    side = 0.05
    for opened in (0.3, 1.0) if quick else (0.0, 0.3, 0.6, 1.0, 1.5, 2.0):
        made, ways = _corner(side, opened, 1.5)
        found = over(made, bounces=(1, 2))
        yield Compared(
            f"corner of {1e3 * side:g} mm opened by {opened:g}°",
            "plate to plate", decibels(_twice(ways, side, ROOM)), decibels(found), WITHIN,
        )  # fmt: skip


def _trihedrals(quick: bool) -> Iterator[Compared]:
    """Look into a corner of three squares, one mesh, along its axis."""
    for side in (10e-3,) if quick else (10e-3, 20e-3):
        wavelength = speed_of_light / SMALL
        section = 12 * np.pi * side**4 / wavelength**2
        expected = wavelength * np.sqrt(section) / (4 * np.pi) ** 1.5
        # The axis (1, 1, 1) of the squares points to the array, along -y.
        axis = np.array([0.0, -1.0, 0.0])
        across = np.array([1.0, 0.0, 0.0]), np.array([0.0, 0.0, 1.0])
        edges = [
            side
            * (axis / np.sqrt(3) + np.sqrt(2 / 3) * (np.cos(t) * across[0] + np.sin(t) * across[1]))
            for t in 2 * np.pi * np.arange(3) / 3 + 0.2
        ]
        points: list[np.ndarray] = []
        corners: list[list[int]] = []
        for one, other in ((0, 1), (1, 2), (2, 0)):
            first = len(points)
            points += [np.zeros(3), edges[one], edges[one] + edges[other], edges[other]]
            corners += [[first, first + 1, first + 2], [first, first + 2, first + 3]]
        placed = np.array(points) + np.array([0.0, 1.0, 0.0])
        middle = (placed.min(axis=0) + placed.max(axis=0)) / 2
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "corner.ply"
            file.write_bytes(ply_bytes(placed - middle, np.array(corners, dtype=np.int64)))
            body = {
                "kind": "mesh", "material": "metal", "file": str(file),
                "centre_m": middle.tolist(),
            }  # fmt: skip
            found = over({"corner": body}, bounces=(2, 3), frequency=SMALL)
        yield Compared(
            f"trihedral of {1e3 * side:g} mm, cross-section in dBsm",
            "σ = 12πa⁴/λ²", float(10 * np.log10(section)),
            float(10 * np.log10(section)) + decibels(found) - decibels(expected), WITHIN,
        )  # fmt: skip


def _point_over_a_wall(quick: bool) -> Iterator[Compared]:
    wavelength, section = speed_of_light / ROOM, 0.01
    amplitude = wavelength * np.sqrt(section) / (4 * np.pi) ** 1.5 / 1.6**2
    point = {"ball": {"position_m": [0.8, 0.8, 0.0], "rcs_m2": section}}
    found = over({"wall": WALL, "screen": SCREEN}, bounces=(1, 3), points=point)
    found -= over({"wall": WALL, "screen": SCREEN}, bounces=(1, 3))
    yield Compared(
        "point over a wall, there and back",
        "radar equation from the image", decibels(amplitude), decibels(found), CLOSE,
    )  # fmt: skip


def main() -> None:
    """Print all rows; refuse what falls outside."""
    conclude([one.row() for one in compared_paths()])


if __name__ == "__main__":
    main()
