"""Levels of an image as one byte for each pixel: what the eye sees, in a twentieth of the size."""

import base64
import zlib
from typing import Any

import numpy as np
from jaxtyping import Float, Num, UInt8

FLOOR_CODE = 1
"""Of all that is as faint as the floor; 0 is where nothing was imaged."""

PEAK_CODE = 255
"""Of the peak."""


def coded_levels(
    values: Num[np.ndarray, "*grid"],
    axes: dict[str, Float[np.ndarray, " _"]],
    *,
    floor_db: float,
    most: int,
) -> dict[str, Any]:
    """Code the levels of an image or a volume below its peak.

    Parameters
    ----------
    values
        Of the pixels, an axis for each of ``axes``. Exactly 0 is where nothing was imaged.
    axes
        Pixel centres by the axes' names, uniform. [m]
    floor_db
        The lowest level that is told apart, relative to the peak; below 0. [dB]
    most
        Most pixels along an axis; of a finer image, the brightest of each block is kept, so that
        no point is lost.

    Returns
    -------
    ``axes`` (``first`` [m], ``step`` [m], ``count``), ``floor_db``, ``peak_db`` (of the peak, over
    an ideal unit point target) and ``codes``: bytes, the first axis fastest, deflated, in Base64.
    A code c above 0 is the level ``floor_db`` (255 - c) / 254, rounded.

    Examples
    --------
    >>> import numpy as np
    >>> image = np.array([[1.0, 0.1], [0.001, 0.0]])
    >>> axes = {"x": np.array([0.0, 0.1]), "y": np.array([1.0, 1.1])}
    >>> coded = coded_levels(image, axes, floor_db=-40.0, most=600)
    >>> [int(code) for code in zlib.decompress(base64.b64decode(coded["codes"]))]
    [255, 1, 128, 0]
    """
    magnitude: Float[np.ndarray, ...] = np.abs(values)
    laid: dict[str, dict[str, float]] = {}
    for index, (name, axis) in enumerate(axes.items()):
        block = -(-axis.size // most)
        if block > 1:
            starts = np.arange(0, axis.size, block)
            magnitude = np.maximum.reduceat(magnitude, starts, axis=index)
        count = magnitude.shape[index]
        step = float(axis[1] - axis[0]) if axis.size > 1 else 0.0
        laid[name] = {
            "first": float(axis[0]) + 0.5 * (block - 1) * step,
            "step": block * step,
            "count": count,
        }
    peak = float(magnitude.max(initial=0.0))
    codes = _codes(magnitude, peak, floor_db)
    packed = zlib.compress(np.asfortranarray(codes).tobytes(order="F"), 9)
    return {
        "axes": laid,
        "floor_db": floor_db,
        "peak_db": 20 * float(np.log10(peak)) if peak > 0 else None,
        "codes": base64.b64encode(packed).decode("ascii"),
    }


def _codes(
    magnitude: Float[np.ndarray, "*grid"], peak: float, floor_db: float
) -> UInt8[np.ndarray, "*grid"]:
    """Return the codes of levels relative to a peak."""
    if peak == 0:
        return np.zeros(magnitude.shape, dtype=np.uint8)
    tiny = 10 ** (floor_db / 20)
    levels = 20 * np.log10(np.maximum(magnitude / peak, tiny))
    scaled = PEAK_CODE - (PEAK_CODE - FLOOR_CODE) * levels / floor_db
    codes = np.rint(scaled).astype(np.uint8)
    codes[magnitude == 0] = 0
    return codes
