"""Full-wave reference data, decimated: see README.md beside it for where it comes from."""

from pathlib import Path

ROUGH_WALL = Path(__file__).with_name("rough_wall_decimated.npz")
TWO_CYLINDERS = Path(__file__).with_name("two_cylinders_decimated.npz")
