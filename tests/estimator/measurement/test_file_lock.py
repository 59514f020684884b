import subprocess
import sys
from pathlib import Path

from estimator.measurement.file_lock import file_lock


def test_one_holds_a_lock_at_a_time(tmp_path: Path) -> None:
    path = tmp_path / "folder" / "lock"
    with file_lock(path) as first, file_lock(path) as second:
        assert (first, second) == (True, False)
    with file_lock(path) as again:
        assert again


def test_a_lock_ends_with_the_process_that_held_it(tmp_path: Path) -> None:
    program = (
        "import os, sys; from pathlib import Path; "
        "from estimator.measurement.file_lock import file_lock\n"
        "with file_lock(Path(sys.argv[1])) as held: os._exit(7 if held else 1)"
    )
    checkout = Path(__file__).resolve().parents[3]
    command = [sys.executable, "-c", program, str(tmp_path / "lock")]
    assert subprocess.run(command, cwd=checkout).returncode == 7
    with file_lock(tmp_path / "lock") as held:
        assert held


def test_a_lock_whose_file_was_removed_keeps_nobody_out(tmp_path: Path) -> None:
    # As the holder does at its end: whoever opened the file before must take the new one.
    with file_lock(tmp_path / "lock") as first:
        assert first
        (tmp_path / "lock").unlink()
        with file_lock(tmp_path / "lock") as second:
            assert second
