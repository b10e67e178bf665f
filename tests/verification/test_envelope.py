"""Stability at extremes (tests/verification/extremes.py)."""

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from warpimpact.kernels.status import Status

from .extremes import MOST_RISE, MOST_STRETCH, drawn, found

SHARES = st.lists(st.floats(0.0, 1.0), min_size=90, max_size=90)  # more than a scene of two hits takes


# Later examples alter numbers beyond those that a scene takes.
@settings(max_examples=11, deadline=None, derandomize=True, database=None, suppress_health_check=list(HealthCheck))
@given(shares=SHARES)
def test_extremes(shares: list[float]) -> None:
    outcome = found(drawn(iter(shares).__next__, hits=2))
    assert Status.NOT_FINITE not in outcome.statuses
    assert Status.GAINED_ENERGY not in outcome.statuses
    assert outcome.undefined == 0
    assert outcome.steep_rise <= MOST_RISE
    assert outcome.stretch <= MOST_STRETCH


# A spinning disc in double precision, and a needle that tumbles while it spins.
@pytest.mark.parametrize("index", [1079, 4002])
def test_energy_of_spin_and_tumbling(index: int) -> None:
    assert found(drawn(np.random.default_rng([1, index]).random, hits=3)).steep_rise <= MOST_RISE
