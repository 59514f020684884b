"""A plate in tiles is the plate."""

import numpy as np
import pytest

from scenes.realisations.object_surface import object_surface
from scenes.realisations.plate_tiles import PlateSheet, plate_sheet
from scenes.scenario import Scenario, parse_scenario

PLATE = {
    "kind": "plate",
    "material": "drywall",
    "centre_m": [0.1, 0.3, 0.05],
    "angle_deg": 20.0,
    "length_m": 0.004,
    "height_m": 0.003,
}


def scenario() -> Scenario:
    return parse_scenario(
        {
            "name": "tiles",
            "dimensions": 3,
            "radio": {"start_ghz": 328.0, "stop_ghz": 330.0, "points": 2},
            "base_station": {"elements": 1, "spacing_mm": 1.0},
            "objects": {"plate": PLATE, "post": {"kind": "cylinder", "material": "metal",
                "centre_m": [1.0, 1.0], "radius_m": 0.01, "height_m": 0.02}},
        }
    )  # fmt: skip


def sheet() -> PlateSheet:
    return plate_sheet(scenario(), "plate", seed=3, sample=1)


def test_the_tiles_of_a_plate_have_its_facets() -> None:
    whole = object_surface(scenario(), "plate", seed=3, sample=1)
    drawn = sheet()
    parts = [drawn.surface(tile) for tile in drawn.tiles(17)]
    assert len(parts) > 4
    found = np.concatenate([part.vertices[part.cells].reshape(-1, 9) for part in parts])
    np.testing.assert_allclose(
        found[np.lexsort(found.round(9).T)],
        (corners := whole.vertices[whole.cells].reshape(-1, 9))[np.lexsort(corners.round(9).T)],
        atol=1e-15,
    )


def test_a_tile_lies_within_its_ball() -> None:
    drawn = sheet()
    for tile in drawn.tiles(17):
        mean = drawn.surface(tile).mean_vertices
        assert np.linalg.norm(mean - tile.centre, axis=-1).max() <= tile.radius * (1 + 1e-9)


def test_only_plates_with_a_height_are_cut_into_tiles() -> None:
    with pytest.raises(ValueError, match=r"objects\.post is no plate with a height"):
        plate_sheet(scenario(), "post", seed=0)
