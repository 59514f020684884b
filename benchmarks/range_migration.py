"""Range migration against back-projection and against the bare FFTs of its size.

Run as ``python -m benchmarks.range_migration``.
"""

import resource
import time
from collections.abc import Callable

import numpy as np
import scipy.fft
from scipy.constants import speed_of_light

from benchmarks.backprojection import decibels, echo_of_targets, fastest
from estimator.channel.angle_range_map_2d import angle_range_map
from estimator.compute import engine
from estimator.imaging.backprojection import backproject
from estimator.imaging.wavenumber import range_migration
from estimator.measurement.model import Echo, Uplink
from estimator.results.pixel_grid import PixelGrid


def linear() -> None:
    """260 x 1001 samples onto 601 x 601 pixels."""
    echo = echo_of_targets(260, 1001)
    grid = PixelGrid.spanning(x=(-0.3, 0.3), y=(0.4, 1.0), spacing=1e-3)
    points = grid.points
    sizes: list[tuple[tuple[int, ...], tuple[int, ...], int]] = []
    ffts = {name: getattr(scipy.fft, name) for name in ("fft", "ifft")}

    def recorded(name: str):  # type: ignore[no-untyped-def]  # takes any function of SciPy's
        def call(x, n=None, axis=-1, **options):  # type: ignore[no-untyped-def]  # like it
            result = ffts[name](x, n=n, axis=axis, **options)
            sizes.append((x.shape, result.shape, axis))
            return result

        return call

    for name in ffts:
        setattr(scipy.fft, name, recorded(name))
    range_migration.range_migration(echo, grid)
    for name, original in ffts.items():
        setattr(scipy.fft, name, original)
    arrays = [
        (np.ones(before, dtype=np.complex64), after[axis], axis) for before, after, axis in sizes
    ]

    def bare() -> None:
        for array, length, axis in arrays:
            scipy.fft.fft(array, n=length, axis=axis, workers=-1)

    times = fastest(
        {
            "back-projection": lambda: backproject(echo, points),
            "range migration": lambda: range_migration.range_migration(echo, grid),
            "its FFTs alone": bare,
        }
    )
    print("260 x 1001 samples onto 601 x 601 pixels")
    for name, seconds in times.items():
        print(f"  {name:20s} {1e3 * seconds:8.1f} ms")
    migration = times["range migration"]
    print(f"  back-projection / range migration: {times['back-projection'] / migration:.2f}")
    print(f"  range migration / its FFTs:        {migration / times['its FFTs alone']:.2f}")
    reference = backproject(echo, points)
    image = range_migration.range_migration(echo, grid)
    sine = np.abs(points[..., 0]) / np.linalg.norm(points, axis=-1)
    sampled = sine < speed_of_light / 295e9 / (4 * 0.5e-3)
    print(f"  difference where sampled: {decibels((image - reference)[sampled], reference):.1f} dB")


def lab() -> None:
    """Time the lab's 5500 points against 1001: the pixels should be the work."""
    print("260 positions, image 1000 x 1000 and angle/range map 1000 x 2000")
    grid = PixelGrid.plane(x=np.linspace(-0.5, 0.5, 1000), y=np.linspace(0.3, 1.15, 1000))
    points = grid.points
    aoa, lengths = np.linspace(0.5, 2.6, 1000), np.linspace(0.5, 2.5, 2000)
    runs: dict[str, Callable[[], object]] = {}
    for freqs in (1001, 5500):
        echo = echo_of_targets(260, freqs, stop=329.98e9)
        uplink = Uplink(
            samples=echo.samples,
            positions=echo.positions,
            frequencies=echo.frequencies,
            user="user",
        )

        def both(echo: Echo = echo, uplink: Uplink = uplink) -> None:
            backproject(echo, points)
            angle_range_map(uplink, aoa=aoa, path_length=lengths)

        runs[f"{freqs} points"] = both
    times = fastest(runs, repeats=3)
    for name, seconds in times.items():
        print(f"  {name:12s} {seconds:7.3f} s")
    print(f"  ratio {times['5500 points'] / times['1001 points']:.2f}")


def planar() -> None:
    """Image with a planar 128 x 128 aperture, 201 frequencies, onto 128 x 128 x 128 voxels."""
    x, z = np.meshgrid(np.arange(128), np.arange(128), indexing="ij")
    positions = np.stack([x.ravel(), np.zeros(x.size), z.ravel()], axis=1) * 1e-3
    positions -= positions.mean(axis=0)
    frequencies = np.linspace(220e9, 295e9, 201)
    grid = PixelGrid.volume(
        x=np.linspace(-0.0635, 0.0635, 128),
        y=np.linspace(0.28, 0.34, 128),
        z=np.linspace(-0.0635, 0.0635, 128),
    )
    target = grid.points[74, 64, 43]
    distance = np.linalg.norm(target - positions, axis=1)
    turns = np.outer(2 * distance / speed_of_light, frequencies)
    echo = Echo(samples=np.exp(-2j * np.pi * turns), positions=positions, frequencies=frequencies)
    for attempt in ("first", "second"):
        begin = time.perf_counter()
        image = range_migration.range_migration(echo, grid)
        seconds = time.perf_counter() - begin
        print(f"128 x 128 x 201 samples onto 128^3 voxels, {attempt}: {seconds:.2f} s")
    place = np.unravel_index(int(np.abs(image).argmax()), image.shape)
    print(f"  peak {np.abs(image).max():.3f} at {grid.points[place]}, target at {target}")
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"  largest resident size of this process: {peak:.2f} GiB")


if __name__ == "__main__":
    print(f"backend {engine.backend()}, {engine.thread_count()} threads")
    planar()
    linear()
    lab()
