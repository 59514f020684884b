"""The command ``image``: a SAR image of a measurement, without a search for walls or users."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure

from estimator.imaging.scene_image import SceneImage, image_scene
from estimator.measurement.model import Measurement as PlainMeasurement
from mmslam import output
from mmslam.measurement import Measurement
from mmslam.measurement_files import read
from mmslam.own_results import FORMAT, IMAGE, IMAGE_PARTS, refuse_foreign_image
from mmslam.plain_text import drawn_plainly, file_name, json_text
from mmslam.region import ANY, Bounds, asked_region
from mmslam.results.estimate import Image
from validation.figures import figures_2d, figures_3d, views

DOTS_PER_INCH = 150


@dataclass(frozen=True, kw_only=True, repr=False)
class FocusedImage(Image):
    """A SAR image of a measurement, with the region, pixel and method chosen to form it."""

    method: str = ""
    notes: tuple[str, ...] = ()


def image(
    measurement: PlainMeasurement,
    *,
    x: Bounds = ANY,
    y: Bounds = ANY,
    z: Bounds = ANY,
    pixel: float | None = None,
    min_range: float | None = None,
    max_range: float | None = None,
) -> FocusedImage:
    """Focus a measurement's echo to an image, and nothing else.

    Positions may lie on a line, in a plane, on a circle or anywhere; transmitters may stand
    apart.

    Parameters
    ----------
    measurement
        A measurement with an echo. Its ground truth, if any, is not used.
    x, y, z
        First and last coordinate of the region, in the world's frame. [m]
    pixel
        Spacing of the pixels; None: half the finest resolution. [m]
    min_range, max_range
        Distances from the positions within which the region is chosen. [m]

    Returns
    -------
    The image. Arguments left None are chosen from where the echo's energy is; its notes say how.

    Raises
    ------
    MeasurementError
        If there is no echo, or nothing is left to image.

    Examples
    --------
    >>> import mmslam
    >>> small = {"base_station.elements": 32, "radio.points": 64}
    >>> measurement = mmslam.simulate(mmslam.load_scenario("point_scatterers", small), seed=1)
    >>> focused = mmslam.image(measurement, y=(0.3, 0.7))
    >>> focused.method, focused.grid.z.size
    ('back-projection', 1)
    """
    seen = measurement.without_truth() if isinstance(measurement, Measurement) else measurement
    options = asked_region(x=x, y=y, z=z, pixel=pixel, near=min_range, far=max_range)
    made: SceneImage = image_scene(seen, options=options)
    return FocusedImage(
        values=made.image.values, grid=made.image.grid, method=made.method, notes=made.notes
    )


def image_to_folder(
    path: Path, *, sample: int | None, folder: Path | None, **asked: Any
) -> tuple[dict[str, Any], Path]:
    """Focus a measurement file and write its image.

    Parameters
    ----------
    path
        The measurement store.
    sample
        Which one of a dataset.
    folder
        Where to; None: ``out/NAME-image``.
    asked
        As :func:`image` takes.

    Returns
    -------
    What ``image.json`` holds, and the folder.
    """
    measurement = read(path, sample=sample)
    folder = folder or Path("out") / f"{file_name(measurement.scenario or path.stem)}-image"
    output.refuse_to_replace_input(folder, path)
    with output.replacing(folder, refuse_foreign_image) as new:
        new.mkdir()
        focused = image(measurement, **asked)
        np.savez(
            new / IMAGE_PARTS[0],
            values=focused.values,
            x=focused.grid.x,
            y=focused.grid.y,
            z=focused.grid.z,
        )
        _save(projections(focused), new / IMAGE_PARTS[1])
        if focused.grid.z.size > 1:
            _save(cuts(focused), new / IMAGE_PARTS[2])
        document = _document(focused)
        (new / IMAGE).write_text(json_text(document) + "\n", encoding="utf-8")
    return document, folder


def image_lines(document: dict[str, Any], folder: Path) -> list[str]:
    """Tell what was imaged in a few lines."""
    place = ", ".join(f"{value:.4f}" for value in document["peak_m"])
    sizes = " × ".join(str(document["pixels"][axis]) for axis in "xyz")
    return [
        f"{sizes} pixels by {document['method']}; brightest at ({place}) m",
        *(f"note: {note}" for note in document["notes"]),
        f"open {folder / IMAGE_PARTS[1]}",
    ]


def projections(focused: Image) -> Figure:
    """Draw a plane; of a volume, its maximum-intensity projections along the three axes."""
    if focused.grid.z.size == 1:
        left, right, bottom, top = focused.grid.extent
        figure = Figure(figsize=(7.5, 6.0), layout="constrained")
        view = views.View(left=left, right=right, bottom=bottom, top=top)
        figures_2d.draw_image(figure.subplots(), focused, view=view)
        return figure
    return _three(focused, "brightest voxel")


def cuts(focused: Image) -> Figure:
    """Draw the three planes through a volume's brightest voxel."""
    place = np.unravel_index(int(np.argmax(np.abs(focused.values))), focused.values.shape)
    figure = Figure(figsize=(15.0, 5.0), layout="constrained")
    axes = (focused.grid.x, focused.grid.y, focused.grid.z)
    box = _box(focused)
    peak = float(np.abs(focused.values).max())
    for ax, view in zip(figure.subplots(1, 3), figures_3d.VIEWS, strict=True):
        cut = np.take(np.abs(focused.values), int(place[view.along]), axis=view.along)
        level = figures_2d.decibels(cut, peak, figures_2d.FLOOR_DB)
        level = level if view.right > view.up else level.T
        right, up = axes[view.right], axes[view.up]
        ax.imshow(
            level,
            origin="lower",
            extent=(right[0], right[-1], up[0], up[-1]),
            cmap="magma",
            vmin=figures_2d.FLOOR_DB,
            vmax=0.0,
        )
        ax.set_xlim(box.low[view.right], box.high[view.right])
        ax.set_ylim(box.low[view.up], box.high[view.up])
        ax.set_xlabel(f"{'xyz'[view.right]} [m]")
        ax.set_ylabel(f"{'xyz'[view.up]} [m]")
        ax.set_title(f"{'xyz'[view.along]} = {axes[view.along][place[view.along]]:.4g} m")
    return figure


def _three(focused: Image, title: str) -> Figure:
    figure = Figure(figsize=(15.0, 5.0), layout="constrained")
    box = _box(focused)
    for ax, view in zip(figure.subplots(1, 3), figures_3d.VIEWS, strict=True):
        figures_3d.draw_projection(ax, focused, view, box, bar=view is figures_3d.SIDE)
    figure.suptitle(title)
    return figure


def _box(focused: Image) -> figures_3d.Box:
    grid = focused.grid
    return figures_3d.Box(
        low=np.array([grid.x[0], grid.y[0], grid.z[0]]),
        high=np.array([grid.x[-1], grid.y[-1], grid.z[-1]]),
    )


def _save(figure: Figure, path: Path) -> None:
    drawn_plainly(figure)
    figure.savefig(path, dpi=DOTS_PER_INCH, format="png", metadata={"Software": None})


def _document(focused: FocusedImage) -> dict[str, Any]:
    grid = focused.grid
    place = np.unravel_index(int(np.argmax(np.abs(focused.values))), focused.values.shape)
    peak = grid.points[place]
    axes = {"x": grid.x, "y": grid.y, "z": grid.z}
    return {
        "format": FORMAT,
        "method": focused.method,
        "pixels": {name: int(axis.size) for name, axis in axes.items()},
        "region_m": {name: [float(axis[0]), float(axis[-1])] for name, axis in axes.items()},
        "spacing_m": dict(zip("xyz", grid.spacing, strict=True)),
        "peak_m": [float(value) for value in peak],
        "peak_db": float(20 * np.log10(max(float(np.abs(focused.values).max()), 1e-300))),
        "notes": list(focused.notes),
    }
