"""The tree keeps its shape: few modules in a folder, none of a length that nobody reads."""

from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
PACKAGES = ("scenes", "simulator", "estimator", "validation", "mmslam", "benchmarks", "examples")

MOST_MODULES = 20
"""In a folder, beside its `__init__`: what a reader takes in at one look. [-]"""

MOST_LINES = 400
"""Of a module; a longer one says why in a comment below its docstring. [-]"""

REASON = "# Over 400 lines: "
"""How the comment begins."""


@pytest.mark.parametrize("package", PACKAGES)
def test_no_folder_holds_more_modules_than_a_reader_takes_in(package: str) -> None:
    folders = {path.parent for path in (ROOT / package).rglob("*.py")}
    crowded = {
        str(folder.relative_to(ROOT)): count
        for folder in folders
        if (count := sum(path.name != "__init__.py" for path in folder.glob("*.py"))) > MOST_MODULES
    }
    assert not crowded


@pytest.mark.parametrize("package", [*PACKAGES, "tests"])
def test_a_module_over_four_hundred_lines_gives_its_reason(package: str) -> None:
    long = [
        str(path.relative_to(ROOT))
        for path in (ROOT / package).rglob("*.py")
        if len(lines := path.read_text(encoding="utf-8").splitlines()) > MOST_LINES
        and not any(line.startswith(REASON) for line in lines[:60])
    ]
    assert not long
