"""The paper's literal scheme on a solid plate: its result depends on the time step (docs/model.md §4)."""

import numpy as np
import pytest

from .scenes import shots_at, simulate, solid_plate

# Residual velocity [m/s] that an independent march of the same scheme found, by time step [µs].
DRIFT = {1.0: 724.0, 0.5: 763.0, 0.2: 797.0, 0.1: 811.0, 0.05: 818.0, 0.01: 824.0}


def test_literal_scheme_has_no_limit_in_the_time_step(device: str) -> None:
    # A node in contact delivers Y Σ β^k dt = Y dt/(1 − β) in total, which vanishes with dt. Where the points fall
    # within a step is free: the nose's start relative to the face moved the figures by up to 3.5 m/s.
    residual = np.array(
        [
            simulate(solid_plate(), shots_at(), scheme="nodal", time_step=step * 1e-6, device=device).residual_velocity[
                0
            ]
            for step in DRIFT
        ]
    )
    assert residual == pytest.approx(list(DRIFT.values()), abs=4.0)
    assert (np.diff(residual) > 0).all()
