import errno
import json
import os
import resource
import signal
import subprocess
import sys
import textwrap
import time
from pathlib import Path

import pytest

from estimator.measurement import atomic_rename, file_lock
from mmslam import output, own_results
from mmslam.output import OutputError, replacing
from mmslam.own_results import refuse_foreign_results, refuse_foreign_store

OURS = json.dumps({"format": 1, "users": [], "mirrors": [], "versions": {}})


def fill(folder: Path, mark: str = "new") -> None:
    folder.mkdir()
    (folder / own_results.RESULT).write_text(OURS)
    (folder / own_results.REPORT).write_text(mark)


def everything_below(folder: Path) -> list[str]:
    return sorted(str(path.relative_to(folder)) for path in folder.rglob("*"))


def test_a_new_folder_appears_whole_and_nothing_stays_beside_it(tmp_path: Path) -> None:
    with replacing(tmp_path / "a" / "b", refuse_foreign_results) as new:
        fill(new)
        assert not (tmp_path / "a" / "b").exists()
    assert everything_below(tmp_path) == ["a", "a/b", "a/b/report.html", "a/b/result.json"]


def test_the_new_folder_has_the_rights_that_the_umask_asks_for(tmp_path: Path) -> None:
    with replacing(tmp_path / "out", refuse_foreign_results) as new:
        fill(new)
    (tmp_path / "plain").mkdir()
    assert (tmp_path / "out").stat().st_mode == (tmp_path / "plain").stat().st_mode


def test_our_own_results_are_replaced(tmp_path: Path) -> None:
    fill(tmp_path / "out", "old")
    with replacing(tmp_path / "out", refuse_foreign_results) as new:
        fill(new)
        assert (tmp_path / "out" / own_results.REPORT).read_text() == "old"
    assert (tmp_path / "out" / own_results.REPORT).read_text() == "new"
    assert everything_below(tmp_path) == ["out", "out/report.html", "out/result.json"]


@pytest.mark.parametrize("error", [ValueError, KeyboardInterrupt])
def test_a_failure_leaves_everything_as_it_was(tmp_path: Path, error: type[BaseException]) -> None:
    def fail(folder: Path) -> None:
        with replacing(folder, refuse_foreign_results) as new:
            fill(new)
            raise error

    fill(tmp_path / "out", "old")
    with pytest.raises(error):
        fail(tmp_path / "out")
    assert (tmp_path / "out" / own_results.REPORT).read_text() == "old"
    with pytest.raises(error):
        fail(tmp_path / "x" / "y")
    assert everything_below(tmp_path) == ["out", "out/report.html", "out/result.json"]


def test_an_interruption_between_the_two_renames_puts_the_old_folder_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    fill(tmp_path / "out", "old")

    def interrupted(source: Path, target: Path) -> None:
        if source.name.startswith("whole-") and not target.exists():
            raise KeyboardInterrupt
        atomic_rename.rename_new(source, target)

    monkeypatch.setattr(output, "exchange", lambda one, other: False)  # as on other systems
    monkeypatch.setattr(output, "rename_new", interrupted)
    with (
        pytest.raises(KeyboardInterrupt),
        replacing(tmp_path / "out", refuse_foreign_results) as new,
    ):
        fill(new)
    assert (tmp_path / "out" / own_results.REPORT).read_text() == "old"
    assert everything_below(tmp_path) == ["out", "out/report.html", "out/result.json"]


def test_a_foreign_folder_is_refused_before_any_work(tmp_path: Path) -> None:
    (tmp_path / "thesis").mkdir()
    (tmp_path / "thesis" / "chapter1.tex").write_text("years of work")
    with (
        pytest.raises(OutputError, match="no earlier run of mmslam"),
        replacing(tmp_path / "thesis", refuse_foreign_results),
    ):
        pytest.fail("the block must not be entered")
    assert (tmp_path / "thesis" / "chapter1.tex").read_text() == "years of work"


def test_what_the_user_put_beside_our_results_is_not_deleted(tmp_path: Path) -> None:
    fill(tmp_path / "out")
    (tmp_path / "out" / "notes.txt").write_text("mine")
    with (
        pytest.raises(OutputError, match=r"notes\.txt"),
        replacing(tmp_path / "out", refuse_foreign_results),
    ):
        pytest.fail("the block must not be entered")


@pytest.mark.parametrize("content", ["", "[]", '{"format": 1}', '{"format": 2, "users": []}'])
def test_a_foreign_result_file_does_not_make_a_folder_ours(tmp_path: Path, content: str) -> None:
    (tmp_path / own_results.RESULT).write_text(content)
    assert refuse_foreign_results(tmp_path) is not None


def test_an_empty_folder_may_be_filled(tmp_path: Path) -> None:
    (tmp_path / "out").mkdir()
    with replacing(tmp_path / "out", refuse_foreign_results) as new:
        fill(new)
    assert (tmp_path / "out" / own_results.RESULT).exists()


def test_a_file_in_the_way_is_refused(tmp_path: Path) -> None:
    (tmp_path / "out").write_text("")
    with (
        pytest.raises(OutputError, match="it is a file"),
        replacing(tmp_path / "out", refuse_foreign_results),
    ):
        pytest.fail("the block must not be entered")


def test_a_file_among_the_parents_is_refused(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with (
        pytest.raises(OutputError, match="no folder"),
        replacing(tmp_path / "file" / "out", refuse_foreign_results),
    ):
        pytest.fail("the block must not be entered")


def test_the_current_folder_is_not_exchanged_under_the_shells_feet(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    with (
        pytest.raises(OutputError, match="current folder"),
        replacing(Path("."), refuse_foreign_results),
    ):
        pytest.fail("the block must not be entered")


def test_a_link_is_followed_and_kept(tmp_path: Path) -> None:
    fill(tmp_path / "real", "old")
    (tmp_path / "link").symlink_to(tmp_path / "real")
    with replacing(tmp_path / "link", refuse_foreign_results) as new:
        fill(new)
    assert (tmp_path / "link").is_symlink()
    assert (tmp_path / "real" / own_results.REPORT).read_text() == "new"


@pytest.mark.parametrize("number", [errno.EROFS, errno.EACCES])
def test_a_place_that_cannot_be_written_is_found_out_before_any_work(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, number: int
) -> None:
    def refused(*_: object) -> int:
        raise OSError(number, os.strerror(number))

    monkeypatch.setattr(file_lock, "_taken", refused)
    with (
        pytest.raises(OutputError, match="cannot write"),
        replacing(tmp_path / "a" / "out", refuse_foreign_results),
    ):
        pytest.fail("the block must not be entered")
    assert everything_below(tmp_path) == []


def test_a_full_disk_is_told_and_leaves_nothing_behind(tmp_path: Path) -> None:
    # A limit on the size of a file fails as a full disk does: in the middle of a write.
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    kept = signal.signal(signal.SIGXFSZ, signal.SIG_IGN)

    def write_too_much() -> None:
        with replacing(tmp_path / "out", refuse_foreign_results) as new:
            new.mkdir()
            resource.setrlimit(resource.RLIMIT_FSIZE, (4096, limits[1]))
            (new / "big").write_bytes(bytes(8192))

    try:
        with pytest.raises(OutputError, match="size limit"):
            write_too_much()
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
        signal.signal(signal.SIGXFSZ, kept)
    assert everything_below(tmp_path) == []


def test_a_writer_that_is_late_leaves_nothing_behind_either(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # As Zarr's threads do: they make the folder anew after it was removed, twice here.
    stores: list[Path] = []
    late: list[Path] = []

    def write_once_more(_: float) -> None:
        if len(late) < 2:
            late.extend(stores)
            stores[0].mkdir(parents=True)
            (stores[0] / "chunk").write_text("late")

    def fail() -> None:
        with replacing(tmp_path / "a" / "out", refuse_foreign_results) as new:
            stores.append(new / "measurement.zarr")
            raise ValueError("full")

    monkeypatch.setattr(time, "sleep", write_once_more)
    with pytest.raises(ValueError, match="full"):
        fail()
    assert len(late) == 2
    assert everything_below(tmp_path) == []


def test_another_os_error_keeps_its_traceback(tmp_path: Path) -> None:
    with (
        pytest.raises(FileNotFoundError),
        replacing(tmp_path / "out", refuse_foreign_results) as new,
    ):
        (new / "no" / "such").read_text()


def test_only_a_measurement_store_is_replaced_by_a_measurement(tmp_path: Path) -> None:
    store = tmp_path / "m.zarr"
    store.mkdir()
    assert refuse_foreign_store(store) is None
    (store / "zarr.json").write_text(json.dumps({"node_type": "group", "attributes": {}}))
    assert refuse_foreign_store(store) is not None
    (store / "zarr.json").write_text(json.dumps({"attributes": {"mmslam_format": 1}}))
    assert refuse_foreign_store(store) is None


def test_ctrl_c_in_the_middle_of_a_write_leaves_nothing_half_written(tmp_path: Path) -> None:
    program = textwrap.dedent("""
        import sys, time
        from pathlib import Path
        from mmslam.terminal.exit_codes import told_clearly
        from mmslam.output import replacing
        from mmslam.own_results import refuse_foreign_results
        with told_clearly(), replacing(Path(sys.argv[1]), refuse_foreign_results) as new:
            new.mkdir()
            (new / "result.json").write_text("{")
            print("writing", flush=True)
            time.sleep(60)
    """)
    child = subprocess.Popen(
        [sys.executable, "-c", program, str(tmp_path / "a" / "out")],
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).resolve().parents[2],
    )
    assert child.stdout is not None
    assert child.stdout.readline() == "writing\n"
    child.send_signal(signal.SIGINT)
    _, errors = child.communicate(timeout=30)
    assert "nothing was written" in errors
    assert everything_below(tmp_path) == []


@pytest.fixture(params=["in one step", "by two renames"])
def way(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> str:
    """Exchange names as this system can, and as others have to."""
    if request.param == "by two renames":
        monkeypatch.setattr(atomic_rename, "_renameat2", lambda *_: False)
    return str(request.param)


def test_notes_added_while_the_command_works_are_not_deleted(tmp_path: Path, way: str) -> None:
    def work() -> None:
        with replacing(tmp_path / "out", refuse_foreign_results) as new:
            fill(new)
            (tmp_path / "out" / "notes.txt").write_text("mine")

    fill(tmp_path / "out", "old")
    with pytest.raises(OutputError, match=r"out was changed.*notes\.txt.*out-new1"):
        work()
    assert (tmp_path / "out" / "notes.txt").read_text() == "mine"
    assert (tmp_path / "out" / own_results.REPORT).read_text() == "old"
    assert (tmp_path / "out-new1" / own_results.REPORT).read_text() == "new"  # hours of work, maybe
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "out-new1"]


def test_a_folder_made_while_the_command_works_is_not_deleted(tmp_path: Path, way: str) -> None:
    def work() -> None:
        with replacing(tmp_path / "out", refuse_foreign_results) as new:
            fill(new)
            (tmp_path / "out").mkdir()
            (tmp_path / "out" / "thesis.tex").write_text("years of work")

    with pytest.raises(OutputError, match="out was changed"):
        work()
    assert (tmp_path / "out" / "thesis.tex").read_text() == "years of work"


def test_what_is_changed_in_the_last_instant_is_put_back(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    # Between the look at what is replaced and the exchange, which is one step.
    def late(one: Path, other: Path) -> bool:
        if other.name == "out" and not (other / "notes.txt").exists():
            (other / "notes.txt").write_text("mine")
        return atomic_rename.exchange(one, other)

    def work() -> None:
        with replacing(tmp_path / "out", refuse_foreign_results) as new:
            fill(new)

    fill(tmp_path / "out", "old")
    monkeypatch.setattr(output, "exchange", late)
    with pytest.raises(OutputError, match=r"notes\.txt"):
        work()
    assert (tmp_path / "out" / "notes.txt").read_text() == "mine"
    assert (tmp_path / "out" / own_results.REPORT).read_text() == "old"


def test_two_commands_on_one_output_do_not_work_at_once(tmp_path: Path) -> None:
    with replacing(tmp_path / "out", refuse_foreign_results) as new:
        fill(new)
        with (
            pytest.raises(OutputError, match="out is being written by another mmslam command"),
            replacing(tmp_path / "out", refuse_foreign_results),
        ):
            pytest.fail("the block must not be entered")
    assert everything_below(tmp_path) == ["out", "out/report.html", "out/result.json"]


def test_a_file_is_never_replaced_not_even_one_made_meanwhile(tmp_path: Path, way: str) -> None:
    def work() -> None:
        with output.new_file(tmp_path / "it.nc") as new:
            new.write_text("new")
            (tmp_path / "it.nc").write_text("mine")

    with pytest.raises(OutputError, match=r"it\.nc was changed.*it-new1\.nc"):
        work()
    assert (tmp_path / "it.nc").read_text() == "mine"
    assert (tmp_path / "it-new1.nc").read_text() == "new"
    with pytest.raises(OutputError, match="exists"), output.new_file(tmp_path / "it.nc"):
        pytest.fail("the block must not be entered")


def test_a_link_in_the_place_of_our_own_folder_is_not_followed(tmp_path: Path) -> None:
    (tmp_path / "precious").mkdir()
    (tmp_path / "precious" / "new").write_text("mine")
    (tmp_path / ".out.mmslam").symlink_to(tmp_path / "precious")
    with (
        pytest.raises(OutputError, match="is a link"),
        replacing(tmp_path / "out", refuse_foreign_results),
    ):
        pytest.fail("the block must not be entered")
    assert (tmp_path / "precious" / "new").read_text() == "mine"


def test_a_name_as_long_as_the_file_system_takes_is_taken(tmp_path: Path) -> None:
    with replacing(tmp_path / ("o" * 255), refuse_foreign_results) as new:
        fill(new)
    assert [len(path.name) for path in tmp_path.iterdir()] == [255]
    with (
        pytest.raises(OutputError, match="the name is too long"),
        replacing(tmp_path / ("o" * 256), refuse_foreign_results),
    ):
        pytest.fail("the block must not be entered")
