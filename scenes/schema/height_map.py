"""Measured heights of a surface: a profile or a map from CSV, npz or TIFF."""

from dataclasses import dataclass
from functools import cached_property, lru_cache
from pathlib import Path
from zipfile import ZipFile

import numpy as np
from jaxtyping import Float

from scenes.schema.errors import ScenarioError, shown_text

LARGEST_FILE = 2**30
"""Largest file of heights that is read, packed or unpacked. [byte]"""

MOST_HEIGHTS = 2**27
"""Most heights of a file: 1 GiB in double precision. [-]"""

FEWEST_HEIGHTS = 16
"""Fewest heights along each direction that a spline and a correlation are made of. [-]"""

EVEN = 1e-3
"""Largest difference of a profile's steps, over their mean. [-]"""


@dataclass(frozen=True, eq=False)
class HeightMap:
    """Heights of a surface over its mean plane, which has been subtracted."""

    heights: Float[np.ndarray, "first second"]  # a profile's second direction has length 1 [m]
    step: float  # between neighbours, in both directions [m]

    @property
    def profile(self) -> bool:
        """Whether there is a single line of heights."""
        return bool(self.heights.shape[1] == 1)

    @cached_property
    def rms(self) -> float:
        """Root mean square of the heights [m]."""
        return float(np.sqrt(np.mean(self.heights**2)))

    @cached_property
    def correlation_length(self) -> float:
        """Distance at which the correlation along the first direction has fallen to 1/e [m]."""
        count = len(self.heights)
        waves = np.fft.rfft(self.heights, n=2 * count, axis=0)
        overlap = np.fft.irfft((np.abs(waves) ** 2).sum(axis=1), n=2 * count)[: count // 2]
        correlation = overlap / np.arange(count, count - count // 2, -1)
        below = np.flatnonzero(correlation < correlation[0] / np.e)
        if below.size == 0:
            return self.step * (count // 2)
        last = int(below[0])
        high, low = correlation[last - 1 : last + 1] / correlation[0]
        return float(self.step * (last - 1 + (high - 1 / np.e) / (high - low)))

    def slope_share(self, width: float) -> float:
        """Share of slope variance left after smoothing by a Gaussian of that width [m]. [-]."""
        first, second = (
            2 * np.pi * np.fft.fftfreq(count, self.step) for count in self.heights.shape
        )
        squared = first[:, None] ** 2 + second**2
        taper = np.hanning(len(first))[:, None] * (1.0 if self.profile else np.hanning(len(second)))
        density = squared * np.abs(np.fft.fft2(self.heights * taper)) ** 2
        return float((density * np.exp(-squared * width**2)).sum() / density.sum())


def read_height_map(path: Path, *, step: float | None, unit: float) -> HeightMap:
    """Read measured heights; a mean plane is taken out.

    Parameters
    ----------
    path
        ``.csv``: one column of heights, two columns (place, height), or a matrix; ``.npz``: the
        array ``heights`` and, if not given otherwise, ``step``; ``.tif``/``.tiff``: one page.
    step
        Distance of neighbouring heights; None: the file tells it. [m]
    unit
        What a 1 in the file stands for, heights and places. [m]

    Raises
    ------
    ScenarioError
        If the file cannot be read or holds no such heights; the message names value and remedy.
    """
    try:
        status = path.stat()
    except (OSError, ValueError) as error:  # a ValueError: a null character in the name
        told = error.strerror if isinstance(error, OSError) else error
        raise ScenarioError(f"{shown_text(str(path))}: cannot be read ({told})") from None
    if not path.is_file() or status.st_size > LARGEST_FILE:
        raise ScenarioError(
            f"{path}: a file of at most {LARGEST_FILE} bytes is needed, this has {status.st_size}; "
            "cut out a part"
        )
    return _read(path, step, unit, status.st_mtime_ns)


@lru_cache(maxsize=8)
def _read(path: Path, step: float | None, unit: float, changed: int) -> HeightMap:
    kind = path.suffix.lower()
    if kind == ".csv":
        values, own_step = _csv(path)
    elif kind == ".npz":
        values, own_step = _npz(path)
    elif kind in (".tif", ".tiff"):
        values, own_step = _tiff(path), None
    else:
        raise ScenarioError(f"{path}: must end in .csv, .npz, .tif or .tiff; convert it")
    step = step if step is not None else None if own_step is None else own_step * unit
    if step is None:
        raise ScenarioError(f"{path}: holds no distance of its heights; give step_mm")
    values = values.reshape(len(values), -1)
    if values.shape[0] == 1:
        values = values.T
    shape = values.shape
    if not np.all(np.isfinite(values)):
        raise ScenarioError(f"{path}: {int((~np.isfinite(values)).sum())} heights are no numbers; "
                            "fill them in")  # fmt: skip
    if min(n for n in shape if n > 1 or shape == (1, 1)) < FEWEST_HEIGHTS:
        raise ScenarioError(
            f"{path}: {shape[0]} x {shape[1]} heights, fewer than {FEWEST_HEIGHTS} along a "
            "direction; measure more"
        )
    if values.size > MOST_HEIGHTS:
        raise ScenarioError(
            f"{path}: {values.size:.3g} heights, more than {MOST_HEIGHTS:.3g}; cut out a part"
        )
    made = HeightMap(_levelled(values * unit), step)
    if made.rms == 0:
        raise ScenarioError(f"{path}: all heights lie in one plane; leave roughness out")
    return made


def _csv(path: Path) -> tuple[np.ndarray, float | None]:
    try:
        with path.open(encoding="utf-8") as lines:
            head = lines.readline()
            named = any(sign.isalpha() for sign in head.replace("e", "").replace("E", ""))
            rows = [line for line in ([] if named else [head]) + list(lines) if line.strip()]
        if not rows:
            raise ValueError("it holds no row of numbers")
        values = np.loadtxt(rows, delimiter=",", ndmin=2)
        if values.size == 0:
            raise ValueError("its rows hold no numbers")
    except (OSError, UnicodeDecodeError, ValueError) as error:
        raise ScenarioError(
            f"{path}: no table of numbers with commas ({shown_text(str(error))})"
        ) from None
    if values.shape[1] != 2:
        return values, None
    steps = np.diff(values[:, 0])
    if len(steps) == 0 or not steps.mean() > 0 or np.ptp(steps) > EVEN * steps.mean():
        raise ScenarioError(
            f"{path}: places (first column) must rise in equal steps, within {EVEN:g} of their "
            "mean; resample the profile"
        )
    return values[:, 1:], float(steps.mean())


def _npz(path: Path) -> tuple[np.ndarray, float | None]:
    try:
        with ZipFile(path) as packed:
            promised = sum(entry.file_size for entry in packed.infolist())
        if promised > LARGEST_FILE:
            raise ScenarioError(f"{path}: {promised} bytes unpacked; cut out a part")
        with np.load(path, allow_pickle=False) as arrays:
            if "heights" not in arrays:
                raise ScenarioError(
                    f"{path}: holds {', '.join(arrays) or 'nothing'} and no array 'heights'; "
                    "rename it"
                )
            values = np.asarray(arrays["heights"], dtype=np.float64)
            step = float(arrays["step"]) if "step" in arrays else None
    except ScenarioError:
        raise
    except Exception as error:  # zip, codecs and NumPy fail in many ways on a damaged file
        told = shown_text(str(error))
        raise ScenarioError(f"{path}: cannot be read as npz ({told})") from None
    if values.ndim not in (1, 2):
        raise ScenarioError(f"{path}: 'heights' has {values.ndim} dimensions; give 1 or 2")
    return values, step


def _tiff(path: Path) -> np.ndarray:
    from PIL import Image

    try:
        with Image.open(path) as image:
            if len(image.getbands()) != 1:
                raise ScenarioError(
                    f"{path}: a picture of {len(image.getbands())} colours, no height map; export "
                    "heights as one channel"
                )
            if image.width * image.height > MOST_HEIGHTS:
                raise ScenarioError(
                    f"{path}: {image.width} x {image.height} heights, more than "
                    f"{MOST_HEIGHTS:.3g}; cut out a part"
                )
            return np.asarray(image, dtype=np.float64)
    except ScenarioError:
        raise
    except Exception as error:  # Pillow fails in many ways on a damaged file
        told = shown_text(str(error))
        raise ScenarioError(f"{path}: cannot be read as TIFF ({told})") from None


def _levelled(heights: np.ndarray) -> np.ndarray:
    """Subtract the least-squares plane from the heights [m]."""
    first, second = (np.arange(n) - (n - 1) / 2 for n in heights.shape)
    level = heights - heights.mean()
    for along, axis in ((first[:, None], 0), (second[None, :], 1)):
        if heights.shape[axis] > 1:
            level = level - along * (level * along).sum() / (along**2 * np.ones_like(level)).sum()
    return np.asarray(level)
