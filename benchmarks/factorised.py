"""Factorised back-projection against the exact one, on a linear array's echo, in one run.

Run as ``python -m benchmarks.factorised`` (some minutes: the exact image of 4096 x 4096 pixels is
16.8 million pixels times 1000 positions; ``--quick`` takes 1024 x 1024).
"""

import argparse
import time
from collections.abc import Callable
from functools import partial

import numpy as np

from benchmarks.backprojection import decibels, echo_of_targets
from estimator.compute import engine
from estimator.imaging.backprojection import backproject
from estimator.imaging.factorised import factorised_backproject
from estimator.measurement.model import Echo
from estimator.results.pixel_grid import PixelGrid

SIDE, NEAREST = 1.0, 0.55  # of the square that is imaged, in front of half a metre of array [m]
ERRORS = (1e-2, 1e-3, 1e-4)


def measured(run: Callable[[], np.ndarray]) -> tuple[np.ndarray, float, float]:
    """Return what a program gives, its time, and that of all its threads."""
    wall, processor = time.perf_counter(), time.process_time()
    image = run()
    return image, time.perf_counter() - wall, time.process_time() - processor


def square(pixels: int) -> PixelGrid:
    """Lay pixels over the square."""
    axis = np.linspace(0.0, SIDE, pixels)
    return PixelGrid.plane(x=axis - SIDE / 2, y=NEAREST + axis)


def compare(echo: Echo, pixels: int) -> None:
    """Print time and error of each program."""
    points = square(pixels).points
    few = square(256).points
    for warm in (backproject, factorised_backproject):
        warm(echo, few)  # compiles
    exact, wall, processor = measured(partial(backproject, echo, points))
    print(
        f"{len(echo.positions)} x {echo.frequencies.size} samples onto {pixels} x {pixels} pixels"
    )
    print(f"  exact                {wall:8.2f} s  {processor:8.2f} CPU s")
    for error in ERRORS:
        run = partial(factorised_backproject, echo, points, error=error)
        image, faster, less = measured(run)
        image -= exact
        print(
            f"  factorised to {20 * np.log10(error):4.0f} dB {faster:8.2f} s  {less:8.2f} CPU s: "
            f"{wall / faster:5.1f} x as fast, {processor / less:5.1f} x in CPU time, "
            f"error {decibels(image, exact):6.1f} dB"
        )


def main() -> None:
    """Compare on a small and a large image."""
    parser = argparse.ArgumentParser(description=main.__doc__)
    parser.add_argument("--quick", action="store_true", help="1024 x 1024 pixels")
    quick = parser.parse_args().quick
    print(f"backend {engine.backend()}, {engine.thread_count()} threads")
    compare(echo_of_targets(260, 1001), 1024)
    if not quick:
        compare(echo_of_targets(1000, 4096), 4096)


if __name__ == "__main__":
    main()
