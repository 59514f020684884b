"""The grid on which images are formed: uniform axes in the world frame."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

UNEVEN = 1e-6
"""Largest departure of an axis from uniform steps, over the step. [-]."""


@dataclass(frozen=True, kw_only=True, eq=False)
class PixelGrid:
    """Pixel centres at every combination of three uniform axes; one z makes it a plane.

    Raises
    ------
    ValueError
        If an axis is empty, not finite, or its steps are not equal and positive.
    """

    x: Float[np.ndarray, " nx"]  # [m]
    y: Float[np.ndarray, " ny"]  # [m]
    z: Float[np.ndarray, " nz"]  # [m]

    def __post_init__(self) -> None:
        """Refuse axes on which no picture could be drawn."""
        for name in ("x", "y", "z"):
            _check_axis(name, getattr(self, name))

    @classmethod
    def plane(
        cls, *, x: Float[np.ndarray, " nx"], y: Float[np.ndarray, " ny"], z: float = 0.0
    ) -> "PixelGrid":
        """Lay a grid of shape (nx, ny) into the plane at height ``z`` [m]."""
        return cls(x=x, y=y, z=np.array([z]))

    @classmethod
    def volume(
        cls,
        *,
        x: Float[np.ndarray, " nx"],
        y: Float[np.ndarray, " ny"],
        z: Float[np.ndarray, " nz"],
    ) -> "PixelGrid":
        """Lay a grid of shape (nx, ny, nz) into space."""
        return cls(x=x, y=y, z=z)

    @classmethod
    def spanning(
        cls,
        *,
        x: tuple[float, float],
        y: tuple[float, float],
        z: tuple[float, float] | float = 0.0,
        spacing: float | tuple[float, float, float],
    ) -> "PixelGrid":
        """Fill a box with pixels, its bounds included.

        Parameters
        ----------
        x, y, z
            First and last pixel centre of each axis; one z makes it a plane. [m]
        spacing
            Largest distance of neighbours, one for all axes or one for each. [m]

        Raises
        ------
        ValueError
            If a bound or the spacing makes no grid.
        """
        spacings = (spacing,) * 3 if isinstance(spacing, int | float) else spacing
        bounds = (x, y, z if isinstance(z, tuple) else (z, z))
        axes = [
            _axis(name, first, last, step)
            for name, (first, last), step in zip("xyz", bounds, spacings, strict=True)
        ]
        return cls(x=axes[0], y=axes[1], z=axes[2])

    @property
    def shape(self) -> tuple[int, ...]:
        """Shape of an image on this grid: (nx, ny) in a plane, else (nx, ny, nz)."""
        shape = (self.x.size, self.y.size, self.z.size)
        return shape[:2] if self.z.size == 1 else shape

    @property
    def points(self) -> Float[np.ndarray, "*grid 3"]:
        """Pixel centres in the world frame, in metres."""
        points = np.stack(np.meshgrid(self.x, self.y, self.z, indexing="ij"), axis=-1)
        return points.reshape(*self.shape, 3)

    @property
    def spacing(self) -> tuple[float, float, float]:
        """Steps of the three axes in metres; 0 where an axis has one pixel."""
        steps = [_step(axis) for axis in (self.x, self.y, self.z)]
        return steps[0], steps[1], steps[2]

    @property
    def extent(self) -> tuple[float, float, float, float]:
        """Outer edges (left, right, bottom, top) of the pixels in x and y, in metres."""
        dx, dy, _ = self.spacing
        return (
            float(self.x[0]) - dx / 2,
            float(self.x[-1]) + dx / 2,
            float(self.y[0]) - dy / 2,
            float(self.y[-1]) + dy / 2,
        )


def _step(axis: Float[np.ndarray, " n"]) -> float:
    return float(axis[-1] - axis[0]) / (axis.size - 1) if axis.size > 1 else 0.0


def _axis(name: str, first: float, last: float, spacing: float) -> Float[np.ndarray, " n"]:
    if not (np.isfinite([first, last, spacing]).all() and spacing > 0 and last >= first):
        raise ValueError(
            f"{name}: bounds {first:g} … {last:g} m with a spacing of {spacing:g} m make no "
            "grid; give rising bounds and a positive spacing"
        )
    # 1e-9: bounds that are a whole number of steps apart must not gain one by rounding.
    steps = int(np.ceil((last - first) / spacing - 1e-9))
    return np.linspace(first, last, max(steps, 0) + 1)


def _check_axis(name: str, axis: Float[np.ndarray, " n"]) -> None:
    if axis.ndim != 1 or axis.size == 0 or not np.all(np.isfinite(axis)):
        raise ValueError(
            f"{name}: a grid axis needs at least one pixel and finite coordinates, in one "
            f"dimension; this one has shape {axis.shape}"
        )
    step = _step(axis)
    steps = np.diff(axis)
    # The second term allows for coordinates rounded far from the origin.
    slack = UNEVEN * abs(step) + 4 * np.spacing(np.abs(axis).max())
    if axis.size > 1 and (step <= 0 or np.any(np.abs(steps - step) > slack)):
        raise ValueError(
            f"{name}: grid steps range from {steps.min():.6g} to {steps.max():.6g} m; they must "
            "be positive and equal (numpy.linspace makes such an axis)"
        )
