"""Touchstone files: read one by scikit-rf, or write one.

scikit-rf's ``Touchstone`` is used, never its ``Network``: given a file that is no Touchstone,
``Network`` tries to unpickle it, and a pickle runs whatever its author wrote.
"""

import io
import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Complex, Float

from estimator.measurement.model import MeasurementError

SUFFIX = re.compile(r"\.(s[1-9]\d?p|ts)$", re.IGNORECASE)
"""Of files that hold S-parameters."""

LARGEST_FILE = 2**30
"""Largest Touchstone file that is read [byte]."""

MOST_PORTS = 99
"""Of a file. A few bytes that promise more ports than a machine has would fill the memory."""

_PORTS = re.compile(r"^\s*\[number of ports\]\s*(\d+)", re.IGNORECASE | re.MULTILINE)
_SIGNS_OF_BINARY = b"\0"
_NOISE_COLUMNS = 5


@dataclass(frozen=True, kw_only=True)
class Sweep:
    """The S-parameters of one Touchstone file."""

    frequencies: Float[np.ndarray, " freqs"]  # [Hz]
    samples: Complex[np.ndarray, "freqs ports ports"]  # [i, j]: into port j + 1, out of i + 1 [-]
    ends_with_newline: bool  # False: the writer was odd, or the file was cut


def read_touchstone(path: Path) -> Sweep:
    """Read a Touchstone file of S-parameters, version 1 or 2.

    Raises
    ------
    MeasurementError
        If it cannot be read, is truncated, holds other parameters than S, or no finite numbers.
    """
    from skrf.io.touchstone import (  # type: ignore[import-untyped]  # takes a second
        Touchstone,
    )

    text = _text(path)
    ports = _PORTS.search(text)
    if SUFFIX.search(path.name) is None or (ports and int(ports[1]) > MOST_PORTS):
        raise MeasurementError(
            f"{path}: not a Touchstone file of 1…{MOST_PORTS} ports (.s1p … .s{MOST_PORTS}p, .ts); "
            "give the sweep that the instrument exported"
        )
    try:
        found = Touchstone(_Named(text, str(path)))
    # What scikit-rf raises for damaged files is not documented: values, keys, indices, types.
    except Exception as error:
        raise _damaged(path, str(error).splitlines()[0] if str(error) else "") from error
    frequencies = np.asarray(found.f, dtype=np.float64)
    if found.parameter != "s":
        raise MeasurementError(
            f"{path}: holds {str(found.parameter).upper()}-parameters; export S-parameters"
        )
    if frequencies.size == 0:
        raise _damaged(path, "there is no line of data")
    if found.frequency_nb not in (None, frequencies.size):
        raise _damaged(
            path, f"it announces {found.frequency_nb} frequencies and holds {frequencies.size}"
        )
    # scikit-rf takes what follows a falling frequency for the noise data of a two-port.
    if found.noise is not None and found.noise.shape[1] != _NOISE_COLUMNS:
        raise MeasurementError(
            f"{path}: the frequency falls after {frequencies[-1]:.9g} Hz; sort the sweep"
        )
    samples = np.asarray(found.s, dtype=np.complex128)
    bad = ~(np.isfinite(frequencies) & np.isfinite(samples).all(axis=(1, 2)))
    if bad.any():
        raise MeasurementError(
            f"{path}: point {int(np.argmax(bad))} ({frequencies[np.argmax(bad)]:.9g} Hz) holds NaN "
            "or infinity; measure again, or remove that point from every file"
        )
    return Sweep(
        frequencies=frequencies, samples=samples, ends_with_newline=text.endswith(("\n", "\r"))
    )


def touchstone_text(
    frequencies: Float[np.ndarray, " freqs"],
    samples: Complex[np.ndarray, " freqs"],
    *,
    ports: int,
    comment: str,
) -> str:
    """Write one S-parameter as Touchstone 1.1 that loses no bit.

    Parameters
    ----------
    frequencies
        Frequencies. [Hz]
    samples
        S11 of one port, or S21 of two; then S12 is the same, and S11 and S22 are 0. [-]
    ports
        1 or 2.
    comment
        First line of the file.
    """
    if ports == 1:
        columns = [samples]
    else:  # version 1 orders a two-port S11 S21 S12 S22
        nothing = np.zeros_like(samples)
        columns = [nothing, samples, samples, nothing]
    rows = np.column_stack([frequencies, *(part for s in columns for part in (s.real, s.imag))])
    lines = [f"! {comment}", "# Hz S RI R 50"]
    lines += [" ".join(map(repr, row)) for row in rows.tolist()]
    return "\n".join(lines) + "\n"


class _Named(io.StringIO):
    """A text with the name of its file, from whose suffix scikit-rf takes the number of ports."""

    def __init__(self, text: str, name: str) -> None:
        super().__init__(text)
        self.name = name


def _text(path: Path) -> str:
    try:
        if path.stat().st_size > LARGEST_FILE:
            raise MeasurementError(
                f"{path}: {path.stat().st_size} bytes are more than a Touchstone file's "
                f"{LARGEST_FILE}; is it another file?"
            )
        if not path.is_file():
            raise MeasurementError(f"{path}: not a file; give a Touchstone file")
        content = path.read_bytes()
    except OSError as error:
        raise MeasurementError(f"{path}: cannot be read ({error.strerror})") from None
    if _SIGNS_OF_BINARY in content:
        raise MeasurementError(
            f"{path}: not a text file; Touchstone files are text, export the sweep again"
        )
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError:  # instruments write degrees and micro signs in their own way
        return content.decode("latin-1")


def _damaged(path: Path, reason: str) -> MeasurementError:
    return MeasurementError(
        f"{path}: not a whole Touchstone file{f' ({reason})' if reason else ''}; it may be "
        "truncated or of another kind: export it again"
    )
