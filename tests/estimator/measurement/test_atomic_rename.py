from pathlib import Path

import pytest

from estimator.measurement import atomic_rename
from estimator.measurement.atomic_rename import exchange, rename_new


@pytest.fixture(params=[True, False])
def with_renameat2(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> bool:
    if not request.param:
        monkeypatch.setattr(atomic_rename, "_system_call", lambda: None)
    return bool(request.param)


def filled(folder: Path, mark: str) -> Path:
    folder.mkdir()
    (folder / "file").write_text(mark)
    return folder


def test_two_full_folders_are_exchanged_or_both_stay(tmp_path: Path, with_renameat2: bool) -> None:
    one, other = filled(tmp_path / "one", "1"), filled(tmp_path / "other", "2")
    done = exchange(one, other)
    if not with_renameat2:
        assert not done
    found = [(folder / "file").read_text() for folder in (one, other)]
    assert found == (["2", "1"] if done else ["1", "2"])


def test_a_name_that_is_taken_is_not_given_again(tmp_path: Path, with_renameat2: bool) -> None:
    one, other = filled(tmp_path / "one", "1"), filled(tmp_path / "other", "2")
    (tmp_path / "file").write_text("3")
    (tmp_path / "new").write_text("4")
    (tmp_path / "nowhere").symlink_to(tmp_path / "gone")
    for source, target in (
        (one, other),
        (one, tmp_path / "file"),
        (tmp_path / "new", tmp_path / "file"),
        (tmp_path / "new", tmp_path / "nowhere"),
    ):
        with pytest.raises(FileExistsError):
            rename_new(source, target)
    assert (other / "file").read_text() == "2"
    assert (tmp_path / "file").read_text() == "3"


def test_a_name_that_is_free_is_given(tmp_path: Path, with_renameat2: bool) -> None:
    rename_new(filled(tmp_path / "one", "1"), tmp_path / "two")
    (tmp_path / "new").write_text("4")
    rename_new(tmp_path / "new", tmp_path / "file")
    assert sorted(path.name for path in tmp_path.iterdir()) == ["file", "two"]
