"""The one place where Dr.Jit's backend is chosen.

Dr.Jit loads LLVM while it is imported, so :func:`prepare` has to point it to a library
that works before that. On Linux x86-64 the wheel ``karellen-llvm-core`` ships one.
"""

import functools
import importlib
import os
import sys
from pathlib import Path
from types import ModuleType

OLDEST_LLVM = 16  # 15 aborts inside Sionna RT ("Cannot select: fmaximum"), 14 is refused
BACKENDS = ("cuda", "llvm")  # those that Mitsuba has variants for

_LLVM_HELP = (
    f"install LLVM {OLDEST_LLVM} or newer (Linux x86-64: `pip install karellen-llvm-core`; "
    "macOS: `brew install llvm`; else the distribution's libllvm package) or set "
    "DRJIT_LIBLLVM_PATH to the file of a libLLVM that is new enough"
)


class EngineError(RuntimeError):
    """No backend of Dr.Jit can be used; the message says what to install."""


def prepare() -> None:
    """Point Dr.Jit to the LLVM that came with this environment, unless the user chose one."""
    if "DRJIT_LIBLLVM_PATH" in os.environ:
        return
    libraries = sorted((Path(sys.prefix) / "lib").glob("libLLVM.so.*"))
    if libraries:
        os.environ["DRJIT_LIBLLVM_PATH"] = str(libraries[-1])


@functools.cache
def backend() -> str:
    """Choose the backend: ``MMSLAM_BACKEND`` if set, else CUDA if there is one, else LLVM.

    Returns
    -------
    ``"cuda"`` or ``"llvm"``.

    Raises
    ------
    EngineError
        If the asked backend does not exist here, or LLVM is missing or too old.
    """
    asked = os.environ.get("MMSLAM_BACKEND", "").strip().lower()
    if asked and asked not in BACKENDS:
        raise EngineError(f"MMSLAM_BACKEND is {asked!r}; it must be one of {', '.join(BACKENDS)}")
    prepare()
    import drjit as dr

    present = [name for name in BACKENDS if dr.has_backend(getattr(dr.JitBackend, name.upper()))]
    chosen = asked or ("cuda" if "cuda" in present else "llvm")
    if chosen == "llvm":
        _check_llvm("llvm" in present)
    elif chosen not in present:
        raise EngineError(
            f"MMSLAM_BACKEND asks for {chosen!r}, but Dr.Jit finds only "
            f"{', '.join(present) or 'no backend'}; unset it, or install the driver"
        )
    return chosen


def _check_llvm(present: bool) -> None:
    where = os.environ.get("DRJIT_LIBLLVM_PATH", "the system's default")
    if not present:
        raise EngineError(f"Dr.Jit could not load LLVM (tried {where}): {_LLVM_HELP}")
    import drjit as dr

    version = dr.detail.llvm_version()
    if version[0] < OLDEST_LLVM:
        found = ".".join(map(str, version))
        raise EngineError(f"LLVM {found} ({where}) is too old: {_LLVM_HELP}")


def arrays() -> ModuleType:
    """Return the module of Dr.Jit array types (``Float``, ``UInt32``, …) of the backend."""
    return importlib.import_module(f"drjit.{backend()}")


def mitsuba_variant() -> str:
    """Name the Mitsuba variant that Sionna RT uses on the chosen backend."""
    return f"{backend()}_ad_mono_polarized"


def thread_count() -> int:
    """Count the CPU threads that Dr.Jit uses (1 on a GPU)."""
    import drjit as dr

    return int(dr.thread_count()) if backend() == "llvm" else 1
