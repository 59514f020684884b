import math

# Over 400 lines: every key of a scenario is refused or read here.
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.constants import speed_of_light

from scenes.scenario import (
    MATERIALS,
    BaseStation,
    Cosine,
    GaussianBeam,
    Horn,
    Isotropic,
    Plate,
    Radio,
    Scenario,
    ScenarioError,
    parse_scenario,
)

Table = dict[str, Any]


def tables(**changes: object) -> Table:
    """The smallest scene with a wall and a user; ``a__b=1`` sets the key a.b, None removes it."""
    data: Table = {
        "name": "scene",
        "radio": {"start_ghz": 220.0, "stop_ghz": 295.0, "points": 11},
        "base_station": {"elements": 5, "spacing_mm": 0.5},
        "objects": {
            "wall": {
                "kind": "plate",
                "material": "metal",
                "centre_m": [0.0, 0.8],
                "angle_deg": 45.0,
                "length_m": 0.4,
            }
        },
        "users": {"user": {"position_m": [1.0, 0.8]}},
    }
    for path, value in changes.items():
        *parents, last = path.split("__")
        table = data
        for parent in parents:
            table = table.setdefault(parent, {})
        if value is None:
            del table[last]
        else:
            table[last] = value
    return data


def scene(**changes: object) -> Scenario:
    return parse_scenario(tables(**changes))


def test_the_band_is_a_uniform_grid_from_start_to_stop() -> None:
    radio = scene(radio={"start_ghz": 220, "stop_ghz": 295, "points": 1001}).radio
    assert radio.frequencies[0] == 220e9
    assert radio.frequencies[-1] == 295e9
    # Steps of 75 MHz; a frequency of 3e11 has a rounding of 6e-5 Hz.
    np.testing.assert_allclose(np.diff(radio.frequencies), 75e6, rtol=1e-11)
    assert radio.centre_frequency == 257.5e9
    assert radio.shortest_wavelength == speed_of_light / 295e9
    assert radio.longest_wavelength == speed_of_light / 220e9


@pytest.mark.parametrize("count", [1, 4, 5, 260])
def test_the_array_is_centred_at_its_position(count: int) -> None:
    station = BaseStation(elements=count, spacing_mm=0.5, position_m=(0.1, -0.2, 0.0))
    positions = station.element_positions
    assert positions.shape == (count, 3)
    np.testing.assert_allclose(positions.mean(axis=0), [0.1, -0.2, 0.0], atol=1e-15)  # rounding
    assert np.ptp(positions[:, 0]) == pytest.approx((count - 1) * 0.5e-3)
    assert not np.ptp(positions[:, 1:], axis=0).any()


def test_an_array_looks_along_y_and_lies_along_x_by_default() -> None:
    station = BaseStation(elements=3, spacing_mm=1.0)
    assert station.axis.tolist() == [1.0, 0.0, 0.0]
    assert station.boresight.tolist() == [0.0, 1.0, 0.0]
    assert station.element_positions[:, 0].tolist() == [-1e-3, 0.0, 1e-3]


@given(st.floats(-360, 360))
def test_the_axis_is_a_quarter_turn_clockwise_of_the_boresight(azimuth: float) -> None:
    station = BaseStation(elements=3, spacing_mm=1.0, boresight_deg=azimuth)
    turn = math.radians(azimuth)
    rounding = 1e-14  # of angles up to 2π, in double precision
    np.testing.assert_allclose(
        station.boresight, [math.cos(turn), math.sin(turn), 0], atol=rounding
    )
    np.testing.assert_allclose(np.cross(station.axis, station.boresight), [0, 0, 1], atol=rounding)


def test_a_planar_array_spreads_along_its_axis_and_along_z() -> None:
    station = BaseStation(elements=(3, 2), spacing_mm=(1.0, 4.0), position_m=(0.0, 0.0, 1.0))
    assert station.element_count == 6
    grid = station.element_positions.reshape(3, 2, 3)
    np.testing.assert_allclose(grid[:, 0, 0], [-1e-3, 0, 1e-3], atol=1e-18)
    np.testing.assert_allclose(grid[0, :, 2], [0.998, 1.002])
    assert not grid[..., 1].any()


def test_positions_take_two_or_three_coordinates_and_keep_three() -> None:
    assert scene(users__user__position_m=[1, 0.8]).users["user"].position_m == (1.0, 0.8, 0.0)
    assert scene(users__user__position_m=[1, 0.8, 0]).users["user"].position_m == (1.0, 0.8, 0.0)
    np.testing.assert_array_equal(scene().users["user"].position, [1.0, 0.8, 0.0])


def test_a_wall_at_45_degrees_turns_the_boresight_ray_towards_x() -> None:
    wall = scene().objects["wall"]
    ray = np.array([0.0, 1.0, 0.0])
    reflected = ray - 2 * (ray @ wall.normal) * wall.normal
    np.testing.assert_allclose(reflected, [1.0, 0.0, 0.0], atol=1e-15)  # rounding


def test_lengths_in_millimetres_become_metres() -> None:
    rough = (
        scene(
            objects__wall__roughness={
                "rms_mm": 0.05,
                "correlation_mm": 0.3,
                "spectrum": "exponential",
                "inner_cutoff_mm": 0.03,
            }
        )
        .objects["wall"]
        .roughness
    )
    assert rough is not None
    assert (rough.rms, rough.correlation_length) == pytest.approx((5e-5, 3e-4))
    assert rough.inner_cutoff == pytest.approx(3e-5)


def test_a_scenario_needs_neither_objects_nor_users() -> None:
    empty = scene(objects=None, users=None)
    assert (empty.objects, empty.users) == ({}, {})
    assert empty.noise.snr_db == math.inf


# ---- where antennas look


def looking(**aim: object) -> Scenario:
    return scene(users__user__antenna={"kind": "gaussian_beam", "sigma_rad": 0.1, **aim})


def test_an_antenna_aimed_at_an_object_looks_at_its_centre_also_when_moved() -> None:
    for centre in ([0.0, 0.8], [0.3, 0.5]):
        data = tables(
            objects__wall__centre_m=centre,
            users__user__antenna={"kind": "horn", "gain_dbi": 23, "aim": "wall"},
        )
        scenario = parse_scenario(data)
        user = scenario.users["user"]
        direction = scenario.aim(user.antenna, user.position)
        expected = np.array([*centre, 0.0]) - user.position
        np.testing.assert_allclose(direction, expected / np.linalg.norm(expected))


def test_an_antenna_aimed_at_a_point_looks_there() -> None:
    scenario = looking(aim_m=[1.0, 2.0])
    user = scenario.users["user"]
    np.testing.assert_allclose(scenario.aim(user.antenna, user.position), [0, 1, 0])


def test_an_antenna_aimed_along_an_azimuth_looks_that_way_from_anywhere() -> None:
    scenario = looking(aim_deg=180)
    antenna = scenario.users["user"].antenna
    assert scenario.aim(antenna, np.array([3.0, 4.0, 0.0])).tolist() == [-1.0, 0.0, 0.0]


def test_the_base_stations_antennas_look_along_the_boresight_unless_aimed() -> None:
    scenario = scene(base_station__antenna={"kind": "cosine", "exponent": 2})
    station = scenario.base_station
    np.testing.assert_array_equal(scenario.aim(station.antenna, np.zeros(3)), station.boresight)
    scenario = scene(base_station__antenna={"kind": "cosine", "exponent": 2, "aim": "wall"})
    np.testing.assert_allclose(scenario.aim(scenario.base_station.antenna, np.zeros(3)), [0, 1, 0])


def test_an_isotropic_antenna_may_be_asked_where_it_looks() -> None:
    scenario = scene()
    np.testing.assert_array_equal(
        scenario.aim(Isotropic(), np.array([1.0, 0.8, 0.0])), scenario.base_station.boresight
    )


def test_an_aim_at_the_antennas_own_place_is_refused() -> None:
    scenario = looking(aim_m=[0.5, 0.5])
    with pytest.raises(ScenarioError, match="is where the antenna stands"):
        scenario.aim(scenario.users["user"].antenna, np.array([0.5, 0.5, 0.0]))


@pytest.mark.parametrize(
    ("antenna", "kind"),
    [
        ({"kind": "isotropic"}, Isotropic),
        ({"kind": "cosine", "exponent": 1, "aim_deg": 0}, Cosine),
        ({"kind": "gaussian_beam", "sigma_rad": 0.1, "aim_deg": 0}, GaussianBeam),
        ({"kind": "horn", "gain_dbi": 23.0, "aim_deg": 0}, Horn),
    ],
)
def test_every_kind_of_antenna_can_be_written(antenna: Table, kind: type) -> None:
    assert type(scene(users__user__antenna=antenna).users["user"].antenna) is kind


# ---- what is refused, by key, value, limit and remedy

REFUSED: list[tuple[Table, str]] = [
    # unknown and missing
    ({"colour": "red"}, r"^colour: unknown key; known: format, name"),
    ({"radio__point": 3}, r"^radio\.point: unknown key \(did you mean 'points'\?\); known: start"),
    (
        {"objects__wall__lenght_m": 1.0},
        r"^objects\.wall\.lenght_m: unknown key \(did you mean 'length_m'\?\); known for kind "
        r"'plate': .*; to change the kind, replace the whole table",
    ),
    ({"radio": None}, r"^radio: missing; give the table \[radio\]"),
    ({"radio__points": None}, r"^radio\.points: missing; give the number of frequencies"),
    ({"objects__wall__kind": None}, r"^objects\.wall\.kind: missing; give one of plate, cyl"),
    ({"objects__wall__material": None}, r"^objects\.wall\.material: missing; give one of metal"),
    (
        {"objects__wall__kind": "plat"},
        r"^objects\.wall\.kind = 'plat': unknown kind \(did you mean 'plate'\?\); use one of plate",
    ),
    (
        {"users__user__antenna": {"kind": "yagi"}},
        r"^users\.user\.antenna\.kind = 'yagi': unknown kind; use one of isotropic, cosine",
    ),
    # wrong types
    ({"format": 2}, r"^format = 2: must be 1; give the format"),
    ({"dimensions": 4}, r"^dimensions = 4: must be 2 or 3"),
    ({"waves": "plane"}, r"^waves = 'plane': must be 'spherical' or 'cylindrical'"),
    ({"radio": 3}, r"^radio = 3: must be a table of keys"),
    ({"objects": [1]}, r"^objects = \[1\]: must be a table of keys"),
    ({"radio__points": "many"}, r"^radio\.points = 'many': must be a valid integer; give the num"),
    ({"radio__points": 11.0}, r"^radio\.points = 11\.0: must be a valid integer"),
    ({"radio__points": True}, r"^radio\.points = true: must be a valid integer"),
    ({"radio__start_ghz": "220"}, r"^radio\.start_ghz = '220': must be a valid number"),
    ({"title": "x" * 201}, r"^title = 'x.*: must|^title = 'x+\.\.\.x+': .*200 characters"),
    ({"users__user__position_m": 5}, r"^users\.user\.position_m = 5: must be a position in met"),
    ({"users__user__position_m": [1.0]}, r"^users\.user\.position_m = \[1\.0\]: must be a posi"),
    ({"users__user__position_m": "ab"}, r"^users\.user\.position_m = 'ab': must be a position"),
    ({"users__user__position_m": ["a", 1]}, r"^users\.user\.position_m\.0 = 'a': must be a valid"),
    # out of range
    ({"max_bounces": 9}, r"^max_bounces = 9: must be less than or equal to 8; give the most"),
    ({"max_bounces": -1}, r"^max_bounces = -1: must be greater than or equal to 0"),
    ({"radio__points": 1}, r"^radio\.points = 1: must be greater than or equal to 2"),
    ({"radio__points": 10**6}, r"^radio\.points = 1000000: must be less than or equal to 100000"),
    ({"radio__start_ghz": 0.0}, r"^radio\.start_ghz = 0\.0: must be greater than or equal to 0\.1"),
    ({"radio__stop_ghz": 3001}, r"^radio\.stop_ghz = 3001: must be less than or equal to 3000"),
    ({"radio__stop_ghz": 220.0}, r"^radio: stop_ghz = 220\.0 must exceed start_ghz = 220\.0; swap"),
    ({"radio__stop_ghz": 100.0}, r"^radio: stop_ghz = 100\.0 must exceed start_ghz = 220\.0"),
    ({"noise__snr_db": -61}, r"^noise\.snr_db = -61: must be greater than or equal to -60"),
    ({"objects__wall__length_m": -1}, r"^objects\.wall\.length_m = -1: must be greater than .*\[m"),
    ({"objects__wall__length_m": 0}, r"^objects\.wall\.length_m = 0: must be greater than"),
    ({"objects__wall__length_m": 1e4}, r"^objects\.wall\.length_m = 10000\.0: must be less than"),
    ({"objects__wall__angle_deg": 361}, r"^objects\.wall\.angle_deg = 361: must be less than"),
    ({"objects__wall__centre_m": [0, 1e4]}, r"^objects\.wall\.centre_m\.1 = 10000\.0: must be les"),
    # infinite, or no number
    ({"noise__snr_db": math.nan}, r"^noise\.snr_db = nan: must be"),
    ({"noise__snr_db": -math.inf}, r"^noise\.snr_db = -inf: must be"),
    ({"radio__start_ghz": math.nan}, r"^radio\.start_ghz = nan: must be a finite number"),
    ({"objects__wall__length_m": math.nan}, r"^objects\.wall\.length_m = nan: must be a finite"),
    ({"objects__wall__length_m": math.inf}, r"^objects\.wall\.length_m = inf: must be a finite"),
    ({"objects__wall__angle_deg": math.nan}, r"^objects\.wall\.angle_deg = nan: must be a finite"),
    ({"users__user__position_m": [math.nan, 0]}, r"^users\.user\.position_m\.0 = nan: must be a f"),
    ({"base_station__spacing_mm": math.nan}, r"^base_station\.spacing_mm = nan: must be from 0\.0"),
    # the array
    ({"base_station__elements": 0}, r"^base_station\.elements = 0: must be from 1 to 65536"),
    (
        {"base_station__elements": 2.5},
        r"^base_station\.elements = 2\.5: must be an integer, or a p",
    ),
    ({"base_station__elements": True}, r"^base_station\.elements = true: must be an integer"),
    ({"base_station__elements": [1, 2, 3]}, r"^base_station\.elements = \[1, 2, 3\]: must be an i"),
    ({"base_station__spacing_mm": "a"}, r"^base_station\.spacing_mm = 'a': must be a number, or a"),
    ({"base_station__spacing_mm": -0.5}, r"^base_station\.spacing_mm = -0\.5: must be from 0\.001"),
    (
        {"base_station__spacing_mm": [1.0, 2.0]},
        r"^base_station: spacing_mm = \[1\.0, 2\.0\] is a pair, but elements = 5 is not",
    ),
    (
        {"dimensions": 3, "base_station__elements": [300, 300]},
        r"^base_station: 90000 elements in all must be at most 65536; reduce elements",
    ),
    # names
    ({"name": ""}, r"^name = '': must not be empty"),
    ({"name": "a/b"}, r"^name = 'a/b': must have at most 64 printable characters, none of \. /"),
    ({"users__": {"position_m": [1, 1]}}, r"^users\. = '': must not be empty"),
    ({"users": {"a.b": {"position_m": [1, 1]}}}, r"^users\.a\.b = 'a\.b': must have at most 64"),
    ({"users": {" a": {"position_m": [1, 1]}}}, r"^users\. a = ' a': must .* no space at its ends"),
    ({"objects": {"a\n": tables()["objects"]["wall"]}}, r"printable characters"),
    # roughness
    (
        {"objects__wall__roughness": {"rms_mm": -1, "correlation_mm": 1}},
        r"^objects\.wall\.roughness\.rms_mm = -1: must be greater than or equal to 0; give the rms",
    ),
    (
        {"objects__wall__roughness": {"rms_mm": 1, "correlation_mm": 0}},
        r"^objects\.wall\.roughness\.correlation_mm = 0: must be greater than or equal to 0\.0000",
    ),
    (
        {"objects__wall__roughness": {"rms_mm": 1}},
        r"^objects\.wall\.roughness\.correlation_mm: missing; give the length",
    ),
    (
        {"objects__wall__roughness": {"rms_mm": 1, "correlation_mm": 1, "spectrum": "exponential"}},
        r"^objects\.wall\.roughness: an exponential spectrum has unbounded slopes; give inner_cut",
    ),
    (
        {"objects__wall__roughness": {"rms_mm": 1, "correlation_mm": 1, "inner_cutoff_mm": 0.1}},
        r"^objects\.wall\.roughness: a gaussian spectrum takes no inner_cutoff_mm \(it is 0\.1\)",
    ),
    (
        {
            "objects__wall__roughness": {
                "rms_mm": 1,
                "correlation_mm": 1,
                "spectrum": "exponential",
                "inner_cutoff_mm": 2,
            }
        },
        r"inner_cutoff_mm = 2\.0 must not exceed correlation_mm = 1\.0; lower it",
    ),
    # materials
    (
        {"objects__wall__material": "metall"},
        r"^objects\.wall\.material = 'metall': unknown material \(did you mean 'metal'\?\); use o",
    ),
    (
        {
            "objects__wall__material": "absorber",
            "objects__wall__roughness": {"rms_mm": 0.1, "correlation_mm": 1},
        },
        r"^objects\.wall: an absorber scatters nothing, rough or smooth; remove 'roughness'",
    ),
    # antennas
    (
        {"users__user__antenna": {"kind": "horn", "gain_dbi": 23}},
        r"^users\.user: a directive antenna must look somewhere; give antenna\.aim",
    ),
    (
        {"users__user__antenna": {"kind": "horn", "gain_dbi": 23, "aim": "wall", "aim_deg": 0}},
        r"^users\.user\.antenna: has aim and aim_deg; keep exactly one",
    ),
    (
        {"users__user__antenna": {"kind": "horn", "gain_dbi": 23, "aim": "wal"}},
        r"^users\.user\.antenna\.aim = 'wal': no such object \(did you mean 'wall'\?\); known",
    ),
    (
        {"users__user__antenna": {"kind": "horn", "gain_dbi": 23, "aim_m": [1.0, 0.8]}},
        r"^users\.user\.antenna: aim \[1\.0, 0\.8, 0\.0\] m is where the antenna stands",
    ),
    (
        {"users__user__antenna": {"kind": "isotropic", "aim_deg": 0}},
        r"^users\.user\.antenna\.aim_deg: unknown key; known for kind 'isotropic': polarization, "
        "cross_polar_db, kind",
    ),
    (
        {"users__user__antenna": {"kind": "gaussian_beam", "sigma_rad": 0, "aim_deg": 0}},
        r"^users\.user\.antenna\.sigma_rad = 0: must be greater than 0; give the standard width",
    ),
    # two and three dimensions
    ({"users__user__position_m": [1, 2, 3]}, r"^users\.user\.position_m = .*: z must be 0 in two"),
    ({"base_station__position_m": [0, 0, 1]}, r"^base_station\.position_m = .*: z must be 0 in t"),
    ({"objects__wall__centre_m": [0, 1, 1]}, r"^objects\.wall\.centre_m = .*: z must be 0 in two"),
    (
        {"users__user__antenna": {"kind": "horn", "gain_dbi": 9, "aim_m": [0, 0, 1]}},
        r"^users\.user\.antenna\.aim_m = .*: z must be 0 in two dimensions; leave z out",
    ),
    ({"objects__wall__height_m": 1}, r"^objects\.wall\.height_m = 1\.0: a 2-D scene is invariant"),
    ({"dimensions": 3}, r"^objects\.wall\.height_m: missing; give the height along z"),
    (
        {"dimensions": 3, "objects__wall__height_m": 1, "waves": "cylindrical"},
        r"^waves = 'cylindrical': possible in two dimensions only, and dimensions = 3; set waves",
    ),
    ({"base_station__elements": [3, 2]}, r"^base_station\.elements = \[3, 2\]: a planar array nee"),
    (
        {
            "objects": {
                "a": {
                    "kind": "mesh",
                    "material": "metal",
                    "file": "a.ply",
                    "roughness": {"rms_mm": 0.1, "correlation_mm": 1.0},
                }
            }
        },
        r"^objects\.a\.roughness\.rms_mm = 0\.1: a mesh can be rough in three dimensions only; set",
    ),
    (
        {"radio__points": 100_000, "base_station__elements": 20_000, "objects": None},
        r"^radio\.points = 100000: 20000 elements times that are 2e\+09 samples, more than 1\.07e",
    ),
]


@pytest.mark.parametrize(("changes", "message"), REFUSED, ids=range(len(REFUSED)))
def test_what_cannot_be_is_refused_with_key_value_limit_and_remedy(
    changes: Table, message: str
) -> None:
    with pytest.raises(ScenarioError, match=message):
        scene(**changes)


def test_every_problem_has_a_line_of_its_own() -> None:
    with pytest.raises(ScenarioError) as caught:
        scene(radio__points=1, max_bounces=9, objects__wall__length_m=-1)
    assert len(str(caught.value).splitlines()) == 3


def test_objects_and_users_may_bear_the_names_of_keys() -> None:
    wall = tables()["objects"]["wall"]
    with pytest.raises(ScenarioError, match=r"^objects\.radio\.length_m = 0: must be"):
        scene(objects={"radio": wall | {"length_m": 0}})
    with pytest.raises(ScenarioError, match=r"^objects\.plate\.kind: missing; give one of plate"):
        scene(objects={"plate": {"material": "metal"}})
    with pytest.raises(ScenarioError, match=r"^users\.antenna\.antenna\.gain_dbi: missing; give"):
        scene(users={"antenna": {"position_m": [1, 0], "antenna": {"kind": "horn"}}})


def test_something_that_is_no_table_is_refused() -> None:
    with pytest.raises(ScenarioError, match=r"\nradio: missing; give the table"):
        parse_scenario({})


def test_a_scenario_cannot_be_changed() -> None:
    with pytest.raises(ValueError, match="frozen"):
        setattr(scene(), "title", "other")  # noqa: B010  mypy knows that it is frozen


def test_the_models_can_be_used_without_a_file() -> None:
    wall = Plate(kind="plate", material=MATERIALS[0], centre_m=(0.0, 1.0, 0.0), length_m=0.4)
    scenario = Scenario(
        name="made",
        radio=Radio(start_ghz=220, stop_ghz=295, points=3),
        base_station=BaseStation(elements=2, spacing_mm=0.5),
        objects={"wall": wall},
    )
    np.testing.assert_array_equal(scenario.object_centre("wall"), [0, 1, 0])
