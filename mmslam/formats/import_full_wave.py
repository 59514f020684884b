"""Import full-wave reference data: one .npz of plain arrays becomes a measurement and its truth.

The arrays are ``echo`` (positions, frequencies), any number of ``uplink_…`` of that shape,
``aperture_position`` (positions, 3) [m], ``frequency`` [Hz]; if known, ``user_position`` [m]
and ``wall_profile`` (points, 3) [m]. They hold two-dimensional fields of a line source with
the phase exp(-jkr), so the waves are cylindrical, and one clock served both ends.
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import xarray as xr
from jaxtyping import Complex, Float

from estimator.measurement.model import Echo, Measurement, MeasurementError, Uplink, frequency_step
from mmslam.formats.numpy_files import npz_arrays

PREFERRED_UPLINK = "uplink_beam"
USER = "user"
WALL = "wall"


@dataclass(frozen=True, kw_only=True)
class Imported:
    """A measurement and, if the source holds it, the ground truth."""

    measurement: Measurement
    truth: xr.Dataset | None


def import_npz(path: Path, *, uplink: str | None = None) -> Imported:
    """Read a full-wave reference.

    Parameters
    ----------
    path
        The .npz file; pickled objects are refused.
    uplink
        Which of its arrays is the user's pilot; by default ``uplink_beam``, else the first
        ``uplink_…``, else none.

    Raises
    ------
    MeasurementError
        If the file is none of that kind, or an array is missing or has another shape.
    """
    arrays = npz_arrays(path)
    frequencies = _real(path, arrays, "frequency", (None,))
    positions = _real(path, arrays, "aperture_position", (None, 3))
    shape = (len(positions), len(frequencies))
    frequency_step(frequencies)
    chosen = _chosen_uplink(path, arrays, uplink)
    echo = None
    if "echo" in arrays:
        samples = _complex(path, arrays, "echo", shape)
        echo = Echo(samples=samples, positions=positions, frequencies=frequencies)
    pilots: tuple[Uplink, ...] = ()
    if chosen is not None:
        samples = _complex(path, arrays, chosen, shape)
        pilots = (Uplink(samples=samples, positions=positions, frequencies=frequencies, user=USER),)
    measurement = Measurement(
        echo=echo, uplinks=pilots, waves="cylindrical", clock_offset=0.0, scenario=path.stem
    )
    return Imported(measurement=measurement, truth=_truth(path, arrays))


def _truth(path: Path, arrays: dict[str, np.ndarray]) -> xr.Dataset | None:
    variables: dict[str, tuple[tuple[str, str], np.ndarray, dict[str, str]]] = {}
    labels: dict[str, np.ndarray] = {}
    if "user_position" in arrays:
        user = _real(path, arrays, "user_position", (3,))
        variables["user_position"] = (("user", "axis"), user[None], {"units": "m"})
        labels["user"] = np.array([USER], dtype=np.dtypes.StringDType())
    if "wall_profile" in arrays:
        start, end = _mean_line(_real(path, arrays, "wall_profile", (None, 3)))
        variables["wall_start"] = (("wall", "axis"), start[None], {"units": "m"})
        variables["wall_end"] = (("wall", "axis"), end[None], {"units": "m"})
        labels["wall"] = np.array([WALL], dtype=np.dtypes.StringDType())
    if not variables:
        return None
    axis = np.array(["x", "y", "z"], dtype=np.dtypes.StringDType())
    return xr.Dataset(variables, {**labels, "axis": axis})


def _mean_line(
    profile: Float[np.ndarray, "points 3"],
) -> tuple[Float[np.ndarray, " 3"], Float[np.ndarray, " 3"]]:
    """Return the ends of the mean line of a rough profile (its own end points are rough too)."""
    centre = profile.mean(axis=0)
    direction = np.linalg.svd(profile - centre, full_matrices=False)[2][0]
    if direction @ (profile[-1] - profile[0]) < 0:
        direction = -direction
    along = (profile - centre) @ direction
    return centre + along.min() * direction, centre + along.max() * direction


def _chosen_uplink(path: Path, arrays: dict[str, np.ndarray], asked: str | None) -> str | None:
    present = sorted(name for name in arrays if name.startswith("uplink"))
    if asked is None:
        return PREFERRED_UPLINK if PREFERRED_UPLINK in present else next(iter(present), None)
    if asked not in present:
        raise MeasurementError(
            f"{path}: no uplink {asked!r}; there are: {', '.join(present) or 'none'}"
        )
    return asked


def _complex(
    path: Path, arrays: dict[str, np.ndarray], name: str, shape: tuple[int, int]
) -> Complex[np.ndarray, "positions freqs"]:
    values = _of_shape(path, arrays, name, shape)
    if values.dtype.kind != "c":
        raise MeasurementError(f"{path}: {name!r} has type {values.dtype}; it must be complex")
    return values.astype(np.complex128)


def _real(
    path: Path, arrays: dict[str, np.ndarray], name: str, shape: tuple[int | None, ...]
) -> Float[np.ndarray, "..."]:
    values = _of_shape(path, arrays, name, shape)
    if values.dtype.kind not in "iuf" or not np.all(np.isfinite(values)):
        raise MeasurementError(f"{path}: {name!r} must hold finite real numbers")
    return values.astype(np.float64)


def _of_shape(
    path: Path, arrays: dict[str, np.ndarray], name: str, shape: tuple[int | None, ...]
) -> np.ndarray:
    if name not in arrays:
        found = ", ".join(sorted(arrays)) or "nothing"
        raise MeasurementError(f"{path}: array {name!r} is missing (found: {found})")
    values = arrays[name]
    fits = len(values.shape) == len(shape) and all(
        wanted in (None, size) for size, wanted in zip(values.shape, shape, strict=True)
    )
    if not fits or values.size == 0:
        wanted = " x ".join("n" if size is None else str(size) for size in shape)
        raise MeasurementError(
            f"{path}: {name!r} has shape {values.shape}; it must be {wanted}, n at least 1"
        )
    return values
