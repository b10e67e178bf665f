"""Stability at extremes (tests/verification/extremes.py)."""

import numpy as np
import pytest

from warpimpact.kernels.status import Status

from .extremes import MOST_RISE, MOST_STRETCH, computed, drawn

SCENES = (0, 4, 7, 12, 17, 27, 32)
"""Of a seed: cores that pass, stop and ricochet within 154 to 6963 steps, at single plates and at layers, with and
without friction, weakening and a rate, in both precisions."""


@pytest.mark.parametrize("index", SCENES)
def test_extremes(index: int) -> None:
    outcome = computed(drawn(np.random.default_rng([7, index]).random, hits=2))
    assert Status.NOT_FINITE not in outcome.statuses
    assert Status.GAINED_ENERGY not in outcome.statuses
    assert outcome.undefined == 0
    assert outcome.steep_rise <= MOST_RISE
    assert outcome.stretch <= MOST_STRETCH


def test_energy_of_a_needle_that_tumbles_while_it_spins() -> None:
    assert computed(drawn(np.random.default_rng([1, 4002]).random, hits=3)).steep_rise <= MOST_RISE
