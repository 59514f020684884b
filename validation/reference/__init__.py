"""Full-wave reference data, decimated; their origin is described in the README.md beside it."""

from pathlib import Path

ROUGH_WALL = Path(__file__).with_name("rough_wall_decimated.npz")
TWO_CYLINDERS = Path(__file__).with_name("two_cylinders_decimated.npz")
