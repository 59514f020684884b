import math
from typing import Any

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from scenes.random_streams import random_stream
from scenes.realisations.object_surface import Surface, object_surface, plate_segment
from scenes.scenario import Plate, Roughness, Scenario, ScenarioError, parse_scenario
from scenes.surfaces.facet_spacing import facet_count
from scenes.surfaces.height_synthesis import rough_profile, rough_sheet
from scenes.surfaces.heights import SAMPLES_PER_DETAIL, Heights

Table = dict[str, Any]

ROUGH = {"rms_mm": 0.05, "correlation_mm": 1.0}
RMS, LENGTH = 0.05e-3, 1e-3


def plate(**changes: object) -> Table:
    base = {"kind": "plate", "material": "metal", "centre_m": [0, 0.8], "length_m": 0.04}
    return base | changes


def cylinder(**changes: object) -> Table:
    base = {"kind": "cylinder", "material": "metal", "centre_m": [0.1, 0.8], "radius_m": 0.01}
    return base | changes


def box(**changes: object) -> Table:
    base = {"kind": "box", "material": "metal", "centre_m": [-0.1, 0.8]}
    return base | {"length_m": 0.02, "depth_m": 0.01, "angle_deg": 30.0} | changes


def scene(**objects: Table) -> Scenario:
    tall = any("height_m" in body for body in objects.values())
    return parse_scenario(
        {
            "name": "scene",
            "dimensions": 3 if tall else 2,
            "radio": {"start_ghz": 220.0, "stop_ghz": 300.0, "points": 11},
            "base_station": {"elements": 5, "spacing_mm": 0.5},
            "objects": objects,
        }
    )


def surface(body: Table, *, seed: int = 1, **options: Any) -> Surface:
    return object_surface(scene(it=body), "it", seed=seed, **options)


def normals(made: Surface, vertices: np.ndarray) -> np.ndarray:
    """Cell normals times size, by the stated rule."""
    corners = vertices[made.cells]
    if made.cells.shape[1] == 3:
        across: np.ndarray = np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0])
        return across / 2
    dx, dy, _ = (corners[:, 1] - corners[:, 0]).T
    return np.stack([dy, -dx, np.zeros_like(dx)], axis=-1)


def as_mesh(made: Surface, vertices: np.ndarray) -> trimesh.Trimesh:
    return trimesh.Trimesh(vertices, made.cells, process=False)


BODIES_2D = [plate(), cylinder(), box()]
BODIES_3D = [
    plate(height_m=0.01),
    cylinder(height_m=0.01),
    box(height_m=0.015),
]  # fmt: skip
CLOSED = [*BODIES_2D[1:], *BODIES_3D[1:]]
ALL = [*BODIES_2D, *BODIES_3D]


# ---- the mean shape


@pytest.mark.parametrize("body", ALL)
def test_neighbouring_vertices_are_no_farther_apart_than_the_facet_spacing(body: Table) -> None:
    scenario = scene(it=body)
    spacing = scenario.facet_spacing("it")
    assert spacing == pytest.approx(299792458 / 300e9 / 4)
    made = object_surface(scenario, "it", seed=0)
    corners = made.mean_vertices[made.cells]
    edges = np.linalg.norm(corners - np.roll(corners, 1, axis=1), axis=-1)
    longest = spacing * (1.0 if made.cells.shape[1] == 2 else math.sqrt(2))  # the diagonal
    assert edges.max() <= longest * (1 + 1e-9)  # rounding
    assert len(made.cells) == facet_count(scenario.objects["it"], spacing)  # type: ignore[arg-type]


@pytest.mark.parametrize("body", ALL)
def test_a_smooth_surface_is_its_mean_shape(body: Table) -> None:
    made = surface(body)
    np.testing.assert_array_equal(made.vertices, made.mean_vertices)
    assert made.closed == (body["kind"] != "plate")
    assert (made.name, made.material) == ("it", "metal")


@pytest.mark.parametrize("body", ALL)
def test_every_vertex_belongs_to_a_cell(body: Table) -> None:
    made = surface(body)
    assert np.array_equal(np.unique(made.cells), np.arange(len(made.vertices)))


@pytest.mark.parametrize("body", CLOSED)
def test_normals_of_a_closed_shape_point_outward_and_sum_to_zero(body: Table) -> None:
    made = surface(body)
    across = normals(made, made.mean_vertices)
    centre = np.array([*body["centre_m"], 0.0])
    middle = made.mean_vertices[made.cells].mean(axis=1) - centre
    assert (np.einsum("cx,cx->c", across, middle) > 0).all()
    np.testing.assert_allclose(across.sum(axis=0), 0, atol=1e-12)  # rounding of 1e5 cells


def test_a_rectangle_has_its_perimeter_and_area() -> None:
    made = surface(box())
    across = normals(made, made.mean_vertices)
    assert np.linalg.norm(across, axis=-1).sum() == pytest.approx(2 * (0.02 + 0.01))
    middle = made.mean_vertices[made.cells].mean(axis=1)
    assert np.einsum("cx,cx->", across, middle) / 2 == pytest.approx(0.02 * 0.01)  # Gauss


def test_a_circle_is_a_regular_polygon_on_its_radius() -> None:
    made = surface(cylinder())
    count = len(made.cells)
    radii = np.linalg.norm(made.mean_vertices - [0.1, 0.8, 0], axis=-1)
    np.testing.assert_allclose(radii, 0.01)
    across = normals(made, made.mean_vertices)
    middle = made.mean_vertices[made.cells].mean(axis=1) - [0.1, 0.8, 0]
    area = count / 2 * 0.01**2 * math.sin(2 * math.pi / count)
    assert np.einsum("cx,cx->", across, middle) / 2 == pytest.approx(area)


def test_a_box_is_watertight_and_has_its_volume() -> None:
    made = surface(box(height_m=0.015))
    mesh = as_mesh(made, made.mean_vertices)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume == pytest.approx(0.02 * 0.01 * 0.015)
    assert mesh.area == pytest.approx(2 * (0.02 * 0.01 + 0.02 * 0.015 + 0.01 * 0.015))


@pytest.mark.parametrize("spacing", [None, 0.004, 0.02, math.inf])
def test_a_cylinder_is_watertight_and_has_the_volume_of_its_prism(spacing: float | None) -> None:
    made = surface(cylinder(height_m=0.01), spacing=spacing)
    mesh = as_mesh(made, made.mean_vertices)
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    around = max(64, math.ceil(2 * math.pi * 0.01 / (spacing or 299792458 / 300e9 / 4)))
    base = around / 2 * 0.01**2 * math.sin(2 * math.pi / around)
    assert mesh.volume == pytest.approx(base * 0.01)


@pytest.mark.parametrize("body", ALL)
def test_an_infinite_spacing_makes_the_coarsest_surface(body: Table) -> None:
    made = surface(body, spacing=math.inf)
    tall = "height_m" in body
    assert len(made.cells) == {
        ("plate", False): 1, ("plate", True): 2, ("cylinder", False): 64,
        ("cylinder", True): 256, ("box", False): 4, ("box", True): 12,
    }[body["kind"], tall]  # fmt: skip


def test_an_absorber_is_as_coarse_as_can_be() -> None:
    assert len(surface(plate(material="absorber")).cells) == 1


# ---- plates


def test_the_ends_of_a_plate_are_half_its_length_from_its_centre() -> None:
    wall = Plate(
        kind="plate", material="metal", centre_m=(0.0, 0.8, 0.0), angle_deg=45.0, length_m=0.4
    )
    start, end = plate_segment(wall)
    half = 0.2 / math.sqrt(2)
    np.testing.assert_allclose(start, [-half, 0.8 - half, 0])
    np.testing.assert_allclose(end, [half, 0.8 + half, 0])


def test_a_plate_runs_from_its_start_to_its_end() -> None:
    scenario = scene(it=plate(angle_deg=45.0))
    made = object_surface(scenario, "it", seed=0)
    wall = scenario.objects["it"]
    assert isinstance(wall, Plate)
    start, end = plate_segment(wall)
    np.testing.assert_allclose(made.mean_vertices[0], start, atol=1e-16)
    np.testing.assert_allclose(made.mean_vertices[-1], end, atol=1e-16)
    np.testing.assert_array_equal(made.cells[:, 0], np.arange(len(made.cells)))


@pytest.mark.parametrize("tall", [False, True])
@pytest.mark.parametrize("angle", [0.0, 45.0, 90.0, 200.0])
def test_the_normals_of_a_plate_are_its_own(tall: bool, angle: float) -> None:
    body = plate(angle_deg=angle, **({"height_m": 0.01} if tall else {}))
    scenario = scene(it=body)
    made = object_surface(scenario, "it", seed=0)
    across = normals(made, made.mean_vertices)
    direction = across / np.linalg.norm(across, axis=-1, keepdims=True)
    np.testing.assert_allclose(
        direction, np.broadcast_to(scenario.objects["it"].normal, across.shape), atol=1e-11
    )


@pytest.mark.parametrize("tall", [False, True])
def test_the_heights_of_a_plate_count_along_its_normal_alone(tall: bool) -> None:
    body = plate(angle_deg=35.0, roughness=ROUGH, **({"height_m": 0.01} if tall else {}))
    scenario = scene(it=body)
    made = object_surface(scenario, "it", seed=3, sample=7, spacing=2.5e-4)
    heights = (made.vertices - made.mean_vertices) @ scenario.objects["it"].normal
    options: Table = {
        "rms": RMS, "correlation_length": LENGTH, "spectrum": "gaussian", "inner_cutoff": 0.0,
        "rng": random_stream(3, 7, "roughness/it"),
    }  # fmt: skip
    if tall:
        counts = (161, 41)
        expected = rough_sheet(lengths=(0.04, 0.01), counts=counts, **options).ravel()
    else:
        expected = rough_profile(length=0.04, count=161, **options)
    np.testing.assert_allclose(heights, expected, atol=1e-15)  # rounding of positions of 1 m
    shift = made.vertices - made.mean_vertices
    np.testing.assert_allclose(shift, heights[:, None] * scenario.objects["it"].normal, atol=1e-15)


@settings(deadline=None, max_examples=12)  # four of each kind
@given(st.floats(-180, 180), st.floats(-0.5, 0.5), st.sampled_from(["plate", "cylinder", "box"]))
def test_a_turned_and_moved_object_keeps_its_surface(angle: float, x: float, kind: str) -> None:
    body = {"plate": plate, "cylinder": cylinder, "box": box}[kind](roughness=ROUGH)
    still = surface(body | {"angle_deg": 0.0, "centre_m": [0, 1]})
    moved = surface(body | {"angle_deg": angle, "centre_m": [x, 1.5]})
    turn = math.radians(angle)
    rotation = np.array(
        [[math.cos(turn), -math.sin(turn), 0], [math.sin(turn), math.cos(turn), 0], [0, 0, 1]]
    )
    expected = (still.vertices - [0, 1, 0]) @ rotation.T + [x, 1.5, 0]
    np.testing.assert_allclose(moved.vertices, expected, atol=1e-14)  # rounding at 2 m
    np.testing.assert_array_equal(moved.cells, still.cells)


# ---- roughness


@pytest.mark.parametrize("body", ALL)
def test_a_rough_shape_keeps_its_cells_and_stays_closed(body: Table) -> None:
    smooth, rough = (surface(it, spacing=2.5e-4) for it in (body, body | {"roughness": ROUGH}))
    np.testing.assert_array_equal(rough.cells, smooth.cells)
    np.testing.assert_array_equal(rough.mean_vertices, smooth.mean_vertices)
    shift = np.linalg.norm(rough.vertices - rough.mean_vertices, axis=-1)
    assert 0 < shift.max() < 8 * RMS  # 8 sigma: never in 1e5 normal draws; twice that at corners
    if rough.cells.shape[1] == 3 and rough.closed:
        assert as_mesh(rough, rough.vertices).is_watertight


@pytest.mark.parametrize("body", ALL)
def test_no_facet_of_a_rough_shape_is_turned_over(body: Table) -> None:
    rough = surface(body | {"roughness": ROUGH})
    before, after = normals(rough, rough.mean_vertices), normals(rough, rough.vertices)
    # rms slopes are 0.07: a facet would have to tilt by 90°
    assert (np.einsum("cx,cx->c", before, after) > 0).all()


def test_a_rough_circle_closes_on_itself_without_a_step() -> None:
    around = [surface(cylinder(roughness=ROUGH), seed=n) for n in range(30)]
    radii = [np.linalg.norm(s.vertices - [0.1, 0.8, 0], axis=-1) for s in around]
    steps = np.array([np.diff(r, append=r[0]) for r in radii])
    # The step over the seam has the variance of all the others; 30 of them: F-distributed.
    ratio = np.mean(steps[:, -1] ** 2) / np.mean(steps**2)
    assert ratio < 3.0  # P(χ²/30 > 3) < 1e-6


def test_heights_count_radially_on_a_cylinder() -> None:
    made = surface(cylinder(roughness=ROUGH))
    outward = made.mean_vertices - [0.1, 0.8, 0]
    shift = made.vertices - made.mean_vertices
    np.testing.assert_allclose(np.cross(outward, shift), 0, atol=1e-17)  # rounding of 1e-2·5e-5
    options: Table = {"rms": RMS, "correlation_length": LENGTH, "spectrum": "gaussian"}
    expected = rough_profile(
        length=2 * math.pi * 0.01, count=len(outward), inner_cutoff=0.0, periodic=True,
        rng=random_stream(1, 0, "roughness/it"), **options,
    )  # fmt: skip
    np.testing.assert_allclose(np.einsum("vx,vx->v", outward, shift) / 0.01, expected, atol=1e-15)


@pytest.mark.parametrize("tall", [False, True])
def test_faces_of_a_box_move_along_their_normals_away_from_the_edges(tall: bool) -> None:
    body = box(length_m=0.06, depth_m=0.05, angle_deg=0.0, roughness=ROUGH)
    made = surface(body | ({"height_m": 0.04} if tall else {}), spacing=5e-4 if tall else None)
    local = made.mean_vertices - [-0.1, 0.8, 0]
    shift = made.vertices - made.mean_vertices
    halves = np.array([0.03, 0.025, 0.02 if tall else 1.0])
    inside = halves - np.abs(local)
    on_face = inside.argmin(axis=-1)
    others = np.sort(inside, axis=-1)[:, 1]
    middle = others > 10 * LENGTH  # what is nearer to an edge is stretched to reach it
    assert middle.sum() > 100
    for axis in range(2 if not tall else 3):
        face = shift[middle & (on_face == axis)]
        np.testing.assert_array_equal(np.delete(face, axis, axis=1), 0.0)
        assert 0.5 * RMS < face[:, axis].std() < 1.5 * RMS


def test_faces_of_a_box_meet_where_both_heights_place_the_corner() -> None:
    made = surface(box(angle_deg=0.0, roughness=ROUGH))
    options: Table = {"rms": RMS, "correlation_length": LENGTH, "spectrum": "gaussian"}
    stream = random_stream(1, 0, "roughness/it")
    left, right, front, _ = (
        rough_profile(length=side, count=count, inner_cutoff=0.0, rng=stream, **options)
        for side, count in ((0.01, 42), (0.01, 42), (0.02, 82), (0.02, 82))
    )
    shift = made.vertices - made.mean_vertices
    np.testing.assert_allclose(shift[0], [-left[0], -front[0], 0], atol=1e-16)
    corner = 81  # vertices run counter-clockwise from the first corner
    np.testing.assert_allclose(shift[corner], [right[0], -front[-1], 0], atol=1e-16)


def test_the_volume_of_a_rough_box_is_unbiased() -> None:
    volumes = []
    for seed in range(12):
        made = surface(box(height_m=0.015, roughness=ROUGH), seed=seed, spacing=5e-4)
        volumes.append(as_mesh(made, made.vertices).volume)
    # ΔV = Σ over faces of ∫h dA, and var ∫h dA = σ² π l² A: the closed form of its scatter.
    scatter = RMS * LENGTH * math.sqrt(math.pi * 2 * (0.02 * 0.01 + 0.02 * 0.015 + 0.01 * 0.015))
    error = np.mean(volumes) - 0.02 * 0.01 * 0.015
    assert abs(error) < 4.5 * scatter / math.sqrt(12)
    assert 0.4 < np.std(volumes, ddof=1) / scatter < 1.8  # χ with 11 degrees of freedom, 1e-4


def test_heights_at_any_place_are_those_of_the_sheet_between() -> None:
    rough = Roughness(rms_mm=0.05, correlation_mm=1.0)
    places = np.stack(np.meshgrid(np.arange(9), np.arange(7), indexing="ij"), axis=-1) * 7e-4
    got = Heights(rough, random_stream(0, 0, "x")).at(places.reshape(-1, 2)).reshape(9, 7)
    # The very sheet, 7 times finer than the grid of 1/8 mm: it has a point at every place.
    margin = LENGTH
    extent = np.array([8 * 7e-4, 6 * 7e-4]) + 2 * margin
    grid = np.ceil(extent / (LENGTH / SAMPLES_PER_DETAIL)).astype(int)
    finer = 25
    fine = rough_sheet(
        lengths=(float(extent[0]), float(extent[1])),
        counts=(int(grid[0]) * finer + 1, int(grid[1]) * finer + 1),
        rms=RMS, correlation_length=LENGTH, spectrum="gaussian", inner_cutoff=0.0,
        rng=random_stream(0, 0, "x"),
    )  # fmt: skip
    index = np.rint((places + margin) / extent * grid * finer).astype(int)
    expected = fine[index[..., 0], index[..., 1]]
    off = np.abs((places + margin) / extent * grid * finer - index).max()
    slope = 3 * math.sqrt(2) * RMS / LENGTH  # three times the rms slope
    moved = off * LENGTH / SAMPLES_PER_DETAIL / finer * slope  # the places are not quite on it
    np.testing.assert_allclose(got, expected, atol=1e-3 * RMS + moved)


def test_two_objects_do_not_share_their_roughness() -> None:
    both = scene(a=plate(roughness=ROUGH), b=plate(roughness=ROUGH, centre_m=[0, 0.9]))
    one, other = (object_surface(both, name, seed=0) for name in "ab")
    heights = [(s.vertices - s.mean_vertices)[::8] @ [0, 1, 0] for s in (one, other)]
    correlation = np.corrcoef(heights[0], heights[1])[0, 1]
    assert abs(correlation) < 4.5 / math.sqrt(len(heights[0]))


def test_another_object_or_user_does_not_redraw_the_wall() -> None:
    alone = object_surface(scene(a=plate(roughness=ROUGH)), "a", seed=0)
    crowded = scene(b=cylinder(roughness=ROUGH), a=plate(roughness=ROUGH))
    assert alone.vertices.tobytes() == object_surface(crowded, "a", seed=0).vertices.tobytes()


def test_seed_and_sample_each_draw_another_wall() -> None:
    drawn = [
        surface(plate(roughness=ROUGH), seed=seed, sample=sample).vertices.tobytes()
        for seed, sample in ((0, 0), (1, 0), (0, 1), (1, 1))
    ]
    assert len(set(drawn)) == 4


def test_a_finer_wall_is_the_same_wall() -> None:
    coarse = surface(plate(roughness=ROUGH), spacing=2.5e-4)
    fine = surface(plate(roughness=ROUGH), spacing=1.25e-4)
    np.testing.assert_allclose(fine.vertices[::2], coarse.vertices, atol=1e-15)  # rounding


# ---- what is refused


def test_an_unknown_object_is_refused() -> None:
    with pytest.raises(ScenarioError, match=r"objects\.wal: no such object \(did you mean 'wall'"):
        object_surface(scene(wall=plate()), "wal", seed=0)


@pytest.mark.parametrize("spacing", [0.0, -1.0, math.nan])
def test_a_spacing_that_is_not_positive_is_refused(spacing: float) -> None:
    with pytest.raises(ValueError, match=r"spacing = .* m must be positive"):
        surface(plate(), spacing=spacing)


def test_a_spacing_that_would_not_fit_into_memory_is_refused() -> None:
    with pytest.raises(ScenarioError, match=r"facets at a spacing of 0\.0001 mm need .* GiB, more"):
        surface(plate(height_m=0.04), spacing=1e-7)
