"""Smoothed MUSIC against pyroomacoustics' MUSIC in near mode, on the same data.

Run as ``python -m benchmarks.music`` with pyroomacoustics installed. Its near mode compares
spherical waves on a polar grid and averages over frequencies, without smoothing: a single
source is a fair case for both, several coherent ones are not.
"""

import importlib
import time

import numpy as np
from scipy.constants import speed_of_light

from estimator.channel.music import music_spectrum
from estimator.channel.relax import refine_paths
from estimator.channel.steering import angle_spectrum
from estimator.measurement.model import Uplink

FREQUENCIES = np.linspace(220e9, 295e9, 65)


def main() -> None:
    """Compare the angle that each finds of one user at 0.4 m and 70°."""
    rng = np.random.default_rng(0)
    positions = np.zeros((64, 3))
    positions[:, 0] = (np.arange(64) - 31.5) * 0.5e-3
    aoa, distance = np.radians(70.0), 0.2
    source = distance * np.array([np.cos(aoa), np.sin(aoa), 0.0])
    length = np.linalg.norm(source - positions, axis=1)
    clean = np.exp(-2j * np.pi * length[:, None] / speed_of_light * FREQUENCIES)
    noise = 0.1 * (rng.normal(size=(*clean.shape, 2)) @ np.array([1, 1j])) / np.sqrt(2)
    uplink = Uplink(samples=clean + noise, positions=positions, frequencies=FREQUENCIES, user="a")
    grid = np.radians(np.arange(65.0, 75.0, 0.02))
    rows: list[tuple[str, float, float]] = []

    def note(name: str, begin: float, angle: float) -> None:
        rows.append((name, np.degrees(angle) - 70.0, time.perf_counter() - begin))

    begin = time.perf_counter()
    spectrum = music_spectrum(uplink, grid, paths=1, towards=aoa, distance=distance)
    note("mmslam, smoothed MUSIC", begin, float(grid[spectrum.argmax()]))
    begin = time.perf_counter()
    (path,) = refine_paths(uplink, np.array([[np.radians(70.2), 0.2005]]))
    note("mmslam, maximum likelihood", begin, path.aoa)
    begin = time.perf_counter()
    single = np.abs(angle_spectrum(uplink, grid, frequency=257.5e9, distance=distance))
    note("mmslam, one frequency", begin, float(grid[single.argmax()]))
    try:
        doa = importlib.import_module("pyroomacoustics.doa")
    except ImportError:
        doa = None
    if doa is not None:
        begin = time.perf_counter()
        # It wants the phase conjugate to exp(+jωt)'s delays handled by an STFT: bins of a
        # transform whose frequencies are ours, and the speed of light for that of sound.
        size = 2048
        rate = size * (FREQUENCIES[1] - FREQUENCIES[0])
        bins = np.rint(FREQUENCIES / (rate / size)).astype(int)
        step = rate / size
        finder = doa.MUSIC(
            positions[:, :2].T,
            rate,
            size,
            c=speed_of_light,
            num_src=1,
            mode="near",
            r=np.array([distance]),
            azimuth=grid,
        )
        # Our sweep does not start at a multiple of its step: shift to the nearest bins.
        shift = np.exp(-2j * np.pi * np.outer(length, bins * step - FREQUENCIES) / speed_of_light)
        stft = np.zeros((64, size // 2 + 1, 1), dtype=complex)
        stft[:, bins, 0] = uplink.samples * shift
        finder.locate_sources(stft, freq_bins=bins)
        note("pyroomacoustics, near MUSIC", begin, float(np.atleast_1d(finder.azimuth_recon)[0]))
    print("one user at 70°, 0.2 m, 20 dB; error of the angle and time")
    for name, error, seconds in rows:
        print(f"  {name:30s} {1e3 * error:8.2f} mdeg {1e3 * seconds:9.1f} ms")


if __name__ == "__main__":
    main()
