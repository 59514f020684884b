"""Provenance of a result: versions of packages and a digest of our own code.

Samples may be in one dataset only if these agree.
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
"""Packages whose version may change a simulated sample."""


@functools.cache
def package_versions() -> dict[str, str]:
    """Return the versions of :data:`PACKAGES`; empty if a package is not installed."""
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
    """Return a digest of the Python code of some packages, which may change between releases.

    Parameters
    ----------
    packages
        Their names.
    endings
        File name endings to include: code alone, or also data files of the packages.
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
