"""What made a result: the versions of the packages and a digest of our own code.

Two samples belong into one dataset only if both were made by the same.
"""

import functools
import hashlib
from collections.abc import Sequence
from importlib.metadata import PackageNotFoundError, version
from importlib.resources import files
from importlib.resources.abc import Traversable

PACKAGES = (
    "mmslam",
    "drjit",
    "finufft",
    "mitsuba",
    "numpy",
    "scipy",
    "sionna-rt",
    "trimesh",
)
"""Those whose version may change a simulated sample."""


@functools.cache
def package_versions() -> dict[str, str]:
    """Return the versions of :data:`PACKAGES`; an empty one where a package is not installed."""
    found = {}
    for package in PACKAGES:
        try:
            found[package] = version(package)
        except PackageNotFoundError:
            found[package] = ""
    return found


@functools.cache
def code_digest(
    packages: tuple[str, ...] = ("scenes", "simulator"), endings: tuple[str, ...] = (".py",)
) -> str:
    """Return a digest of all Python code of some of our packages: between releases it changes too.

    Parameters
    ----------
    packages
        Their names.
    endings
        Of the files that count: code alone, or data that lie beside it as well.
    """
    digest = hashlib.sha256()
    for package in packages:
        for name, content in sorted(_contents(files(package), package, endings)):
            digest.update(f"{name}\0{len(content)}\0".encode())
            digest.update(content)
    return digest.hexdigest()[:16]


def _contents(
    folder: Traversable, path: str, endings: tuple[str, ...]
) -> Sequence[tuple[str, bytes]]:
    found: list[tuple[str, bytes]] = []
    for entry in folder.iterdir():
        if entry.is_dir():
            found += _contents(entry, f"{path}/{entry.name}", endings)
        elif entry.name.endswith(endings):
            # Line ends differ between checkouts of one version.
            found.append((f"{path}/{entry.name}", entry.read_bytes().replace(b"\r\n", b"\n")))
    return found
