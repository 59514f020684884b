"""The examples in docstrings run, and each public name of the front door has one."""

import doctest
import importlib
import inspect
from pathlib import Path

import pytest

import mmslam

CHECKOUT = Path(__file__).resolve().parents[1]
PACKAGES = ("scenes", "simulator", "estimator", "validation", "mmslam")
MODULES = sorted(
    ".".join(path.relative_to(CHECKOUT).with_suffix("").parts)
    for package in PACKAGES
    for path in (CHECKOUT / package).rglob("*.py")
    if ">>> " in path.read_text(encoding="utf-8")
)


@pytest.mark.parametrize("name", MODULES)
def test_the_examples_of_a_module_run(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    from matplotlib import pyplot as plt

    monkeypatch.chdir(tmp_path)
    module = importlib.import_module(name)
    tried = 0
    for test in doctest.DocTestFinder(exclude_empty=True).find(module):
        told: list[str] = []
        result = doctest.DocTestRunner(
            optionflags=doctest.NORMALIZE_WHITESPACE | doctest.ELLIPSIS
        ).run(test, out=told.append)
        assert result.failed == 0, "".join(told)
        tried += result.attempted
    plt.close("all")
    assert tried > 0


@pytest.mark.parametrize("name", mmslam.__all__)
def test_each_public_name_of_the_front_door_shows_how_it_is_used(name: str) -> None:
    assert ">>> " in (inspect.getdoc(getattr(mmslam, name)) or "")
