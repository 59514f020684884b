import numpy as np
import pytest
from jaxtyping import Float

from estimator.channel.music import music_spectrum
from estimator.channel.relax import extract_paths, refine_paths
from estimator.channel.steering import angle_spectrum
from estimator.measurement.model import MeasurementError, Uplink
from validation.analytic.point_scatterer import complex_noise, point_uplink

FREQUENCIES = np.linspace(220e9, 295e9, 101)  # 0.4 m of unambiguous path
COUNT = 64
POSITIONS = np.zeros((COUNT, 3))
POSITIONS[:, 0] = (np.arange(COUNT) - (COUNT - 1) / 2) * 0.5e-3
BEAM = np.degrees(0.886 * 1.164e-3 / (COUNT * 0.5e-3))


def sources_at(
    aoa_deg: Float[np.ndarray, " n"], distance: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 3"]:
    aoa = np.radians(aoa_deg)
    return np.stack([distance * np.cos(aoa), distance * np.sin(aoa), 0 * aoa], axis=1)


def uplink_of(
    aoa_deg: list[float],
    distance: list[float],
    amplitude: list[float],
    *,
    snr_db: float,
    seed: int = 0,
) -> Uplink:
    rng = np.random.default_rng(seed)
    clean = point_uplink(
        sources_at(np.array(aoa_deg), np.array(distance)),
        positions=POSITIONS,
        frequencies=FREQUENCIES,
        amplitude=np.array(amplitude),
        phase=rng.uniform(0, 2 * np.pi, len(aoa_deg)),
    )
    # Friis' λ would taper the band: the model of a path has a constant gain.
    flat = clean.samples * FREQUENCIES / FREQUENCIES.mean()
    power = float(np.mean(np.abs(flat) ** 2))
    noise = complex_noise(flat.shape, power * 10 ** (-snr_db / 10), rng)
    return Uplink(samples=flat + noise, positions=POSITIONS, frequencies=FREQUENCIES, user="a")


def test_all_paths_above_the_noise_are_found_and_no_others() -> None:
    aoa, distance, amplitude = [80.0, 84.0, 120.0], [0.25, 0.25, 0.33], [1.0, 0.5, 0.1]
    paths = extract_paths(uplink_of(aoa, distance, amplitude, snr_db=20.0))
    assert len(paths) == 3
    for path, angle, length in zip(paths, aoa, distance, strict=True):
        deviation = np.sqrt(np.diag(path.covariance))
        error = np.array([path.aoa - np.radians(angle), path.path_length - length])
        assert np.all(np.abs(error) < 4.5 * deviation)  # one false alarm in 1e5
        assert path.excess_db > 0


def test_a_weak_path_beside_a_strong_one_is_not_pulled() -> None:
    # 1.5 beams and 2 cells apart, 20 dB weaker: inside the strong one's first sidelobes.
    separate = 90.0 + 1.5 * BEAM
    paths = extract_paths(uplink_of([90.0, separate], [0.25, 0.258], [1.0, 0.1], snr_db=25.0))
    assert len(paths) == 2
    weak = paths[1]
    deviation = np.sqrt(np.diag(weak.covariance))
    error = np.array([weak.aoa - np.radians(separate), weak.path_length - 0.258])
    assert np.all(np.abs(error) < 4.5 * deviation)


def test_noise_alone_holds_no_path() -> None:
    # A rate of 0.01 over 40 draws: more than 4 are expected once in 1500 runs at most.
    found = 0
    for seed in range(40):
        rng = np.random.default_rng(seed)
        noise = Uplink(
            samples=complex_noise((COUNT, FREQUENCIES.size), 1.0, rng),
            positions=POSITIONS,
            frequencies=FREQUENCIES,
            user="a",
        )
        found += bool(extract_paths(noise, false_alarm_rate=0.01, most=1))
    assert found <= 4


def test_without_noise_the_truth_itself_comes_back() -> None:
    uplink = uplink_of([75.0], [0.3], [1.0], snr_db=300.0)
    (path,) = extract_paths(uplink)
    assert path.aoa == pytest.approx(np.radians(75.0), abs=1e-10)
    assert path.path_length == pytest.approx(0.3, abs=1e-10)


def test_a_rate_that_is_no_probability_is_refused() -> None:
    uplink = uplink_of([75.0], [0.3], [1.0], snr_db=20.0)
    with pytest.raises(MeasurementError, match="false-alarm rate 0"):
        extract_paths(uplink, false_alarm_rate=0.0)


def test_refinement_keeps_the_order_of_strength() -> None:
    uplink = uplink_of([80.0, 100.0], [0.2, 0.3], [0.3, 1.0], snr_db=30.0)
    starts = np.array([[np.radians(80.0), 0.2], [np.radians(100.0), 0.3]])
    paths = refine_paths(uplink, starts)
    assert abs(paths[0].gain) > abs(paths[1].gain)
    assert np.degrees(paths[0].aoa) == pytest.approx(100.0, abs=0.01)


def peaks_of(spectrum: Float[np.ndarray, " n"], grid: Float[np.ndarray, " n"]) -> list[float]:
    inner = (spectrum[1:-1] > spectrum[:-2]) & (spectrum[1:-1] > spectrum[2:])
    places = np.flatnonzero(inner) + 1
    places = places[np.argsort(spectrum[places])[::-1][:2]]
    return sorted(float(np.degrees(grid[i])) for i in places)


def test_music_parts_two_sources_that_the_beam_does_not() -> None:
    # 0.7 of a beam apart at one distance: coherent at every frequency.
    truth = [90.0 - 0.35 * BEAM, 90.0 + 0.35 * BEAM]
    uplink = uplink_of(truth, [0.3, 0.301], [1.0, 1.0], snr_db=30.0, seed=4)
    grid = np.radians(90 + np.arange(-3, 3, 0.01))
    spectrum = music_spectrum(uplink, grid, paths=2, distance=0.3)
    found = peaks_of(spectrum, grid)
    np.testing.assert_allclose(found, truth, atol=0.1 * BEAM)
    beam = np.abs(angle_spectrum(uplink, grid, frequency=257.5e9, distance=0.3))
    inside = np.abs(np.degrees(grid) - 90) < BEAM
    assert np.count_nonzero(np.diff(np.sign(np.diff(beam[inside]))) < 0) <= 1


def test_music_agrees_with_the_grid_search_for_one_source() -> None:
    uplink = uplink_of([70.0], [0.3], [1.0], snr_db=30.0)
    grid = np.radians(70 + np.arange(-2, 2, 0.01))
    spectrum = music_spectrum(
        uplink, grid, paths=1, towards=np.radians(70.0), distance=0.3, path_length=(0.28, 0.32)
    )
    assert np.degrees(grid[spectrum.argmax()]) == pytest.approx(70.0, abs=0.03)


def test_what_music_cannot_do_is_refused() -> None:
    uplink = uplink_of([75.0], [0.3], [1.0], snr_db=20.0)
    grid = np.array([1.0, 1.1])
    with pytest.raises(MeasurementError, match="cannot tell 10 paths apart"):
        music_spectrum(uplink, grid, paths=10, subarray=8)
    with pytest.raises(MeasurementError, match="less than one range cell"):
        music_spectrum(uplink, grid, paths=1, path_length=(0.3, 0.301))
    uneven = POSITIONS.copy()
    uneven[5, 0] += 0.1e-3
    bent = Uplink(samples=uplink.samples, positions=uneven, frequencies=FREQUENCIES, user="a")
    with pytest.raises(MeasurementError, match="uniform linear array"):
        music_spectrum(bent, grid, paths=1)
    few = Uplink(
        samples=uplink.samples[:2], positions=POSITIONS[:2], frequencies=FREQUENCIES, user="a"
    )
    with pytest.raises(MeasurementError, match="at least three"):
        music_spectrum(few, grid, paths=1)
