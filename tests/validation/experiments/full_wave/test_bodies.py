"""What the solver of bodies claims, and that the claims can fail."""

import numpy as np
import pytest

from validation.experiments.full_wave import bodies as module
from validation.full_wave.boundary_equations import Polarisation


@pytest.mark.parametrize("polarisation", ["TM", "TE"])
def test_a_cylinder_of_plasterboard_keeps_its_claim(polarisation: Polarisation) -> None:
    error = module._cylinder_error(module.PLASTERBOARD, polarisation)
    assert 0 < error < module.MOST_SERIES_ERROR


def test_too_few_points_break_the_claim(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(module, "PER_WAVELENGTH", 2.5)
    error = module._cylinder_error(None, "TE")
    one = module.BodyError(
        name="cylinder", error=error, most=module.MOST_SERIES_ERROR, reference="series"
    )
    with pytest.raises(RuntimeError, match=r"cylinder: .* is claimed"):
        module.check((one,))
    module.check(
        (module.BodyError(name="one", error=np.finfo(float).eps, most=1e-7, reference="series"),)
    )
