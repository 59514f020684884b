"""GSSI's .DZT files of ground-penetrating radar: a header for each channel, then the scans.

The offsets are those that the open reader ``readgssi`` takes (little-endian):
0 tag, 2 offset of the data, 4 samples a scan, 6 bits, 14 scans a metre, 22 position and 26 range
[ns], 52 channels, 54 permittivity. The range is taken for that of `samples` steps (some programs
take one less: 0.2 % of the delay at 512 samples).
"""

import struct
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from estimator.measurement.model import MeasurementError

HEADER = 1024
"""Of a channel, and the unit in which the data's offset counts where it is below that [byte]."""

MARKS = 2
"""The first numbers of each scan: a flag and the operator's marks, no signal."""

LARGEST_FILE = 2**31
"""Largest file that is read [byte]."""

_KINDS = {8: "u1", 16: "<u2", 32: "<i4"}
_TAG = 0x00FF


@dataclass(frozen=True, kw_only=True)
class GssiScans:
    """The scans of a file, and what its header says of them."""

    traces: np.ndarray  # [scan, sample], or [scan, channel, sample]; zero is the middle
    time_step: float  # [s]
    first_time: float  # of the first sample [s]
    scans_per_metre: float  # 0: not measured by a wheel
    permittivity: float  # as the operator set it


def read_dzt(path: Path) -> GssiScans:
    """Read the scans of a GSSI file.

    Raises
    ------
    MeasurementError
        If it is not such a file, its header is invalid, or the data end within a scan.
    """
    try:
        size = path.stat().st_size
        with path.open("rb") as stream:
            head = stream.read(HEADER)
    except OSError as error:
        raise MeasurementError(f"{path}: cannot be read ({error.strerror})") from None
    if len(head) < HEADER:
        raise MeasurementError(f"{path}: {size} bytes; a .DZT file has a header of {HEADER}")
    tag, data, samples, bits = struct.unpack_from("<4H", head, 0)
    (per_metre,) = struct.unpack_from("<f", head, 14)
    first, span = struct.unpack_from("<2f", head, 22)
    (channels,) = struct.unpack_from("<H", head, 52)
    (permittivity,) = struct.unpack_from("<f", head, 54)
    if tag & 0xFF != _TAG or bits not in _KINDS or not 2 <= samples or not 1 <= channels <= 16:
        raise MeasurementError(
            f"{path}: not a GSSI .DZT file of 8, 16 or 32 bits (tag {tag:#06x}, {bits} bits, "
            f"{samples} samples a scan, {channels} channels); export it again"
        )
    if not 0 < span < 1e6 or not np.isfinite(first):
        raise MeasurementError(
            f"{path}: its range is {span:g} ns and begins at {first:g} ns; the header is damaged"
        )
    begin = HEADER * (data if data < HEADER else channels)
    scan = samples * channels * bits // 8
    if size > LARGEST_FILE or size <= begin or (size - begin) % scan:
        raise MeasurementError(
            f"{path}: {size - begin} bytes after the header are no whole scans of {scan} bytes "
            f"(at most {LARGEST_FILE}); it may be truncated: copy it again"
        )
    numbers = np.fromfile(path, dtype=_KINDS[bits], offset=begin).reshape(-1, channels, samples)
    traces = numbers.astype(np.float64)
    if bits < 32:  # unsigned, zero in the middle
        traces -= 2 ** (bits - 1)
    if samples > MARKS:
        traces[..., :MARKS] = traces[..., MARKS : MARKS + 1]
    return GssiScans(
        traces=traces[:, 0] if channels == 1 else traces,
        time_step=span / samples * 1e-9,
        first_time=first * 1e-9,
        scans_per_metre=float(per_metre),
        permittivity=float(permittivity),
    )
