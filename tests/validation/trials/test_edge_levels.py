"""The simulator's edges of smooth plates against the closed form."""

import pytest

from validation.trials.edge_levels import edge_levels


def test_a_simulated_conductor_has_keller_s_edges() -> None:
    # The strongest place about an edge, of a bent wave: 0.4 dB of eight edges.
    assert edge_levels("metal", 40.0).along == pytest.approx((0.0, 0.0), abs=0.6)
