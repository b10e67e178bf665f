"""Finite plates: a hit on a hole that was left out is a hit on a solid plate; elsewhere the plate is the unbounded
one."""

import numpy as np

from .scenes import paper_plate, shots_at, simulate, solid_plate

RIM = {"size": (48e-3, 48e-3), "margin": 4e-3}


def test_left_out_holes_are_solid_and_kept_ones_are_holes() -> None:
    # Slots reach 6 mm along z about 0, ±16 mm (even rows) and ±8 mm (odd rows); 20 mm are left along z.
    left_out, kept = (
        shots_at([0.0, 1.0e-3, -0.5e-3], [16e-3, 15e-3, -15e-3]),
        shots_at([0.0, 1.0e-3, 7e-3], [0.0, 3e-3, 9e-3]),
    )
    bounded = paper_plate(**RIM)
    solid = simulate(solid_plate(size=RIM["size"]), left_out).residual_velocity
    np.testing.assert_allclose(simulate(bounded, left_out).residual_velocity, solid, rtol=0, atol=1e-3)
    unbounded = simulate(paper_plate(), kept).residual_velocity
    np.testing.assert_allclose(simulate(bounded, kept).residual_velocity, unbounded, rtol=0, atol=0.02)
    assert np.abs(simulate(paper_plate(), left_out).residual_velocity - solid).min() > 5.0
