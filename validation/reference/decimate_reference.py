"""Make ``rough_wall_decimated.npz`` from the full-wave reference ``rough_wall_full_wave.npz``.

    python validation/reference/decimate_reference.py rough_wall_full_wave.npz

Every 10th position and every 10th frequency are kept, and the whole wall profile.
"""

import sys
from pathlib import Path

import numpy as np

EVERY = 10


def main() -> None:
    """Decimate the file named on the command line."""
    with np.load(Path(sys.argv[1]), allow_pickle=False) as archive:
        arrays = {name: archive[name] for name in archive.files}
    for name in ("echo", "uplink_isotropic", "uplink_beam"):
        arrays[name] = arrays[name][::EVERY, ::EVERY]
    arrays["aperture_position"] = arrays["aperture_position"][::EVERY]
    arrays["frequency"] = arrays["frequency"][::EVERY]
    np.savez_compressed(Path(__file__).with_name("rough_wall_decimated.npz"), **arrays)


if __name__ == "__main__":
    main()
