"""The notebooks are stored without outputs, run from top to bottom, and say what they promise."""

import json
import re
import runpy
from pathlib import Path
from typing import Any

import pytest

CHECKOUT = Path(__file__).resolve().parents[1]
NOTEBOOKS = sorted((CHECKOUT / "examples" / "notebooks").glob("*.ipynb"))
FIGURES = {"a_dataset_into_pytorch": 1, "the_thesis_in_ten_cells": 6, "your_own_numbers": 2}
"""How many figures each draws."""


def code_cells(path: Path) -> list[dict[str, Any]]:
    cells = json.loads(path.read_text(encoding="utf-8"))["cells"]
    return [cell for cell in cells if cell["cell_type"] == "code"]


def printed(notebook: Any) -> str:
    return "".join(
        output.get("text", "") for cell in notebook.cells for output in cell.get("outputs", ())
    )


def check_thesis(text: str) -> None:
    found = re.search(r"([\d.]+) mm off; it states ([\d.]+) mm", text)
    assert found is not None
    error, deviation = map(float, found.groups())
    assert error < 4 * deviation < 4.0  # beyond it, one normal draw in 16 000


def check_numbers(text: str) -> None:
    for told in ("target at [-0.06  0.35] m", "target at [0.05 0.45] m", "ann at [0.12 0.3 ] m"):
        assert told in text


def check_learnt(text: str) -> None:
    found = re.search(r"median error ([\d.]+) mm, of the guess ([\d.]+) mm", text)
    assert found is not None
    learnt, guess = map(float, found.groups())
    assert learnt < guess / 2


CHECKS = {
    "a_dataset_into_pytorch": check_learnt,
    "the_thesis_in_ten_cells": check_thesis,
    "your_own_numbers": check_numbers,
}


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_is_stored_without_outputs(path: Path) -> None:
    for cell in code_cells(path):
        assert cell["outputs"] == []
        assert cell["execution_count"] is None


def test_the_thesis_takes_ten_cells() -> None:
    assert len(code_cells(CHECKOUT / "examples/notebooks/the_thesis_in_ten_cells.ipynb")) == 10


@pytest.mark.parametrize("path", NOTEBOOKS, ids=lambda path: path.stem)
def test_a_notebook_runs_from_top_to_bottom(path: Path) -> None:
    tool = runpy.run_path(str(CHECKOUT / "docs" / "tools" / "notebooks.py"))
    notebook = tool["executed"](path)
    CHECKS[path.stem](printed(notebook))
    page = tool["notebook_page"](notebook, path.name)
    assert page.count("<img ") >= FIGURES[path.stem]
    assert "Traceback" not in page
    assert "https://" not in page.split("```")[0]
