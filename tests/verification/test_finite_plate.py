"""Finite plates: holes in a cell as large as the plate are those of the unbounded plate; elsewhere it is solid."""

import numpy as np

from .scenes import paper_plate, shots_at, simulate, solid_plate

SIZE = (48e-3, 48e-3)
WHOLE = [(8e-3 * row, z) for row in range(-2, 3) for z in ([0.0] if row % 2 == 0 else [-8e-3, 8e-3])]


def test_holes_of_a_finite_plate_may_be_listed() -> None:
    # Slots reach 6 mm along z about 0, ±16 mm (even rows) and ±8 mm (odd rows); those at ±16 mm are left out.
    left_out, kept = (
        shots_at([0.0, 1.0e-3, -0.5e-3], [16e-3, 15e-3, -15e-3]),
        shots_at([0.0, 1.0e-3, 7e-3], [0.0, 3e-3, 9e-3]),
    )
    slots = paper_plate().pattern.model_copy(update={"holes": WHOLE, "spacing": SIZE, "staggered": False})
    bounded = paper_plate(size=SIZE, pattern=slots)
    solid = simulate(solid_plate(size=SIZE), left_out).residual_velocity
    np.testing.assert_allclose(simulate(bounded, left_out).residual_velocity, solid, rtol=0, atol=1e-3)
    unbounded = simulate(paper_plate(), kept).residual_velocity
    np.testing.assert_allclose(simulate(bounded, kept).residual_velocity, unbounded, rtol=0, atol=0.02)
    assert np.abs(simulate(paper_plate(), left_out).residual_velocity - solid).min() > 5.0
