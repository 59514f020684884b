"""Scenes that are no rooms: close to the aperture, around it, or hidden by a constant."""

import numpy as np
import pytest
from jaxtyping import Float
from scipy.constants import speed_of_light

from estimator.array.viewpoint import viewpoint
from estimator.imaging.scene_image import ImageOptions, image_scene
from estimator.localization.pipeline import locate
from estimator.measurement.model import Echo, Measurement, MeasurementError, Uplink
from estimator.results.estimate import Estimate
from validation.analytic.point_scatterer import complex_noise, point_echo
from validation.trials.measured_scans import drawn_scan, facing_echo, letter_points

BAND = np.linspace(20e9, 26e9, 31)  # 0.75 m unambiguous, cells of 25 mm
AHEAD = np.array([0.0, 1.0, 0.0])


def scan(count: int = 41, spacing: float = 2.8e-3) -> Float[np.ndarray, "positions 3"]:
    places = (np.arange(count) - (count - 1) / 2) * spacing
    x, z = np.meshgrid(places, places, indexing="ij")
    return np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=-1)


def echo_of(
    target: Float[np.ndarray, " 3"],
    positions: Float[np.ndarray, "positions 3"],
    *,
    transmit: Float[np.ndarray, "positions 3"] | None = None,
    noise: float = 0.03,
    constant: np.ndarray | float = 0.0,
) -> Echo:
    """Return a point's echo with noise and a constant, both over its root mean square."""
    clean = point_echo(
        target[None],
        positions=positions,
        frequencies=BAND,
        radar_cross_section=np.array([1e-3]),
        transmit_positions=transmit,
    )
    level = float(np.sqrt(np.mean(np.abs(clean.samples) ** 2)))
    added = noise * complex_noise(clean.samples.shape, 1.0, np.random.default_rng(2))
    return Echo(
        samples=clean.samples + level * (added + constant),
        positions=positions,
        frequencies=BAND,
        transmit_positions=transmit,
    )


def located(echo: Echo, boresight: Float[np.ndarray, " 3"] = AHEAD) -> Estimate:
    return locate(Measurement(echo=echo, uplinks=(), boresight=boresight))


def assert_found_alone(estimate: Estimate, place: Float[np.ndarray, " 3"]) -> None:
    assert not estimate.mirrors
    assert len(estimate.targets) == 1
    # a tenth of the cell λ/2D · R, about 1 mm close by; noise moves it by less
    assert np.linalg.norm(estimate.targets[0].position - place) < 1.5e-3
    assert estimate.raw_image is not None
    values = np.abs(estimate.raw_image.values)
    brightest = estimate.raw_image.grid.points[np.unravel_index(values.argmax(), values.shape)]
    assert np.linalg.norm(brightest - place) < 0.02  # within a range cell: 0 dB are there


def test_a_point_nearer_than_half_the_aperture_is_found_by_a_plane_and_by_a_line() -> None:
    near = np.array([0.01, 0.05, -0.015])
    assert_found_alone(located(echo_of(near, scan())), near)
    line = np.stack([np.linspace(-0.2, 0.2, 145), np.zeros(145), np.zeros(145)], axis=-1)
    beside = np.array([0.05, 0.08, 0.0])
    assert_found_alone(located(echo_of(beside, line)), beside)


def test_a_coarse_scan_shows_no_grating_lobes_as_targets() -> None:
    near = np.array([0.01, 0.05, -0.015])
    assert_found_alone(located(echo_of(near, scan(21, 6e-3))), near)


def test_two_antennas_that_scan_a_plane_together_image_it() -> None:
    place = np.array([0.02, 0.15, -0.01])
    receivers = scan()
    transmitters = receivers - np.array([0.05, 0.0, 0.0])
    assert_found_alone(located(echo_of(place, receivers, transmit=transmitters)), place)


def test_a_circle_images_what_it_stands_around_and_locates_nobody() -> None:
    angle = np.linspace(0, 2 * np.pi, 90, endpoint=False)
    circle = 0.2 * np.stack([np.cos(angle), np.sin(angle), 0 * angle], axis=-1)
    place = np.array([0.03, -0.05, 0.0])
    echo = echo_of(place, circle)
    assert_found_alone(located(echo), place)
    pilot = Uplink(samples=echo.samples, positions=circle, frequencies=BAND, user="ann")
    with pytest.raises(MeasurementError, match="located with a linear or a planar array"):
        locate(Measurement(echo=None, uplinks=(pilot,)))


def test_positions_strewn_in_space_image_the_scene_between_them() -> None:
    rng = np.random.default_rng(4)
    rays = rng.standard_normal((300, 3))
    ball = 0.25 * rays / np.linalg.norm(rays, axis=1, keepdims=True)
    place = np.array([0.02, 0.03, -0.04])
    assert_found_alone(located(echo_of(place, ball)), place)


def test_a_scan_over_a_table_looks_at_a_right_angle_to_it() -> None:
    flat = scan()[:, [0, 2, 1]]  # x and y, as flat-bed scanners name them
    place = np.array([0.01, -0.02, 0.09])
    estimate = located(echo_of(place, flat))
    assert_found_alone(estimate, place)
    assert any("taken to look along +z" in note for note in estimate.notes)
    assert viewpoint(flat, np.array([0.0, 0.0, -1.0])).frame.axes[1] @ [0, 0, -1] == 1.0


def test_a_constant_of_the_instrument_is_no_mirror_and_hides_nothing() -> None:
    ripple = 100 * (0.6 + 0.4 * np.cos(2 * np.pi * BAND / 1.1e9))
    constant = ripple * np.exp(-4j * np.pi * BAND * 0.4 / speed_of_light)
    near = np.array([0.01, 0.05, -0.015])
    estimate = located(echo_of(near, scan(), constant=constant))
    assert not estimate.mirrors
    assert np.linalg.norm(estimate.targets[0].position - near) < 3e-3  # its own mean is gone, too
    assert any("share one constant" in note for note in estimate.notes)


def test_a_parallel_plate_is_a_mirror_that_is_not_certain() -> None:
    distance = 0.31
    plate = 100 * np.exp(-4j * np.pi * BAND * distance / speed_of_light)
    plate = plate + 10 * np.exp(-8j * np.pi * BAND * distance / speed_of_light)
    estimate = located(echo_of(np.array([0.01, 0.05, -0.015]), scan(), constant=plate))
    (mirror,) = estimate.mirrors
    assert mirror.confidence <= 0.99
    # the multiple is two cells of 25 mm away and 20 dB down: it pulls by less than a tenth of one
    assert abs(mirror.start[1] - distance) < 2.5e-3
    assert all(target.position[1] > 0 for target in estimate.targets)


def test_noise_alone_shows_nothing_near_or_far() -> None:
    samples = complex_noise((len(scan()), BAND.size), 1.0, np.random.default_rng(5))
    estimate = located(Echo(samples=samples, positions=scan(), frequencies=BAND))
    assert not estimate.mirrors
    assert not estimate.targets


def test_a_point_that_few_frequencies_show_long_in_depth_is_placed_at_its_focus() -> None:
    band = np.linspace(22e9, 22.5e9, 6)
    places = np.stack([[0.03, 0.2, 0.03], [-0.03, 0.2, -0.03]])
    clean = point_echo(
        places,
        positions=scan(37, 6.6e-3),
        frequencies=band,
        radar_cross_section=np.full(2, 1e-3),
    )
    estimate = located(clean)
    found = np.array([target.position for target in estimate.targets])
    # 0.03 of the depth's cell of 46 mm (λ/2 over 1 − cos 31°); its long trail is 16 mm behind
    assert len(found) == 2
    assert np.abs(found[np.argsort(-found[:, 0])] - places).max() < 1.5e-3
    assert all(target.ends is None for target in estimate.targets)


def test_what_is_within_the_first_range_cell_of_a_plane_is_no_mirror() -> None:
    """A flat letter 2 cm before a plane of 3 cm; delays tell ranges to 6 cm only."""
    drawn = drawn_scan("letter", np.random.default_rng([2005, 1, 1]), planar=True)
    found = locate(drawn.measurement, images=False)
    assert not found.mirrors
    assert any("first range cell" in note for note in found.notes)


def test_depths_beyond_the_unambiguous_range_are_imaged_where_they_are_asked_for() -> None:
    """31 frequencies repeat every 0.75 m, and the aperture of 0.11 m tells depths to less."""
    place = np.array([0.05, 1.0, -0.03])
    measured = Measurement(echo=echo_of(place, scan(21, 5.6e-3)), uplinks=())
    for asked in (
        ImageOptions(nearest=0.9, farthest=1.2),
        ImageOptions(low=(None, 0.85, None), high=(None, 1.15, None)),
    ):
        made = image_scene(measured, options=asked).image
        brightest = np.unravel_index(int(np.abs(made.values).argmax()), made.values.shape)
        # half a range cell of 25 mm, and half a cell across of 60 mm
        assert np.abs(made.grid.points[brightest] - place).max() < 0.03
    only_near = image_scene(measured, options=ImageOptions(nearest=0.9)).image
    assert only_near.grid.y[-1] > 1.0


def letter_at_a_metre() -> Echo:
    positions = scan(51, 5e-3)
    band = np.linspace(22e9, 26e9, 40)  # 1.46 m unambiguous
    points = letter_points(0.25, 5e-3) + np.array([0.0, 1.0, 0.0])
    samples = facing_echo(points, np.ones(len(points), dtype=complex), positions, band)
    level = float(np.sqrt(np.mean(np.abs(samples) ** 2)))
    added = 0.1 * level * complex_noise(samples.shape, 1.0, np.random.default_rng(5))
    return Echo(samples=samples + added, positions=positions, frequencies=band)


def test_a_flat_letter_at_a_metre_is_no_mirror_and_has_no_ghosts() -> None:
    """It is no wider than the array, and returns to some positions more than to others."""
    estimate = located(letter_at_a_metre())
    assert not estimate.mirrors
    (target,) = estimate.targets
    assert abs(target.position[1] - 1.0) < 0.02  # half a range cell of 37 mm
    assert any("no mirror was found: imaged by" in note for note in estimate.notes)


def test_a_line_whose_frequencies_leave_no_room_is_imaged() -> None:
    """A ground-penetrating radar's: 0.75 m unambiguous, positions over 0.5 m."""
    line = np.stack([np.linspace(-0.25, 0.25, 181), np.zeros(181), np.zeros(181)], axis=-1)
    place = np.array([0.04, 0.3, 0.0])
    estimate = located(echo_of(place, line))
    assert_found_alone(estimate, place)
    assert any("unambiguous to 0.749 m only" in note for note in estimate.notes)
