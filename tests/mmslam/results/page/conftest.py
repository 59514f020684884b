import importlib.util
import json
import shutil
import subprocess
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from mmslam.results.page.single_file import script_source


@pytest.fixture(scope="session")
def engine() -> str:
    """A JavaScript engine: that of this machine, or the one that Playwright brings."""
    found = shutil.which("node")
    playwright = importlib.util.find_spec("playwright")
    if found is None and playwright is not None and playwright.origin is not None:
        brought = Path(playwright.origin).parent / "driver" / "node"
        found = str(brought) if brought.exists() else None
    if found is None:
        pytest.skip("no Node.js, of this machine or Playwright's")
    return found


@pytest.fixture(scope="session")
def predicted(engine: str) -> Callable[[list[Any]], list[Any]]:
    """What ``predictedPaths`` of the page returns for a list of its arguments."""
    program = script_source("predicted_paths.js") + (
        "\nconst cases = JSON.parse(require('fs').readFileSync(0, 'utf8'));"
        "\nconsole.log(JSON.stringify(cases.map(([user, map]) => predictedPaths(user, map))));"
    )

    def run(cases: list[Any]) -> list[Any]:
        done = subprocess.run(
            [engine, "-e", program],
            input=json.dumps(cases),
            capture_output=True,
            text=True,
            timeout=120,
        )
        assert done.returncode == 0, done.stderr
        answers: list[Any] = json.loads(done.stdout)
        return answers

    return run
