"""Cores that break: when, where, by how much strength, and what is told of them (docs/model.md §8)."""

from typing import Any

import numpy as np
import pytest

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Record, Scene, Shots
from warpimpact.solver.simulate import simulate

from .scenes import PAPER_CORE, paper_plate, scattered_hits, shots_at


def outcomes(strength: float, shots: Shots, **scene: Any) -> Outcomes:
    core = PAPER_CORE.model_copy(update={"strength": strength})
    record = Record(standoffs=(0.05,), bending=True)
    return simulate(Scene(core=core, target=paper_plate(), record=record, **scene), shots, device="cpu")


@pytest.fixture(scope="module")
def hits() -> Shots:
    return shots_at(*scattered_hits(48))


def test_a_core_is_broken_where_its_stress_passes_its_strength(hits: Shots) -> None:
    ended = outcomes(2.5e9, hits)
    assert 0.1 < ended.broken.mean() < 0.9
    assert np.array_equal(ended.broken == 1.0, ended.bending_stress > 2.5e9)
    whole = ended.broken == 0.0
    for place in (ended.broken_time, ended.broken_x, ended.broken_section):
        assert np.array_equal(np.isnan(place), whole)
    assert (ended.broken_section[~whole] > 0.0).all()
    assert (ended.broken_section[~whole] < PAPER_CORE.length).all()
    # The section lies in the core, whose nose has gone v t at most since it touched the front face.
    assert (ended.broken_x[~whole] <= 825.0 * ended.broken_time[~whole] - 0.9 * ended.broken_section[~whole]).all()


def test_a_broken_core_goes_on_as_it_would_have(hits: Shots) -> None:
    weak, strong = outcomes(1.0, hits), outcomes(1e12, hits)
    for name in ("status", "residual_velocity", "tilt", "bending_stress"):
        assert np.array_equal(getattr(weak, name), getattr(strong, name), equal_nan=True), name
