import importlib
from pathlib import Path

import pytest

PACKAGES = ("scenes", "simulator", "estimator", "validation", "mmslam")
CHECKOUT = Path(__file__).resolve().parent.parent


@pytest.mark.parametrize("name", PACKAGES)
def test_each_package_comes_from_this_checkout(name: str) -> None:
    file = importlib.import_module(name).__file__
    assert file is not None
    assert Path(file).resolve().parent == CHECKOUT / name


@pytest.mark.parametrize("name", PACKAGES)
def test_each_package_says_that_it_is_typed(name: str) -> None:
    assert (CHECKOUT / name / "py.typed").is_file()
