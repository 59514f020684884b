"""Chains of flat faces in space: corners by closed forms, tilted plates, bodies over walls."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from jaxtyping import Complex
from scipy.constants import speed_of_light

from scenes.meshes.ply_writer import ply_bytes
from scenes.scenario import Scenario, parse_scenario
from simulator.multibounce.multibounce_3d import coherent_echo, coherent_pilot
from simulator.scene.array_antennas import array_group, user_group
from simulator.scene.radio_scene import radio_scene

CLOSED_FORM_DB = 0.3
"""Of corners' cross-sections, which are those seen from far: at 100 and 200 times their size the
phase over them bends by a few degrees. [dB]"""


def scene(
    objects: dict[str, Any],
    *,
    ghz: float,
    bounces: int = 2,
    place: Sequence[float] = (0.0, 0.0, 0.0),
    **more: Any,
) -> Scenario:
    return parse_scenario(
        {
            "name": "corner", "dimensions": 3, "max_bounces": bounces,
            "radio": {"start_ghz": 0.999 * ghz, "stop_ghz": 1.001 * ghz, "points": 3},
            "base_station": {
                "elements": [1, 1], "spacing_mm": 1.0, "position_m": list(place),
            },
            "objects": objects,
            **more,
        }
    )  # fmt: skip


def echo(scenario: Scenario) -> Complex[np.ndarray, "positions freqs"]:
    made = radio_scene(scenario, seed=0, sample=0)
    array = array_group(scenario, made.elements)
    return coherent_echo(made, array, array)


def section_of(amplitude: complex, wavelength: float, distance: float) -> float:
    """Radar cross-section [m²]."""
    return float(abs(amplitude) ** 2 * (4 * np.pi) ** 3 * distance**4 / wavelength**2)


def corner(side: float, opened: float, distance: float) -> dict[str, Any]:
    made = {}
    for name, sign in (("left", -1.0), ("right", 1.0)):
        angle = np.radians(-90.0) + sign * np.radians(45.0 + opened / 2)
        centre = np.array([0.0, distance]) + side / 2 * np.array([np.cos(angle), np.sin(angle)])
        made[name] = {
            "kind": "plate", "material": "metal", "centre_m": [*centre.tolist(), 0.0],
            "angle_deg": float(np.degrees(angle)), "length_m": side, "height_m": side,
        }  # fmt: skip
    return made


@pytest.mark.parametrize(("side", "ghz"), [(5e-3, 275.0), (10e-3, 60.0)])
def test_a_small_dihedral_has_the_cross_section_of_its_aperture(side: float, ghz: float) -> None:
    wavelength = speed_of_light / (1e9 * ghz)
    found = section_of(echo(scene(corner(side, 0.0, 1.0), ghz=ghz))[0, 1], wavelength, 1.0)
    expected = 8 * np.pi * side**4 / wavelength**2
    assert 10 * np.log10(found / expected) == pytest.approx(0.0, abs=CLOSED_FORM_DB)


def test_a_corner_that_opens_fades_without_a_jump() -> None:
    """Half of either face reflects by twice the angle beside: sin(x)/x of its halves."""
    side, distance = 0.03, 3.0
    levels = []
    for opened in np.linspace(0.0, 2.0, 6):
        levels.append(abs(echo(scene(corner(side, float(opened), distance), ghz=60.0))[0, 1]))
    steps = 20 * np.abs(np.diff(np.log10(levels)))
    assert steps.max() <= 1.5
    assert np.all(np.diff(levels) < 0.01 * levels[0])


def test_a_trihedral_sees_itself(tmp_path: Path) -> None:
    side, wavelength = 10e-3, speed_of_light / 275e9
    axis = np.array([0.0, -1.0, 0.0])
    edges = [
        side * (axis / 3**0.5 + (2 / 3) ** 0.5 * np.array([np.cos(turn), 0.0, np.sin(turn)]))
        for turn in 2 * np.pi * np.arange(3) / 3 + 0.2
    ]
    points: list[np.ndarray] = []
    faces: list[list[int]] = []
    for one, other in ((0, 1), (1, 2), (2, 0)):
        first = len(points)
        points += [np.zeros(3), edges[one], edges[one] + edges[other], edges[other]]
        faces += [[first, first + 1, first + 2], [first, first + 2, first + 3]]
    placed = np.array(points)
    middle = (placed.min(axis=0) + placed.max(axis=0)) / 2
    (tmp_path / "corner.ply").write_bytes(ply_bytes(placed - middle, np.array(faces)))
    body = {
        "kind": "mesh", "material": "metal", "file": str(tmp_path / "corner.ply"),
        "centre_m": (middle + np.array([0.0, 1.0, 0.0])).tolist(),
    }  # fmt: skip
    found = echo(scene({"corner": body}, ghz=275.0, bounces=3))[0, 1]
    expected = 12 * np.pi * side**4 / wavelength**2
    section = section_of(found, wavelength, 1.0)
    assert 10 * np.log10(section / expected) == pytest.approx(0.0, abs=CLOSED_FORM_DB)


WALL = {
    "kind": "plate", "material": "metal", "centre_m": [0.0, 0.8, 0.0], "angle_deg": 45.0,
    "length_m": 0.5, "height_m": 0.4,
}  # fmt: skip


@pytest.mark.parametrize("tilt", [0.0, 1.0, 2.0, 6.0])
def test_a_tilted_plate_over_a_wall_echoes_as_from_the_image(tilt: float) -> None:
    """Far from both, 30 mm wide: cos² and sin(x)/x of physical optics."""
    side, distance, wavelength = 0.03, 2.6, speed_of_light / 60e9
    plate = {
        "kind": "plate", "material": "metal", "centre_m": [1.8, 0.8, 0.0],
        "angle_deg": 90.0 + tilt, "length_m": side, "height_m": side,
    }  # fmt: skip
    three = echo(scene({"wall": WALL, "plate": plate}, ghz=60.0, bounces=3))[0, 1]
    two = echo(scene({"wall": WALL, "plate": plate}, ghz=60.0, bounces=2))[0, 1]
    angle = np.radians(tilt)
    lobe = np.cos(angle) * np.sinc(2 * side * np.sin(angle) / wavelength)
    expected = 4 * np.pi * side**4 / wavelength**2 * lobe**2
    section = section_of(three - two, wavelength, distance)
    # The phase over the plate bends by k d²/4R, 6°: where sin(x)/x is -14 dB, by 0.5 dB.
    assert 10 * np.log10(section / expected) == pytest.approx(0.0, abs=0.5)


def test_users_and_array_may_change_places_over_two_small_faces() -> None:
    made = corner(0.02, 1.0, 1.0)
    there = [0.05, 0.0, 0.02]
    levels = []
    for station, user in (([0.0, 0.0, 0.0], there), (there, [0.0, 0.0, 0.0])):
        moved = scene(made, ghz=60.0, place=station, users={"user": {"position_m": user}})
        frozen = radio_scene(moved, seed=0, sample=0)
        array = array_group(moved, frozen.elements)
        levels.append(coherent_pilot(frozen, user_group(moved, "user"), array)[0, 1])
    # Either way physical optics is left to the last face.
    assert levels[1] == pytest.approx(levels[0], rel=0.05)


def test_a_column_of_any_height_is_seen_over_a_wall() -> None:
    levels = []
    for height in (0.499, 0.501):
        post = {
            "kind": "cylinder", "material": "metal", "centre_m": [0.8, 0.8, 0.0],
            "radius_m": 0.01, "height_m": height,
        }  # fmt: skip
        levels.append(abs(echo(scene({"wall": WALL, "post": post}, ghz=20.0, bounces=3))[0, 1]))
    assert levels[1] == pytest.approx(levels[0], rel=0.06)


def test_a_pilot_over_a_wall_and_a_ball_comes_from_the_users_image(tmp_path: Path) -> None:
    """The ball alone, lit from the image, gives the same, but for the wall's coefficient."""
    import trimesh

    ball = trimesh.creation.icosphere(subdivisions=3)
    faces = np.asarray(ball.faces, dtype=np.int64)
    (tmp_path / "ball.ply").write_bytes(ply_bytes(np.asarray(ball.vertices), faces))
    body = {
        "kind": "mesh", "material": "metal", "file": str(tmp_path / "ball.ply"), "scale": 0.02,
        "centre_m": [0.0, 1.5, 0.0],
    }  # fmt: skip
    wall = WALL | {"centre_m": [1.0, 0.5, 0.0], "angle_deg": 90.0, "length_m": 0.36}
    from simulator.response.single_bounce_3d import scattered_in_space

    near, image = ({"u": {"position_m": [x, 0.2, 0.0]}} for x in (0.5, 1.5))
    over = scene({"wall": wall, "ball": body}, ghz=28.0, users=near)
    alone = scene({"ball": body}, ghz=28.0, users=image)
    frozen = radio_scene(over, seed=0, sample=0)
    found = coherent_pilot(frozen, user_group(over, "u"), array_group(over, frozen.elements))
    free = radio_scene(alone, seed=0, sample=0)
    expected = scattered_in_space(free, user_group(alone, "u"), array_group(alone, free.elements))
    assert found[0] == pytest.approx(-expected[0], rel=2e-3)  # a conductor turns the field round
