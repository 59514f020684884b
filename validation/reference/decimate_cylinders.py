"""Make ``two_cylinders_decimated.npz`` from the reference ``two_cylinders_full_wave.npz``.

    python validation/reference/decimate_cylinders.py two_cylinders_full_wave.npz

Every 10th position and every 10th frequency are kept, those of ``rough_wall_decimated.npz``,
which also holds the profile of the wall.
"""

import sys
from pathlib import Path

import numpy as np

EVERY = 10


def main() -> None:
    """Decimate the file named on the command line."""
    with np.load(Path(sys.argv[1]), allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files if name != "wall_profile"}
    arrays["echo"] = arrays["echo"][::EVERY, ::EVERY]
    arrays["aperture_position"] = arrays["aperture_position"][::EVERY]
    arrays["frequency"] = arrays["frequency"][::EVERY]
    np.savez_compressed(Path(__file__).with_name("two_cylinders_decimated.npz"), **arrays)


if __name__ == "__main__":
    main()
