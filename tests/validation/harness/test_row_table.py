import pytest

from validation.harness.claim import Row
from validation.harness.row_table import conclude, row_line


def row(measured: float) -> Row:
    return Row(name="width", stated="theory: 2 mm", measured=measured, unit="mm", high=2.1,
               origin="5 %")  # fmt: skip


def test_figures_within_their_limits_are_printed(capsys: pytest.CaptureFixture[str]) -> None:
    conclude([row(2.0)])
    assert capsys.readouterr().out == "holds: width: 2 mm (theory: 2 mm; ≤ 2.1 mm)\n"


@pytest.mark.parametrize("measured", [2.2, float("nan")])
def test_a_figure_outside_of_its_limits_is_refused(measured: float) -> None:
    assert row_line(row(measured)).startswith("FAILS")
    with pytest.raises(RuntimeError, match="1 of 2 claims fail: width"):
        conclude([row(2.0), row(measured)])
