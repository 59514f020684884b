import signal
from collections.abc import Iterator

import pytest
import typer

from mmslam.terminal.exit_codes import told_clearly
from mmslam.terminal.interruption import interruptions_held


@pytest.fixture(autouse=True)
def handler_left_as_it_was() -> Iterator[None]:
    before = signal.getsignal(signal.SIGINT)
    yield
    assert signal.getsignal(signal.SIGINT) is before


def test_a_held_interruption_comes_where_it_is_let_through() -> None:
    reached = []

    def work() -> None:
        with interruptions_held() as let_through:
            let_through()
            signal.raise_signal(signal.SIGINT)
            reached.append("held")
            let_through()
            reached.append("never")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert reached == ["held"]


def test_a_held_interruption_comes_at_the_end_at_the_latest() -> None:
    reached = []

    def work() -> None:
        with interruptions_held():
            signal.raise_signal(signal.SIGINT)
            reached.append("end")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert reached == ["end"]


def test_pressing_twice_interrupts_at_once() -> None:
    reached = []

    def work() -> None:
        with interruptions_held():
            signal.raise_signal(signal.SIGINT)
            reached.append("once")
            signal.raise_signal(signal.SIGINT)
            reached.append("twice")

    with pytest.raises(KeyboardInterrupt):
        work()
    assert reached == ["once"]


def test_without_ctrl_c_nothing_happens() -> None:
    with interruptions_held() as let_through:
        let_through()


def test_an_interruption_that_a_library_turned_into_another_error_is_still_one(
    capsys: pytest.CaptureFixture[str],
) -> None:
    def library() -> None:
        try:
            signal.raise_signal(signal.SIGINT)
        except KeyboardInterrupt:
            raise SystemError("returned a result with an exception set") from None

    with pytest.raises(typer.Exit) as stopped, told_clearly():
        library()
    assert stopped.value.exit_code == 130
    assert capsys.readouterr().err == "mmslam: interrupted; nothing was written\n"


def test_a_bug_keeps_its_traceback() -> None:
    with pytest.raises(ZeroDivisionError), told_clearly():
        _ = 1 / 0
