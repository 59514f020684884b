"""Reading of TOML files within a size limit; any failure is reported as a ScenarioError."""

import tomllib
from importlib.resources.abc import Traversable
from pathlib import Path
from typing import Any

from scenes.schema.errors import ScenarioError, shown_text

LARGEST_FILE = 10 * 2**20
"""Largest TOML file that is read [byte]."""


def is_file(path: Path) -> bool:
    """Tell whether a file exists; False for names that the file system does not allow."""
    try:
        return path.is_file()
    except (OSError, ValueError):
        return False


def read_toml(source: Traversable, *, name: str, kind: str, remedy: str) -> dict[str, Any]:
    """Read a TOML file.

    Parameters
    ----------
    source
        The file; a pipe or a device is read to the limit and no further.
    name
        What it is called in messages.
    kind
        What it should be, as ``scenario``.
    remedy
        What is to be done if it cannot be read.

    Raises
    ------
    ScenarioError
        If it cannot be read, is too large, or is not valid TOML.
    """
    name = shown_text(name)
    try:
        size = source.stat().st_size if isinstance(source, Path) else 0
        content = b""
        if size <= LARGEST_FILE:
            with source.open("rb") as stream:
                content = stream.read(LARGEST_FILE + 1)
    except OSError as error:
        raise ScenarioError(f"{name}: cannot be read ({error.strerror}); {remedy}") from None
    except ValueError as error:  # a null character in the name
        raise ScenarioError(f"{name}: cannot be read ({error}); {remedy}") from None
    if max(size, len(content)) > LARGEST_FILE:
        raise ScenarioError(
            f"{name}: {max(size, len(content))} bytes are more than a {kind}'s {LARGEST_FILE}; "
            "is it another file?"
        )
    try:
        return tomllib.loads(content.decode())
    except UnicodeDecodeError as error:
        raise ScenarioError(
            f"{name}: not text in UTF-8 (byte {error.start}); is it a TOML file?"
        ) from None
    except ValueError as error:  # a TOMLDecodeError; or a number of more digits than Python takes
        raise ScenarioError(
            f"{name}: not valid TOML: {shown_text(str(error))}; correct it there"
        ) from None
    except RecursionError:
        raise ScenarioError(f"{name}: nested too deeply; is it a {kind}?") from None
