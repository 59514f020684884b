"""Back-projection against NumPy and FastSAR, on the same data in one run.

Run as ``python -m benchmarks.backprojection``. FastSAR (``pip install fastsar``; it compiles
its kernel, so a C++ compiler is needed) takes part if it is installed.
"""

import importlib
import time
from collections.abc import Callable
from functools import partial

import numpy as np
from jaxtyping import Complex, Float
from scipy.constants import speed_of_light

from estimator.compute import engine
from estimator.imaging.backprojection import backproject
from estimator.measurement.model import Echo
from estimator.results.pixel_grid import PixelGrid

REPEATS = 7
SUBSET = 200  # pixels that the direct sum is taken on


def echo_of_targets(
    positions: int, freqs: int, *, start: float = 220e9, stop: float = 295e9
) -> Echo:
    """Make the echo of 30 random point targets in front of a linear array, with noise."""
    rng = np.random.default_rng(0)
    array = np.zeros((positions, 3))
    array[:, 0] = (np.arange(positions) - (positions - 1) / 2) * 0.5e-3
    frequencies = np.linspace(start, stop, freqs)
    # Inside the sector that 0.5 mm sample: range migration knows no grating lobes.
    targets = rng.uniform([-0.1, 0.4, 0.0], [0.1, 0.8, 0.0], (30, 3))
    samples = 0.1 * (rng.normal(size=(positions, freqs, 2)) @ np.array([1, 1j]))
    for target in targets:
        delay = 2 * np.linalg.norm(target - array, axis=1) / speed_of_light
        samples += np.exp(-2j * np.pi * delay[:, None] * frequencies)
    return Echo(samples=samples, positions=array, frequencies=frequencies)


def direct_sum(echo: Echo, points: Float[np.ndarray, "points 3"]) -> Complex[np.ndarray, " points"]:
    """Sum all samples at each point in float64, as NumPy does it best: by matrix products."""
    image = np.zeros(len(points), dtype=np.complex128)
    for position, spectrum in zip(echo.positions, echo.samples, strict=True):
        delay = 2 * np.linalg.norm(points - position, axis=1) / speed_of_light
        image += np.exp(2j * np.pi * delay[:, None] * echo.frequencies) @ spectrum
    return image / echo.samples.size


def profile_sum(
    echo: Echo, points: Float[np.ndarray, "*grid 3"], cells_per_sample: int = 16
) -> Complex[np.ndarray, "*grid"]:
    """Back-project in plain NumPy: oversampled range profiles, read by linear interpolation."""
    freqs = echo.frequencies.size
    step = echo.frequencies[1] - echo.frequencies[0]
    length = cells_per_sample * freqs
    profiles = np.fft.ifft(echo.samples, n=length, axis=1) * length
    image = np.zeros(points.shape[:-1], dtype=np.complex128)
    middle = (freqs - 1) / 2
    for position, profile in zip(echo.positions, profiles, strict=True):
        delay = 2 * np.linalg.norm(points - position, axis=-1) / speed_of_light
        place = delay * step * length
        cell = np.arange(length) * (2j * np.pi * middle / length)
        smooth = profile * np.exp(-cell)
        image += np.interp(place, np.arange(length), smooth) * np.exp(
            2j * np.pi * (echo.frequencies[0] + middle * step) * delay
        )
    return image / echo.samples.size


def fastest(runs: dict[str, Callable[[], object]], repeats: int = REPEATS) -> dict[str, float]:
    """Time several programs in turns, so that a busy moment hits all; the fastest counts."""
    best = dict.fromkeys(runs, np.inf)
    for run in runs.values():
        run()  # compiles, plans, fills caches
    for _ in range(repeats):
        for name, run in runs.items():
            begin = time.perf_counter()
            run()
            best[name] = min(best[name], time.perf_counter() - begin)
    return best


def fastsar_former(
    echo: Echo, grid: PixelGrid, interp: str = "linear"
) -> Callable[[], object] | None:
    """Set FastSAR's exact former up with linear interpolation and else its defaults."""
    try:
        fastsar = importlib.import_module("fastsar")  # a tool of this comparison only
    except ImportError:
        return None
    nx, ny = grid.shape
    dx, dy, _ = grid.spacing
    # Its grid counts from the middle pixel (i - nx/2).
    centre = np.array([grid.x[0] + nx / 2 * dx, grid.y[0] + ny / 2 * dy, grid.z[0]])
    former = fastsar.ExactFormer(
        echo.positions,
        echo.frequencies[0],
        echo.frequencies[1] - echo.frequencies[0],
        echo.frequencies.size,
        nx,
        ny,
        dx,
        dy,
        backend="cpu",
        window=False,
        interp=interp,
        ref=np.zeros(len(echo.positions)),
        center=centre,
    )
    samples = echo.samples.astype(np.complex64)
    return lambda: np.asarray(former(samples))


def decibels(
    error: Complex[np.ndarray, "*points"], reference: Complex[np.ndarray, "*points"]
) -> float:
    """Return the largest error over the largest value of the reference [dB]."""
    return float(20 * np.log10(np.abs(error).max() / np.abs(reference).max()))


def compare() -> None:
    """260 x 1001 samples onto 601 x 601 pixels: time and error of each program."""
    echo = echo_of_targets(260, 1001)
    grid = PixelGrid.spanning(x=(-0.3, 0.3), y=(0.4, 1.0), spacing=1e-3)
    points = grid.points
    flat = points.reshape(-1, 3)
    chosen = np.random.default_rng(1).choice(len(flat), SUBSET, replace=False)
    begin = time.perf_counter()
    reference = direct_sum(echo, flat[chosen])
    direct = (time.perf_counter() - begin) * len(flat) / SUBSET
    image = backproject(echo, points)
    runs: dict[str, Callable[[], object]] = {"mmslam": lambda: backproject(echo, points)}
    former = fastsar_former(echo, grid)
    if former is not None:
        runs["FastSAR, linear"] = former
    times = fastest(runs)
    times["NumPy, profiles"] = fastest({"": lambda: profile_sum(echo, points)}, repeats=1)[""]
    times[f"NumPy, direct sum (from {SUBSET} pixels)"] = direct
    print(f"backend {engine.backend()}, {engine.thread_count()} threads")
    print("260 x 1001 samples onto 601 x 601 pixels")
    for name, seconds in times.items():
        print(f"  {name:40s} {seconds:9.3f} s {seconds / times['mmslam']:9.2f} x mmslam")
    peak = np.abs(image).max()
    error = np.abs(image.ravel()[chosen] - reference).max()
    print(f"  mmslam against the direct sum: {20 * np.log10(error / peak):.1f} dB of the peak")
    for interp in ("linear", "cubic") if former is not None else ():
        other_former = fastsar_former(echo, grid, interp)
        assert other_former is not None
        other = np.asarray(other_former())
        # Its normalisation is its own: fit one factor.
        factor = np.vdot(other, image) / np.vdot(other, other)
        error = np.abs(factor * other.ravel()[chosen] - reference).max()
        difference = np.abs(factor * other - image).max()
        print(
            f"  FastSAR {interp} against the direct sum: {20 * np.log10(error / peak):.1f} dB, "
            f"against mmslam: {20 * np.log10(difference / peak):.1f} dB of the peak"
        )


def slopes() -> None:
    """Print how the time grows with pixels, positions and frequencies."""
    print("seconds, doubling one size at a time (slope 1: proportional)")
    base = {"pixels": 301, "positions": 130, "freqs": 1001}
    for size in base:
        row = []
        for factor in (1, 2, 4):
            sizes = dict(base)
            sizes[size] = round(base[size] * (np.sqrt(factor) if size == "pixels" else factor))
            echo = echo_of_targets(sizes["positions"], sizes["freqs"])
            axis = np.linspace(-0.25, 0.25, sizes["pixels"])
            points = PixelGrid.plane(x=axis, y=axis + 0.65).points
            row.append(fastest({"": partial(backproject, echo, points)}, repeats=5)[""])
        slope = np.polyfit(np.log([1, 2, 4]), np.log(row), 1)[0]
        print(f"  {size:10s}" + "".join(f"{t:9.4f}" for t in row) + f"   slope {slope:.2f}")


if __name__ == "__main__":
    compare()
    slopes()
