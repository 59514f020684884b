import numpy as np
import pytest

from estimator.array.resolution import HALF_POWER
from validation.metrics.point_response import peak_cut


def test_a_sinc_is_as_wide_as_the_resolution_formulas_say() -> None:
    offsets = np.linspace(-2.5, 2.5, 251) * HALF_POWER
    cut = peak_cut(offsets, np.abs(np.sinc(offsets - 0.0123)))
    # 50 samples in the width: a parabola and linear interpolation err by less than 1e-3 of it
    assert cut.place == pytest.approx(0.0123, abs=1e-3)
    assert cut.width == pytest.approx(HALF_POWER, rel=1e-3)
    assert cut.value == pytest.approx(1.0, rel=1e-3)


def test_a_lobe_that_is_cut_off_has_no_width() -> None:
    offsets = np.linspace(-0.3, 2.0, 101)
    with pytest.raises(ValueError, match="does not fall by 3 dB within the line"):
        peak_cut(offsets, np.abs(np.sinc(offsets)))
    with pytest.raises(ValueError, match="the peak is at an end"):
        peak_cut(offsets, np.exp(-offsets))
