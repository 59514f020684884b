from collections.abc import Callable

# Over 400 lines: one geometry serves all bounds.
from functools import partial

import numpy as np
import pytest
from jaxtyping import Complex, Float

from estimator.channel.relax import refine_paths
from estimator.measurement.model import Uplink
from scenes.files.loading import load_scenario
from simulator.simulation import simulate
from validation.analytic.point_scatterer import complex_noise, point_uplink
from validation.bounds.cramer_rao import cramer_rao_bound
from validation.bounds.position_bound import (
    Plane,
    PositionBound,
    image_and_slopes,
    plane_axes,
    position_error_bound,
    spherical_waves,
)
from validation.bounds.scenario_bound import scenario_position_bound, user_waves

FREQUENCIES = np.linspace(220e9, 295e9, 24)
WALL = Plane(point=np.array([0.05, 0.8, 0.0]), normal=np.array([np.sqrt(0.5), -np.sqrt(0.5), 0.0]))
SIDE = Plane(point=np.array([0.7, 0.2, 0.0]), normal=np.array([-1.0, 0.0, 0.0]))


def linear_array(count: int = 20, spacing: float = 0.5e-3) -> Float[np.ndarray, "elements 3"]:
    positions = np.zeros((count, 3))
    positions[:, 0] = (np.arange(count) - (count - 1) / 2) * spacing
    return positions


def planar_array(count: int = 6, spacing: float = 1e-3) -> Float[np.ndarray, "elements 3"]:
    x, z = np.meshgrid(*2 * [(np.arange(count) - (count - 1) / 2) * spacing], indexing="ij")
    return np.stack([x.ravel(), np.zeros(count**2), z.ravel()], axis=-1)


def moved(plane: Plane, change: Float[np.ndarray, " inputs"]) -> Plane:
    """Turn a plane about its point and shift it: exactly, not to first order."""
    if len(change) == 2:
        cosine, sine = np.cos(change[0]), np.sin(change[0])
        x, y, z = plane.normal
        normal = np.array([cosine * x - sine * y, sine * x + cosine * y, z])
    else:
        first, second = plane_axes(plane.normal)
        normal = plane.normal - change[0] * first - change[1] * second
        normal /= np.linalg.norm(normal)
    return Plane(point=plane.point + change[-1] * plane.normal, normal=normal)


def brute_force_bound(
    model: Callable[[Float[np.ndarray, " n"]], Complex[np.ndarray, "elements freqs"]],
    steps: Float[np.ndarray, " n"],
    *,
    snr: float,
    prior: Float[np.ndarray, "n n"],
    axes: int,
) -> Float[np.ndarray, "axes axes"]:
    """Invert the Fisher information of a whole model by central differences."""
    middle = model(np.zeros(len(steps)))
    rows = []
    for index, step in enumerate(steps):
        change = np.zeros(len(steps))
        change[index] = step
        rows.append((model(change) - model(-change)).ravel() / (2 * step))
    jacobian = np.stack(rows)
    variance = np.mean(np.abs(middle) ** 2) / snr
    information = 2 / variance * (jacobian.conj() @ jacobian.T).real + prior
    return np.linalg.inv(information)[:axes, :axes]


def whole_model(
    user: Float[np.ndarray, " 3"],
    planes: list[Plane],
    paths: list[tuple[int, ...]],
    gains: Complex[np.ndarray, " paths"],
    positions: Float[np.ndarray, "elements 3"],
    dimensions: int,
) -> Callable[[Float[np.ndarray, " n"]], Complex[np.ndarray, "elements freqs"]]:
    """Change position, planes, clock and gains of the model of spherical waves."""

    def model(change: Float[np.ndarray, " n"]) -> Complex[np.ndarray, "elements freqs"]:
        ends = np.cumsum([dimensions, dimensions * len(planes), 1])
        place, turns, clock, relative = np.split(change, ends)
        elsewhere = [
            moved(plane, part)
            for plane, part in zip(planes, turns.reshape(len(planes), dimensions), strict=True)
        ]
        waves = spherical_waves(
            user + np.pad(place, (0, 3 - dimensions)),
            positions=positions,
            frequencies=FREQUENCIES,
            planes=elsewhere,
            paths=paths,
            gains=gains * (1 + relative[::2] + 1j * relative[1::2]),
        )
        late = np.exp(-2j * np.pi * FREQUENCIES / 299792458.0 * clock[0])
        return np.asarray(waves.sum(axis=0) * late)

    return model


@pytest.mark.parametrize(
    ("dimensions", "user", "paths"),
    [
        (2, [0.45, 0.5, 0.0], [()]),
        (2, [0.6, 0.8, 0.0], [(0,)]),
        (2, [0.45, 0.5, 0.0], [(), (0,)]),
        (2, [0.3, 0.1, 0.0], [(0,), (0, 1)]),
        (3, [0.45, 0.5, 0.1], [(), (0,)]),
        (3, [0.3, 0.2, -0.1], [(0,), (0, 1), ()]),
    ],
)
def test_the_bound_is_that_of_the_whole_model_by_brute_force(
    dimensions: int, user: list[float], paths: list[tuple[int, ...]]
) -> None:
    tilt = np.array([0.0, 0.0, 0.3 if dimensions == 3 else 0.0])
    normals = [
        (plane.normal + tilt) / np.linalg.norm(plane.normal + tilt) for plane in (WALL, SIDE)
    ]
    planes = [
        Plane(point=plane.point, normal=normal)
        for plane, normal in zip((WALL, SIDE), normals, strict=True)
    ]
    positions = linear_array() if dimensions == 2 else planar_array()
    place, snr = np.array(user), 100.0
    gains = np.array([1.0, -0.8, 0.5j])[: len(paths)]
    inputs = dimensions * len(planes)
    turns = [*[np.radians(0.02)] * (dimensions - 1), 2e-5] * len(planes)
    spread = np.random.default_rng(1).standard_normal((inputs, inputs)) / np.sqrt(inputs)
    covariance = (np.eye(inputs) + 0.5 * spread @ spread.T) * np.outer(turns, turns)
    clock = 1e-13
    bound = position_error_bound(
        place,
        positions=positions,
        frequencies=FREQUENCIES,
        snr=snr,
        planes=planes,
        paths=paths,
        waves=spherical_waves(
            place,
            positions=positions,
            frequencies=FREQUENCIES,
            planes=planes,
            paths=paths,
            gains=gains,
        ),
        dimensions=dimensions,
        plane_covariance=covariance,
        clock_deviation=clock,
    )
    count = dimensions + inputs + 1 + 2 * len(paths)
    prior = np.zeros((count, count))
    at = slice(dimensions, dimensions + inputs)
    prior[at, at] = np.linalg.inv(covariance)
    prior[at.stop, at.stop] = (299792458.0 * clock) ** -2
    model = whole_model(place, planes, paths, gains, positions, dimensions)
    brute = brute_force_bound(model, np.full(count, 1e-7), snr=snr, prior=prior, axes=dimensions)
    scale = np.sqrt(np.diag(brute))
    # The phases turn by k·1e-7 m = 6e-4: the differences err by 1e-7, and the amplitudes' own
    # share, left out in the bound, is below 1e-5; the inverse's condition costs two digits.
    np.testing.assert_allclose(
        bound.covariance / np.outer(scale, scale), brute / np.outer(scale, scale), atol=2e-3
    )


def test_angle_and_length_of_the_older_bound_give_the_same_position() -> None:
    aoa, length, snr = np.radians(70.0), 0.6, 100.0
    positions = linear_array(40)
    polar = cramer_rao_bound(
        aoa=aoa, path_length=length, snr=snr, positions=positions, frequencies=FREQUENCIES
    )
    towards = np.array([np.cos(aoa), np.sin(aoa), 0.0])
    turned = np.array([-np.sin(aoa), np.cos(aoa), 0.0])
    slopes = np.stack([length * turned[:2], towards[:2]], axis=-1)
    flat = spherical_waves(length * towards, positions=positions, frequencies=FREQUENCIES)
    bound = position_error_bound(
        length * towards,
        positions=positions,
        frequencies=FREQUENCIES,
        snr=snr,
        waves=np.asarray(flat * FREQUENCIES),  # that model has no λ in the amplitude
    )
    np.testing.assert_allclose(bound.covariance, slopes @ polar @ slopes.T, rtol=1e-9)


def error_bound(
    *,
    user: tuple[float, float] = (0.5, 1.5),
    elements: int = 40,
    bandwidth: float = 40e9,
    freqs: int = 32,
    snr: float = 100.0,
) -> PositionBound:
    return position_error_bound(
        np.array([*user, 0.0]),
        positions=linear_array(elements),
        frequencies=np.linspace(250e9 - bandwidth / 2, 250e9 + bandwidth / 2, freqs),
        snr=snr,
    )


def along_and_across(bound: PositionBound, user: tuple[float, float]) -> tuple[float, float]:
    towards = np.array(user) / np.hypot(*user)
    across = np.array([-towards[1], towards[0]])
    return (
        float(np.sqrt(towards @ bound.covariance @ towards)),
        float(np.sqrt(across @ bound.covariance @ across)),
    )


def test_the_bound_falls_as_the_root_of_the_signal_to_noise_ratio() -> None:
    assert error_bound(snr=1e4).deviation == pytest.approx(error_bound().deviation / 10, rel=1e-9)


def test_the_bound_falls_as_the_root_of_the_number_of_samples() -> None:
    many, few = error_bound(freqs=4000), error_bound(freqs=1000)
    # The variance of N uniform frequencies is (N+1)/(N-1) of the continuous one: 1e-3.
    assert many.deviation == pytest.approx(few.deviation / 2, rel=2e-3)


def test_range_goes_with_bandwidth_and_cross_range_with_aperture_and_distance() -> None:
    far = (0.0, 20.0)
    along, across = along_and_across(error_bound(user=far), far)
    twice = along_and_across(error_bound(user=far, bandwidth=80e9), far)
    assert twice[0] == pytest.approx(along / 2, rel=0.02)  # λ in the amplitude: (B/2f)²/3 = 0.9 %
    # Twice the aperture with twice the samples: 2^-3/2. 2^-1/2 in range.
    wide = along_and_across(error_bound(user=far, elements=80), far)
    assert wide[1] == pytest.approx(across / 2**1.5, rel=2e-3)  # D² of N elements: 1/N²
    assert wide[0] == pytest.approx(along / 2**0.5, rel=2e-3)
    farther = along_and_across(error_bound(user=(0.0, 40.0)), far)
    assert farther[1] == pytest.approx(2 * across, rel=1e-3)
    assert farther[0] == pytest.approx(along, rel=1e-3)


def test_known_walls_give_the_bound_of_the_image() -> None:
    user = np.array([0.6, 0.8, 0.0])
    image, by_user, _ = image_and_slopes(user, (0,), [WALL])
    bound_of = partial(
        position_error_bound, positions=linear_array(), frequencies=FREQUENCIES, snr=100.0
    )
    unfolded = bound_of(user, planes=[WALL], paths=[(0,)])
    direct = bound_of(image)
    turned = by_user[:2, :2] @ unfolded.covariance @ by_user[:2, :2].T
    np.testing.assert_allclose(turned, direct.covariance, rtol=1e-9)


def test_an_uncertain_wall_adds_its_lever() -> None:
    user, tilt, offset = np.array([0.6, 0.85, 0.0]), np.radians(0.03), 1e-5
    bound_of = partial(
        position_error_bound, positions=linear_array(), frequencies=FREQUENCIES, snr=1e9
    )
    bound = bound_of(
        user, planes=[WALL], paths=[(0,)], plane_covariance=np.diag([tilt**2, offset**2])
    )
    # Without noise the image is known; unfolding turns it by twice the tilt about the wall's point.
    expected = np.hypot(2 * tilt * np.linalg.norm(user - WALL.point), 2 * offset)
    assert bound.deviation == pytest.approx(float(expected), rel=1e-3)


def test_more_knowledge_never_hurts_and_more_paths_neither() -> None:
    user = np.array([0.45, 0.5, 0.0])
    wall = np.diag([np.radians(0.02) ** 2, 2e-5**2])
    bound_of = partial(
        position_error_bound, positions=linear_array(), frequencies=FREQUENCIES, snr=100.0
    )
    over_both = partial(bound_of, planes=[WALL], paths=[(), (0,)])
    known = over_both(
        user,
    ).deviation
    guessed = over_both(
        user,
        plane_covariance=wall,
    ).deviation
    # An unknown wall leaves the direct path; the other one costs no more than its overlap.
    unknown = over_both(
        user,
        plane_covariance=1e6 * wall,
    ).deviation
    assert known < guessed < unknown
    late = over_both(
        user,
        clock_deviation=np.inf,
    ).deviation
    assert late > known
    gains = over_both(
        user,
        gains_known=True,
    ).deviation
    assert gains < known / 5  # the carrier's wavelength is a tenth of c/B and less


def test_a_linear_array_fixes_no_position_in_space() -> None:
    with pytest.raises(ValueError, match="do not fix the position"):
        position_error_bound(
            np.array([0.3, 0.5, 0.2]),
            positions=linear_array(),
            frequencies=FREQUENCIES,
            snr=100.0,
            dimensions=3,
        )


def test_an_unknown_clock_leaves_one_far_path_without_a_position() -> None:
    with pytest.raises(ValueError, match="do not fix the position"):
        position_error_bound(
            np.array([0.0, 1e5, 0.0]),
            positions=linear_array(),
            frequencies=FREQUENCIES,
            snr=100.0,
            clock_deviation=np.inf,
        )


def test_what_does_not_fit_is_refused() -> None:
    bound_of = partial(
        position_error_bound, positions=linear_array(), frequencies=FREQUENCIES, snr=100.0
    )
    user = np.array([0.45, 0.5, 0.0])
    with pytest.raises(ValueError, match="4 dimensions"):
        bound_of(user, dimensions=4)
    waves = spherical_waves(user, positions=linear_array(), frequencies=FREQUENCIES)
    with pytest.raises(ValueError, match="give one for each path"):
        bound_of(user, waves=waves, planes=[WALL], paths=[(), (0,)])
    with pytest.raises(ValueError, match="2 rows for each plane"):
        bound_of(user, planes=[WALL], paths=[(0,)], plane_covariance=np.eye(3))
    leaning = Plane(point=WALL.point, normal=np.array([0.0, -0.6, 0.8]))
    with pytest.raises(ValueError, match="upright"):
        bound_of(user, planes=[leaning], paths=[(0,)])


@pytest.mark.parametrize("over_mirror", [False, True])
def test_the_estimator_reaches_the_bound_at_high_snr(over_mirror: bool) -> None:
    rng = np.random.default_rng(7)
    trials, snr = 400, 1e3
    positions = linear_array(16)
    user = np.array([0.6, 0.8, 0.0]) if over_mirror else np.array([0.2, 0.4, 0.0])
    planes: list[Plane] = [WALL] if over_mirror else []
    paths: list[tuple[int, ...]] = [(0,)] if over_mirror else [()]
    image, by_user, _ = image_and_slopes(user, paths[0], planes)
    clean = point_uplink(image[None], positions=positions, frequencies=FREQUENCIES)
    variance = float(np.mean(np.abs(clean.samples) ** 2)) / snr
    start = np.array([[np.arctan2(image[1], image[0]), np.hypot(*image[:2])]])
    errors = np.empty((trials, 2))
    for trial in range(trials):
        noise = complex_noise(clean.samples.shape, variance, rng)
        noisy = Uplink(
            samples=clean.samples + noise,
            positions=positions,
            frequencies=FREQUENCIES,
            user="user",
        )
        (path,) = refine_paths(noisy, start)
        found = path.path_length * np.array([np.cos(path.aoa), np.sin(path.aoa)])
        # Folding back is a mirroring: its own inverse.
        errors[trial] = by_user[:2, :2].T @ (found - image[:2])
    bound = position_error_bound(
        user,
        positions=positions,
        frequencies=FREQUENCIES,
        snr=snr,
        planes=planes,
        paths=paths,
    )
    squares = np.einsum("ti,ij,tj->t", errors, np.linalg.inv(bound.covariance), errors)
    # χ² of 2 degrees of freedom: a mean of 2, with a deviation of 2/√trials; 4 of them.
    assert squares.mean() == pytest.approx(2.0, abs=4 * 2 / np.sqrt(trials))
    # And the covariance itself, not its size alone: 4 deviations of a variance.
    ratio = errors.var(axis=0) / np.diag(bound.covariance)
    np.testing.assert_allclose(ratio, 1.0, atol=4 * np.sqrt(2 / trials))


def test_the_median_of_an_isotropic_error_is_that_of_rayleigh() -> None:
    bound = PositionBound(covariance=4e-6 * np.eye(2))
    assert bound.median == pytest.approx(2e-3 * np.sqrt(2 * np.log(2)), rel=0.01)  # 0.4 % drawn


SMALL = (
    "base_station.elements=48",
    "radio.points=51",
    "objects.wall.centre_m=[0.0, 0.4]",
    "objects.wall.length_m=0.2",
    "objects.wall.roughness.rms_mm=0.0",
)


def test_the_waves_of_a_scenario_are_what_the_simulator_hears() -> None:
    scene = load_scenario("los_and_nlos_user", (*SMALL, "users.user.position_m=[0.25, 0.37]"))
    scene = scene.model_copy(update={"noise": scene.noise.model_copy(update={"snr_db": np.inf})})
    heard = user_waves(scene, "user")
    assert heard.paths == ((), (0,))
    (uplink,) = simulate(scene, seed=0).measurement.uplinks
    total = heard.waves.sum(axis=0)
    error = np.linalg.norm(uplink.samples - total) / np.linalg.norm(total)
    # Physical optics of a finite wall ripples by its edges: 1/√(2π·Fresnel number) is some 7 %.
    assert error < 0.1


def test_a_scenario_gives_the_bound_of_its_planes_by_hand() -> None:
    scene = load_scenario("slam_2d", (*SMALL, "users.user.position_m=[0.45, 0.4]"))
    wall = np.diag([np.radians(0.01) ** 2, 1e-5**2])
    heard = user_waves(scene, "user")
    by_hand = position_error_bound(
        np.array([0.45, 0.4, 0.0]),
        positions=heard.positions,
        frequencies=heard.frequencies,
        snr=100.0,
        planes=[Plane(point=np.array([0.0, 0.4, 0.0]), normal=WALL.normal)],
        paths=[(0,)],
        waves=heard.waves,
        plane_covariance=wall,
    )
    by_name = scenario_position_bound(scene, "user", wall_covariance={"wall": wall})
    np.testing.assert_allclose(by_name.covariance, by_hand.covariance, rtol=1e-9)
    known = scenario_position_bound(scene, "user")
    assert known.deviation < by_name.deviation
    louder = scenario_position_bound(scene, "user", snr_db=40.0)
    assert louder.deviation == pytest.approx(known.deviation / 10, rel=1e-9)  # 20 dB in the file


def test_a_scenario_without_what_is_asked_for_is_refused() -> None:
    scene = load_scenario("slam_2d", (*SMALL, "users.user.position_m=[0.45, 0.4]"))
    with pytest.raises(ValueError, match="no user 'guest'"):
        user_waves(scene, "guest")
    with pytest.raises(ValueError, match="without noise"):
        scenario_position_bound(scene, "user", snr_db=np.inf)
    with pytest.raises(ValueError, match="names door"):
        scenario_position_bound(scene, "user", wall_covariance={"door": np.eye(2)})
    hidden = load_scenario("slam_2d", (*SMALL, "users.user.position_m=[-0.05, 0.5]"))
    with pytest.raises(ValueError, match="no specular path"):
        user_waves(hidden, "user")
