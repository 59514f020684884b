"""The choice of Dr.Jit's backend, each in a fresh process: it is made once, before any import."""

import os
import subprocess
import sys
from pathlib import Path

import drjit as dr
import pytest

from estimator.compute import engine

CHECKOUT = Path(__file__).resolve().parents[3]
HAS_CUDA = bool(dr.has_backend(dr.JitBackend.CUDA))
HAS_LLVM = bool(dr.has_backend(dr.JitBackend.LLVM))

TOLD = """
from estimator.compute import engine
try:
    print("backend", engine.backend())
except engine.EngineError as error:
    print("EngineError", error)
"""

OLD = """
import estimator, drjit, sys
drjit.has_backend = lambda backend: backend == drjit.JitBackend.LLVM
drjit.detail.llvm_version = lambda: (15, 0, 7)
try:
    import simulator
except estimator.compute.engine.EngineError as error:
    print("EngineError", error)
print("sionna" in sys.modules, "mitsuba" in sys.modules)
"""


def run(script: str, **environment: str) -> str:
    inherited = {
        name: value
        for name, value in os.environ.items()
        if name not in ("MMSLAM_BACKEND", "DRJIT_LIBLLVM_PATH")
    }
    done = subprocess.run(
        [sys.executable, "-c", script],
        env={**inherited, **environment},
        cwd=CHECKOUT,
        capture_output=True,
        text=True,
        timeout=60,
    )
    assert done.returncode == 0, done.stderr  # an abort would be -6
    assert "Traceback" not in done.stderr
    return done.stdout


def test_a_backend_that_does_not_exist_is_refused_by_name() -> None:
    told = run(TOLD, MMSLAM_BACKEND="opencl")
    assert told.startswith("EngineError MMSLAM_BACKEND is 'opencl'; it must be one of cuda, llvm")


@pytest.mark.skipif(HAS_CUDA, reason="this machine has a GPU")
def test_a_backend_that_is_not_here_is_refused_with_those_that_are() -> None:
    told = run(TOLD, MMSLAM_BACKEND="CUDA")
    assert told.startswith("EngineError MMSLAM_BACKEND asks for 'cuda', but Dr.Jit finds only llvm")


def test_without_an_llvm_the_error_says_what_to_install() -> None:
    told = run(TOLD, DRJIT_LIBLLVM_PATH="/nowhere/libLLVM.so", MMSLAM_BACKEND="llvm")
    assert told.startswith("EngineError Dr.Jit could not load LLVM (tried /nowhere/libLLVM.so)")
    assert "pip install karellen-llvm-core" in told


def test_a_file_that_is_no_llvm_is_no_llvm(tmp_path: Path) -> None:
    library = tmp_path / "libLLVM.so"
    library.write_text("not a library")
    told = run(TOLD, DRJIT_LIBLLVM_PATH=str(library), MMSLAM_BACKEND="llvm")
    assert told.startswith(f"EngineError Dr.Jit could not load LLVM (tried {library})")


def test_an_llvm_that_is_too_old_is_refused_before_sionna_could_abort() -> None:
    told = run(OLD)
    assert told.startswith("EngineError LLVM 15.0.7 (")
    assert "install LLVM 16 or newer" in told
    assert told.splitlines()[-1] == "False False"


@pytest.mark.skipif(not HAS_LLVM, reason="LLVM is not installed")
def test_llvm_can_be_asked_for_in_any_case_and_with_spaces() -> None:
    assert run(TOLD, MMSLAM_BACKEND=" LLVM ") == "backend llvm\n"


def test_the_users_own_library_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "/mine")
    engine.prepare()
    assert os.environ["DRJIT_LIBLLVM_PATH"] == "/mine"


def test_the_library_of_the_environment_is_found(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setenv("DRJIT_LIBLLVM_PATH", "")  # so that it is restored, whether set or not
    monkeypatch.delenv("DRJIT_LIBLLVM_PATH")
    monkeypatch.setattr(sys, "prefix", str(tmp_path))
    engine.prepare()
    assert "DRJIT_LIBLLVM_PATH" not in os.environ  # none: Dr.Jit looks for the system's
    library = tmp_path / "lib" / "libLLVM.so.23.1"
    library.parent.mkdir()
    library.touch()
    engine.prepare()
    assert os.environ["DRJIT_LIBLLVM_PATH"] == str(library)


def test_the_variant_and_the_arrays_are_those_of_the_backend() -> None:
    assert engine.backend() in engine.BACKENDS
    assert engine.mitsuba_variant() == f"{engine.backend()}_ad_mono_polarized"
    assert engine.arrays().__name__ == f"drjit.{engine.backend()}"
    assert engine.thread_count() >= 1
