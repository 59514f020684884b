import math
import time
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from scenes.checks.placement import signed_distance
from scenes.scenario import Box, Cylinder, Plate, Scenario, ScenarioError, parse_scenario

Table = dict[str, Any]

WAVELENGTH = 299792458 / 220e9


def plate(**changes: object) -> Table:
    return {"kind": "plate", "material": "metal", "centre_m": [0, 0.8], "length_m": 0.4, **changes}


def cylinder(**changes: object) -> Table:
    base = {"kind": "cylinder", "material": "metal", "centre_m": [0, 0.8], "radius_m": 0.1}
    return base | changes


def box(**changes: object) -> Table:
    base = {"kind": "box", "material": "metal", "centre_m": [0, 0.8]}
    return base | {"length_m": 0.4, "depth_m": 0.2} | changes


def scene(
    objects: Table | None = None, *, users: Table | None = None, **base_station: object
) -> Scenario:
    solid = [body.get("height_m") for body in (objects or {}).values()]
    return parse_scenario(
        {
            "name": "scene",
            "dimensions": 3 if any(solid) else 2,
            "radio": {"start_ghz": 220.0, "stop_ghz": 295.0, "points": 11},
            "base_station": {"elements": 260, "spacing_mm": 0.5, **base_station},
            "objects": objects or {},
            "users": {n: {"position_m": p} for n, p in (users or {}).items()},
        }
    )


def refused(message: str, *args: Any, **options: Any) -> None:
    with pytest.raises(ScenarioError, match=message):
        scene(*args, **options)


# ---- the array


@pytest.mark.parametrize("body", [plate(), cylinder(), box()])
def test_an_array_may_stand_just_clear_of_an_object(body: Table) -> None:
    reach = {"plate": 0.0, "cylinder": 0.1, "box": 0.1}[body["kind"]]
    near = 0.8 - reach - WAVELENGTH
    scene({"it": body}, position_m=[0, near - 1e-6])
    refused(
        r"^base_station\.position_m = .*: the array is 1\.36 mm from objects\.it at .* must keep "
        r"1\.36 mm \(the longest wavelength\) away; move the array or the object",
        {"it": body},
        position_m=[0, near + 1e-6],
    )


@pytest.mark.parametrize("body", [cylinder(), box()])
def test_an_array_inside_a_solid_is_refused(body: Table) -> None:
    refused(r"the array is inside objects\.it", {"it": body}, position_m=[0, 0.8])


def test_an_array_through_a_wall_is_refused() -> None:
    refused(r"the array is on or across objects\.it", {"it": plate()}, position_m=[0.1, 0.8])
    upright = plate(angle_deg=90, centre_m=[0.0, 0.0])
    refused(r"the array is on or across objects\.it at \[0\.0, 0\.0\]", {"it": upright})


def test_a_thin_wall_between_two_elements_is_noticed() -> None:
    upright = plate(angle_deg=90, centre_m=[0.0, 0.0])  # elements at x = -0.5 m and 0.5 m
    refused("on or across", {"it": upright}, elements=2, spacing_mm=1000.0)


def test_a_wall_beside_the_end_of_the_array_is_no_harm() -> None:
    scene({"it": plate(angle_deg=90, centre_m=[0.07, 0.0])})  # the array ends at 0.06475 m
    refused("the array is 0.25 mm from", {"it": plate(angle_deg=90, centre_m=[0.065, 0.0])})


def test_a_planar_array_is_tested_at_every_height() -> None:
    shelf = box(centre_m=[0, 0, 0.5], height_m=0.01, depth_m=0.02)
    planar: Table = {"elements": [4, 3], "spacing_mm": [1.0, 400.0]}
    scene({"it": shelf}, **planar)
    refused(
        r"the array is inside objects\.it at .*0\.4", {"it": shelf | {"centre_m": [0, 0, 0.4]}},
        **planar,
    )  # fmt: skip


def test_a_shelf_between_two_rows_of_elements_is_noticed() -> None:
    shelf = box(centre_m=[0, 0, 0.2], height_m=0.01, depth_m=0.02)
    refused("inside", {"it": shelf}, elements=[4, 3], spacing_mm=[1.0, 400.0])


# ---- users


@pytest.mark.parametrize("body", [cylinder(), box()])
def test_a_user_inside_a_solid_is_refused(body: Table) -> None:
    refused(
        r"^users\.ann\.position_m = \[0\.05, 0\.85\]: is inside objects\.it; it must keep .* away; "
        "move the user or the object",
        {"it": body},
        users={"ann": [0.05, 0.85]},
    )


def test_a_user_in_a_wall_is_refused() -> None:
    refused(r"^users\.ann.*on or across objects\.it", {"it": plate()}, users={"ann": [0.1, 0.8]})
    refused(r"^users\.ann.*is 1 mm from objects\.it", {"it": plate()}, users={"ann": [0, 0.801]})
    scene({"it": plate()}, users={"ann": [0.0, 0.802]})


def test_a_user_beyond_the_end_of_a_wall_is_free() -> None:
    scene({"it": plate()}, users={"ann": [0.202, 0.8]})


def test_a_user_at_an_element_is_refused() -> None:
    refused(
        r"^users\.ann\.position_m = \[0\.03, 0\.0\]: is 0\.25 mm from an element of the base",
        users={"ann": [0.03, 0.0]},
    )
    scene(users={"ann": [0.03, 0.002]})


# ---- objects


def two(first: Table, second: Table) -> Table:
    return {"first": first, "second": second}


OVERLAPPING = [
    (cylinder(), cylinder(centre_m=[0.19, 0.8])),
    (cylinder(), cylinder()),
    (cylinder(radius_m=0.01), cylinder()),
    (box(), box(centre_m=[0.39, 0.8])),
    (box(), box(centre_m=[0.0, 0.99])),
    (box(), box(centre_m=[0.25, 0.95], angle_deg=45)),
    (box(), box(length_m=0.01, depth_m=0.01)),
    (box(), cylinder(centre_m=[0.29, 0.8])),
    (cylinder(centre_m=[0.26, 0.96]), box()),
    (box(height_m=1), box(height_m=1, centre_m=[0.0, 0.9, 0.9])),
    (cylinder(height_m=1), box(height_m=0.2, centre_m=[0.2, 0.8, 0.59])),
]

APART = [
    (cylinder(), cylinder(centre_m=[0.2, 0.8])),  # touching
    (box(), box(centre_m=[0.4, 0.8])),  # touching
    (box(), box(centre_m=[0.0, 1.0])),  # touching
    (box(), cylinder(centre_m=[0.3, 0.8])),  # touching
    (box(), cylinder(centre_m=[0.28, 0.98])),  # off the corner: 0.113 m
    (box(), box(centre_m=[0.35, 1.05], angle_deg=45)),
    (box(height_m=1), box(height_m=1, centre_m=[0.0, 0.8, 1.0])),  # one on the other
    (cylinder(height_m=1), box(height_m=0.2, centre_m=[0.2, 0.8, 0.61])),
    (box(), plate()),  # a plate may run into a solid: nothing in there is seen
    (plate(), plate(angle_deg=90)),  # open sheets may cross
]


@pytest.mark.parametrize(("first", "second"), OVERLAPPING)
def test_overlapping_solids_are_refused(first: Table, second: Table) -> None:
    message = r"^objects\.second\.centre_m = .*: the solid overlaps objects\.first; .*move or shr"
    refused(message, two(first, second))
    refused(message, two(second, first))


@pytest.mark.parametrize(("first", "second"), APART)
def test_objects_may_touch(first: Table, second: Table) -> None:
    scene(two(first, second))
    scene(two(second, first))


angles = st.floats(-180, 180)
places = st.tuples(st.floats(-1, 1), st.floats(-1, 1))
sizes = st.floats(0.05, 0.5)


@settings(deadline=None, max_examples=30)  # the first example waits for imports
@given(places, angles, sizes, sizes, places, angles, sizes, sizes)
def test_boxes_overlap_if_and_only_if_a_point_lies_in_both(
    place: tuple[float, float],
    angle: float,
    length: float,
    depth: float,
    other_place: tuple[float, float],
    other_angle: float,
    other_length: float,
    other_depth: float,
) -> None:
    options: Table = {"kind": "box", "material": "metal"}
    one = Box(**options, centre_m=(*place, 0.0), angle_deg=angle, length_m=length, depth_m=depth)
    other = Box(
        **options, centre_m=(*other_place, 0.0), angle_deg=other_angle, length_m=other_length,
        depth_m=other_depth,
    )  # fmt: skip
    # A second method: the larger of two convex distances, minimised by a fine grid over one box.
    u, v = np.meshgrid(*2 * [np.linspace(-0.5, 0.5, 41)])
    along, across = length * u.ravel()[:, None], depth * v.ravel()[:, None]
    grid = one.centre + along * one.tangent + across * one.across
    deepest = float(np.maximum(signed_distance(one, grid), signed_distance(other, grid)).min())
    step = math.hypot(length, depth) / 80  # how far the deepest point may be off the grid
    table = {name: body.model_dump(exclude_none=True) for name, body in two(one, other).items()}  # type: ignore[arg-type]
    for body in table.values():
        body["centre_m"] = list(body["centre_m"])
    try:
        scene(table, position_m=[0.0, -5.0])
    except ScenarioError:
        assert deepest < step
    else:
        assert deepest > -1e-6  # what counts as touching


@given(places, angles, st.tuples(st.floats(-2, 2), st.floats(-2, 2), st.floats(-2, 2)))
def test_the_distance_to_an_object_turns_and_moves_with_it(
    place: tuple[float, float], angle: float, point: tuple[float, float, float]
) -> None:
    options: Table = {"material": "metal", "height_m": 0.3}
    for body in (
        Plate(kind="plate", length_m=0.4, centre_m=(0, 0, 0), **options),
        Cylinder(kind="cylinder", radius_m=0.2, centre_m=(0, 0, 0), **options),
        Box(kind="box", length_m=0.4, depth_m=0.1, centre_m=(0, 0, 0), **options),
    ):
        moved = body.model_copy(update={"centre_m": (*place, 0.0), "angle_deg": angle})
        x, y, z = point
        there = moved.centre + x * moved.tangent + y * moved.across + np.array([0, 0, z])
        here = signed_distance(body, np.array([point]))
        np.testing.assert_allclose(signed_distance(moved, there[None]), here, atol=1e-12)


@pytest.mark.parametrize(
    ("point", "distance"),
    [
        ((0.0, 0.0, 0.0), -0.05),
        ((0.3, 0.0, 0.0), 0.1),
        ((0.0, -0.2, 0.0), 0.15),
        ((0.23, 0.09, 0.0), 0.05),
        ((0.19, 0.0, 0.0), -0.01),
        ((0.0, 0.0, 0.27), 0.12),
        ((0.23, 0.09, 0.27), 0.13),
    ],
)
def test_the_distance_to_a_box_is_that_to_its_face_edge_or_corner(
    point: tuple[float, float, float], distance: float
) -> None:
    body = Box(
        kind="box", material="metal", centre_m=(0, 0, 0), length_m=0.4, depth_m=0.1, height_m=0.3
    )
    assert signed_distance(body, np.array([point]))[0] == pytest.approx(distance, abs=1e-15)


# ---- facets


def rough(rms_mm: float, correlation_mm: float) -> Table:
    return {"rms_mm": rms_mm, "correlation_mm": correlation_mm}


def test_heights_that_would_tear_a_body_apart_are_refused() -> None:
    message = r"^objects\.it\.roughness\.rms_mm = 11\.0: must be at most 10 mm, a tenth of the obj"
    refused(message, {"it": cylinder(roughness=rough(11, 20))})
    scene({"it": cylinder(roughness=rough(9, 20))})


def test_a_correlation_longer_than_the_object_is_refused() -> None:
    message = r"^objects\.it\.roughness\.correlation_mm = 401\.0: must be at most 400 mm, the obj"
    refused(message, {"it": plate(roughness=rough(1, 401))})
    around = r"correlation_mm = 101\.0: must be at most 100 mm, .*around a cylinder: its radius"
    refused(around, {"it": cylinder(roughness=rough(1, 101))})


def test_a_smooth_surface_has_no_correlation_to_be_too_long() -> None:
    scene({"it": plate(roughness=rough(0, 401))})


def test_facets_that_would_not_fit_into_memory_are_refused_at_once() -> None:
    walls = {"it": plate(height_m=2.4, length_m=3.0, roughness=rough(0.05, 0.3))}
    start = time.perf_counter()
    refused(
        r"^objects\.it: needs 2\.56e\+09 facets at a spacing of 0\.075 mm, all objects 305 GiB, "
        r"more than 16 GiB; make it smaller, lower radio\.stop_ghz, or raise objects\.it\.rough",
        walls,
        position_m=[0, -1, 0],
    )
    assert time.perf_counter() - start < 1.0


def test_many_objects_together_must_fit_into_memory() -> None:
    def walls(count: int) -> Table:  # each 8.4e7 triangles of 0.254 mm: 10 GiB
        wall = plate(height_m=1.35, length_m=2.0, roughness=rough(0.05, 5.0))
        return {str(n): wall | {"centre_m": [0, 1.0 + n, 0]} for n in range(count)}

    scene(walls(1))
    refused(r"^objects\.0: needs 8\.3\de\+07 facets at .*, all objects 19\.9 GiB", walls(2))


def test_an_absorber_needs_no_facets() -> None:
    scene({"it": plate(height_m=100.0, length_m=100.0, material="absorber")})
