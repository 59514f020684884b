"""One image of what an echo shows, of an aperture of any shape, on a grid that resolves it."""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Complex
from scipy.constants import speed_of_light

from estimator.array.array_frame import ArrayFrame
from estimator.array.resolution import unaliased_sine
from estimator.array.viewpoint import Viewpoint, viewpoint
from estimator.array.windows import Window, aperture_taper, frequency_taper
from estimator.imaging.energy_region import Box, cells_at, energy_box, focused, middles
from estimator.imaging.factorised import factorised_backproject, suits_factorising
from estimator.imaging.wavenumber.angular_spectrum import angular_spectrum
from estimator.imaging.wavenumber.range_migration import (
    is_lattice,
    range_migration,
    suits_range_migration,
)
from estimator.measurement.model import Echo, Measurement, MeasurementError
from estimator.results.estimate import Image
from estimator.results.pixel_grid import PixelGrid

IMAGE_TAPER = Window(name="taylor", sidelobe_db=-35.0, nearly_equal=5)
"""Over aperture and band where an image is to be looked at: it widens points by 1.2. [-]"""
PIXELS_PER_CELL = 2.0
"""Pixels for each resolution cell. [-]"""
MOST_PIXELS = {2: 2_000_000, 3: 6_000_000}
"""Most pixels of a plane or a volume; the spacing grows beyond. [-]"""
MOST_SUMS = 3e9
"""Pixels times positions up to which the image is back-projected, about ten seconds on two cores;
beyond, range migration forms it where the aperture is a grid, factorised back-projection where it
is a line. [-]"""
FEW = 128
"""Frequencies up to which a planar scan's image is summed frequency by frequency, in little memory:
of few ones range migration interpolates the spectrum badly. Of more it is faster. [-]"""
WIDEST_SINE = 0.95
"""Largest sine of an angle off the array's normal that is imaged beyond its edges. [-]"""
ASIDE = 0.7
"""Sine of an angle off the array's normal up to which the far end of depths that were asked for is
looked at: at 45° it is √2 as far away. [-]"""
UNREFINED = 1.05
"""Spacing over that asked for, up to which nothing is said about it. [-]"""


@dataclass(frozen=True, kw_only=True)
class ImageOptions:
    """What is imaged; what is left ``None`` is chosen by where the energy is."""

    low: tuple[float | None, float | None, float | None] = (None, None, None)  # world [m]
    high: tuple[float | None, float | None, float | None] = (None, None, None)  # world [m]
    pixel: float | None = None  # [m]
    nearest: float | None = None  # range [m]
    farthest: float | None = None  # range [m]


@dataclass(frozen=True, kw_only=True)
class SceneImage:
    """An image, the grid that it was formed on in the array's frame, and what was chosen."""

    image: Image  # in the world's frame
    view: Viewpoint
    echo: Echo  # in the view's frame
    local_grid: PixelGrid
    local_values: Complex[np.ndarray, "x y z"]
    method: str
    notes: tuple[str, ...]


def image_scene(
    measurement: Measurement,
    *,
    options: ImageOptions | None = None,
    window: Window = IMAGE_TAPER,
) -> SceneImage:
    """Form one image of a measurement's echo.

    Parameters
    ----------
    measurement
        With an echo of two positions or more, monostatic or not.
    options
        Region, pixel and ranges; ``None``: all are chosen.
    window
        Over aperture and band.

    Raises
    ------
    MeasurementError
        If there is no echo, or an option leaves nothing to image.
    """
    chosen = options or ImageOptions()
    if measurement.echo is None:
        raise MeasurementError("there is no 'echo' in the measurement: nothing can be imaged")
    refuse_ranges(chosen)
    view = viewpoint(middles(measurement.echo), measurement.boresight)
    echo = in_frame(measurement.echo, view.frame)
    grid, notes = scene_grid(echo, view, chosen)
    values, method = scene_values(echo, grid, window=window)
    middle = np.array([[0.5 * (axis[0] + axis[-1]) for axis in (grid.x, grid.y, grid.z)]])
    near = cells_at(echo, middle)[0]
    told = [view.note] if view.note else []
    world, turned = in_world(values, grid, view.frame)
    if world is None:
        told.append("the image's axes are the array's own: they are not parallel to the world's")
        world, turned = grid, values
    described = ", ".join(
        f"{name} {axis[0]:.4g} … {axis[-1]:.4g} m"
        for name, axis in zip("xyz", (world.x, world.y, world.z), strict=True)
        if axis.size > 1
    )
    told.append(
        f"imaged by {method}: {described}, chosen by where the energy is"
        if options is None
        else f"imaged by {method}: {described}"
    )
    told.append(
        "resolution in the middle of it, along the array's x, y and z: "
        + " × ".join(f"{1e3 * size:.3g}" for size in near[: 2 if view.flat else 3])
        + " mm"
    )
    return SceneImage(
        image=Image(values=turned.reshape(world.shape), grid=world),
        view=view,
        echo=echo,
        local_grid=grid,
        local_values=values,
        method=method,
        notes=(*told, *notes),
    )


def refuse_ranges(options: ImageOptions) -> None:
    """Refuse a pixel or ranges that leave nothing to image.

    Raises
    ------
    MeasurementError
        If one of them is not finite or negative, or the range ends before it begins.
    """
    for name, value in (
        ("pixel", options.pixel),
        ("minimum range", options.nearest),
        ("maximum range", options.farthest),
    ):
        if value is not None and not (np.isfinite(value) and value >= 0):
            raise MeasurementError(f"{name} is {value:g} m; it must be finite and not negative")
    if options.pixel == 0:
        raise MeasurementError("pixel is 0 m; it must be positive")
    near, far = options.nearest or 0.0, options.farthest
    if far is not None and far <= near:
        raise MeasurementError(
            f"maximum range {far:g} m is not beyond the minimum range of {near:g} m"
        )


def in_frame(echo: Echo, frame: ArrayFrame) -> Echo:
    """Return an echo with its positions in a frame."""
    apart = echo.transmit_positions
    return replace(
        echo,
        positions=frame.to_local(echo.positions),
        transmit_positions=None if apart is None else frame.to_local(apart),
    )


def region_of(echo: Echo, view: Viewpoint, options: ImageOptions) -> Box:
    """Find the region that holds the echo's energy, within the depths and ranges asked for."""
    nearest, farthest = options.nearest, options.farthest
    if view.ahead:
        low, high = _local_bounds(view, options)[1]
        if nearest is None and low is not None and low > 0:
            nearest = low
        if farthest is None and high is not None and high > 0:
            sine = min(_unaliased(echo), ASIDE)
            farthest = high / float(np.sqrt(1 - sine**2))
        if nearest is not None and farthest is not None and farthest <= nearest:
            nearest = farthest = None  # refused with the bounds
    return energy_box(
        echo,
        ahead=view.ahead,
        flat=view.flat,
        sine=_unaliased(echo) if view.ahead else 1.0,
        nearest=nearest,
        farthest=farthest,
    )


def _unaliased(echo: Echo) -> float:
    """Return the sine up to which neighbours on the aperture tell directions apart. [-]."""
    places = middles(echo)
    shortest = speed_of_light / float(echo.frequencies[-1])
    sines = [WIDEST_SINE]
    for column in (places[:, 0], places[:, 2]):
        steps = np.diff(np.unique(np.round(column, 6)))
        if steps.size:
            sines.append(unaliased_sine(float(np.median(steps)), shortest))
    return max(min(sines), 0.1)


def _local_bounds(
    view: Viewpoint, options: ImageOptions
) -> list[tuple[float | None, float | None]]:
    """Turn the bounds of the world's axes to those of the array's own."""
    if all(bound is None for bound in (*options.low, *options.high)):
        return [(None, None)] * 3
    axes = view.frame.axes
    if np.abs(np.abs(axes).max(axis=1) - 1).max() > 1e-6:
        raise MeasurementError(
            "region: the array is not parallel to the world's axes, and its image is on its own; "
            "give a minimum and a maximum range instead"
        )
    bounds = []
    for row in axes:
        axis = int(np.argmax(np.abs(row)))
        sign = float(np.sign(row[axis]))
        ends = (options.low[axis], options.high[axis])
        local = [
            None if end is None else sign * (end - float(view.frame.origin[axis])) for end in ends
        ]
        bounds.append((local[0], local[1]) if sign > 0 else (local[1], local[0]))
    return bounds


def _with_bounds(box: Box, view: Viewpoint, options: ImageOptions) -> Box:
    """Replace the bounds that were asked for in the world's frame."""
    low, high = box.low.copy(), box.high.copy()
    for axis, (first, last) in enumerate(_local_bounds(view, options)):
        low[axis] = low[axis] if first is None else first
        high[axis] = high[axis] if last is None else last
    if view.flat:
        low[2] = high[2] = 0.0
    if np.any(high < low):
        raise MeasurementError(
            f"region: from {low.tolist()} to {high.tolist()} m in the array's frame is empty; "
            "give rising bounds"
        )
    return Box(low=low, high=high)


def scene_grid(
    echo: Echo, view: Viewpoint, options: ImageOptions
) -> tuple[PixelGrid, tuple[str, ...]]:
    """Sample what holds the energy at half its finest cell, or as finely as is affordable.

    Parameters
    ----------
    echo
        In the view's frame.
    view, options
        Where the array looks, and what was asked for in the world's frame.

    Returns
    -------
    The grid, in the view's frame, and what is to be said about it.
    """
    box = _with_bounds(region_of(echo, view, options), view, options)
    corners = np.stack(np.meshgrid(*np.stack([box.low, box.high], axis=1)), axis=-1).reshape(-1, 3)
    probes = np.concatenate([box.middle[None], 0.5 * (corners + box.middle)])
    cells = cells_at(echo, probes).min(axis=0)
    wanted = np.full(3, options.pixel) if options.pixel else cells / PIXELS_PER_CELL
    sizes = (box.high - box.low)[: 2 if view.flat else 3]
    wanted = wanted[: len(sizes)]
    count = float(np.prod(np.maximum(sizes / wanted, 1.0)))
    coarser = max(1.0, (count / MOST_PIXELS[len(sizes)]) ** (1 / len(sizes)))
    notes: list[str] = []
    if coarser > UNREFINED:
        notes.append(
            f"pixels are {coarser:.3g} times as large as the resolution asks for, to keep the "
            f"image within {MOST_PIXELS[len(sizes)]:,} pixels; give a smaller region"
        )
    spacing = [float(step * coarser) for step in wanted] + [1.0] * (3 - len(sizes))
    grid = PixelGrid.spanning(
        x=(float(box.low[0]), float(box.high[0])),
        y=(float(box.low[1]), float(box.high[1])),
        z=(float(box.low[2]), float(box.high[2])),
        spacing=(spacing[0], spacing[1], spacing[2]),
    )
    return grid, tuple(notes)


def scene_values(
    echo: Echo, grid: PixelGrid, *, window: Window
) -> tuple[Complex[np.ndarray, "x y z"], str]:
    """Focus an echo on a grid of its own frame.

    Returns
    -------
    The image over all three axes [-], and the name of the method that formed it.
    """
    shape = (grid.x.size, grid.y.size, grid.z.size)
    aperture = aperture_taper(middles(echo), window)
    weights = np.outer(aperture, frequency_taper(echo.frequencies, window))
    if float(np.prod(shape)) * len(echo.positions) > MOST_SUMS:
        planar = float(np.ptp(echo.positions[:, 2])) > 0
        if planar and echo.frequencies.size <= FEW and is_lattice(echo, grid):
            return angular_spectrum(echo, grid, weights=weights), "the angular spectrum"
        if suits_range_migration(echo, grid):
            return range_migration(echo, grid, weights=weights).reshape(shape), "range migration"
        if suits_factorising(echo, grid.points):
            image = factorised_backproject(echo, grid.points, weights=weights)
            return image.reshape(shape), "factorised back-projection"
    return focused(echo, grid.points.reshape(*shape, 3), weights), "back-projection"


def in_world(
    values: Complex[np.ndarray, "x y z"], grid: PixelGrid, frame: ArrayFrame
) -> tuple[PixelGrid | None, Complex[np.ndarray, "..."]]:
    """Turn an image to the world's axes; no grid if the frame's are not parallel to them."""
    axes = frame.axes
    if np.abs(np.abs(axes).max(axis=1) - 1).max() > 1e-6:
        return None, values
    order = [int(np.argmax(np.abs(axes[:, axis]))) for axis in range(3)]
    turned = values.transpose(order)
    places = []
    for axis, local in enumerate(order):
        sign = float(np.sign(axes[local, axis]))
        column = sign * (grid.x, grid.y, grid.z)[local] + frame.origin[axis]
        if sign < 0:
            turned = np.flip(turned, axis)
            column = column[::-1]
        places.append(np.linspace(column[0], column[-1], column.size))
    return PixelGrid(x=places[0], y=places[1], z=places[2]), turned
