"""The command ``info``: backend, LLVM, threads and versions of this installation."""

import os
import platform
import re
from typing import Any

from estimator.compute import engine
from mmslam.results.document import versions


def system_information() -> dict[str, Any]:
    """Collect what a bug report needs.

    Returns
    -------
    A document for JSON; ``backend`` is None and ``backend_error`` says why if there is none.
    """
    backend, problem = None, None
    try:
        backend = engine.backend()
    except engine.EngineError as error:
        problem = str(error)
    return {
        "backend": backend,
        "backend_error": problem,
        "llvm_version": _llvm_version(),
        "llvm_path": os.environ.get("DRJIT_LIBLLVM_PATH"),
        "threads": engine.thread_count() if backend else None,
        "processors": os.cpu_count(),
        "platform": platform.platform(),
        "machine": platform.machine(),
        "versions": versions(),
    }


def _llvm_version() -> str | None:
    try:
        import drjit as dr

        found: tuple[int, ...] = dr.detail.llvm_version()
    except (ImportError, RuntimeError):
        return None
    text = ".".join(map(str, found))
    return text if re.fullmatch(r"[1-9]\d*(\.\d+)*", text) else None  # none loaded: -1
