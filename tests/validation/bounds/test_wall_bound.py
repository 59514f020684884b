import numpy as np
import pytest

from scenes.files.loading import load_scenario
from scenes.surfaces.height_synthesis import rough_profile
from validation.bounds.wall_bound import (
    line_covariance,
    noise_depth_deviation,
    speckle_depth_deviation,
    wall_covariance_bound,
)


def test_the_covariance_is_that_of_a_line_through_scattered_points() -> None:
    rng = np.random.default_rng(2)
    length, cells, deviation, trials = 0.4, 30, 5e-5, 20_000
    places = (np.arange(cells) + 0.5) / cells * length - length / 2
    depths = rng.normal(scale=deviation, size=(cells, trials))
    slope, offset = np.polyfit(places, depths, 1)
    expected = line_covariance(length=length, cells=float(cells), depth_deviation=deviation)
    # Variances of 20 000 trials scatter by 1 %: 4 deviations.
    assert slope.var() == pytest.approx(expected[0, 0], rel=0.04)
    assert offset.var() == pytest.approx(expected[1, 1], rel=0.04)


def test_speckle_blurs_a_cells_depth_as_its_spectra_say() -> None:
    rms, correlation, wavelength, incidence = 5e-6, 0.3e-3, 1.16e-3, np.pi / 4
    cell, count, trials = 20e-3, 800, 3000
    rng = np.random.default_rng(4)
    places = np.linspace(-cell / 2, cell / 2, count)
    taper = np.hanning(count)
    along = 4 * np.pi / wavelength * np.sin(incidence)
    waves = taper * np.exp(-1j * along * places)
    # Two ranges' wavenumbers along the normal; the phase between them is the depth.
    normal = 4 * np.pi / wavelength * np.cos(incidence) * np.array([0.999, 1.001])
    pairs = np.empty((trials, 2), dtype=np.complex128)
    for trial in range(trials):
        heights = rough_profile(
            length=cell,
            count=count,
            rms=rms,
            correlation_length=correlation,
            spectrum="gaussian",
            inner_cutoff=correlation,
            rng=rng,
        )
        pairs[trial] = (np.expm1(1j * normal[:, None] * heights) * waves).sum(axis=1)
    # Weighted by intensity, as a sum over cells is: |u|² times the phase's slope.
    weighted = (pairs[:, 1] * pairs[:, 0].conj()).imag / np.diff(normal)
    depth = np.sqrt(np.mean(weighted**2)) / np.mean(np.abs(pairs[:, 0]) ** 2)
    expected = speckle_depth_deviation(
        rms=rms, correlation_length=correlation, wavelength=wavelength, incidence=incidence
    )
    # Weights of an exponential distribution: 3000 trials scatter by some 2.5 %; 4 of them.
    assert depth == pytest.approx(expected, rel=0.1)


def test_noise_blurs_depth_as_the_textbook_range_bound() -> None:
    # c/(4π B_rms √(2 SNR)): 75 GHz at 20 dB give 0.0778 mm of a millimetre's 1.1 mm cell.
    facing = noise_depth_deviation(bandwidth=75e9, snr=100.0, incidence=0.0)
    assert facing == pytest.approx(299792458 / (4 * np.pi * 75e9 / 12**0.5 * 200**0.5), rel=1e-12)
    oblique = noise_depth_deviation(bandwidth=75e9, snr=100.0, incidence=np.pi / 3)
    assert oblique == pytest.approx(2 * facing, rel=1e-9)


def test_roughness_and_not_noise_blurs_the_wall_of_the_slam_scene() -> None:
    scene = load_scenario("slam_2d")
    given = wall_covariance_bound(scene, "wall")
    without = wall_covariance_bound(scene, "wall", snr_db=np.inf)
    np.testing.assert_allclose(given, without, rtol=0.02)
    drowned = wall_covariance_bound(scene, "wall", snr_db=-40.0)
    assert np.all(np.diag(drowned) > 4 * np.diag(given))


def test_a_twice_as_long_array_tells_the_angle_by_the_root_of_two() -> None:
    scene = load_scenario("slam_2d", ("base_station.elements=519",))
    ratio = wall_covariance_bound(load_scenario("slam_2d"), "wall") / wall_covariance_bound(
        scene, "wall"
    ).clip(1e-30)
    assert ratio[0, 0] == pytest.approx(2.0, rel=0.01)  # twice as many cells of the same blur


def test_what_has_no_diffuse_echo_is_refused() -> None:
    with pytest.raises(ValueError, match="at least 2"):
        line_covariance(length=0.01, cells=1.5, depth_deviation=1e-5)
    with pytest.raises(ValueError, match="no diffuse echo"):
        wall_covariance_bound(
            load_scenario("slam_2d", ("objects.wall.roughness.rms_mm=0",)), "wall"
        )
    with pytest.raises(ValueError, match="3 dimensions"):
        wall_covariance_bound(load_scenario("room_3d"), "floor")
    with pytest.raises(ValueError, match="no object 'door'"):
        wall_covariance_bound(load_scenario("slam_2d"), "door")
    posts = load_scenario("nlos_posts")
    with pytest.raises(ValueError, match="no plate of Gaussian"):
        wall_covariance_bound(posts, next(name for name in posts.objects if "post" in name))
