from pathlib import Path

import pytest
import trimesh

from scenes.schema.objects import MeshFile
from scenes.surfaces.level_of_detail import flat_and_smooth

WAVELENGTH = 0.0095  # [m]


@pytest.fixture
def ball(tmp_path: Path) -> str:
    """A ball of 1280 triangles, each in a plane of its own, 10 cm wide at a radius of 1 m."""
    path = tmp_path / "ball.ply"
    trimesh.creation.icosphere(subdivisions=3, radius=1.0).export(path)
    return str(path)


def body(file: str, scale: float, *, of_walls: bool = True) -> MeshFile:
    given = {"kind": "mesh", "file": file, "material": "metal", "scale": scale}
    return MeshFile.model_validate({**given, "flat_faces": of_walls})


@pytest.mark.parametrize(
    ("radius", "flat"),
    [
        (2.0, True),  # 36 million facets
        (1.0, False),  # 9 million
        (0.5, False),  # and its faces are no walls
    ],
)
def test_what_is_round_keeps_its_facets_as_long_as_they_can_be_summed(
    ball: str, radius: float, flat: bool
) -> None:
    assert flat_and_smooth(body(ball, radius), WAVELENGTH) is flat


def test_a_ball_is_never_thousands_of_mirrors_unless_its_faces_are_called_walls(ball: str) -> None:
    assert not flat_and_smooth(body(ball, 2.0, of_walls=False), WAVELENGTH)
