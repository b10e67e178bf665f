"""Settings of the fast law with every choice made."""

import numpy as np
import pytest

from warpimpact.errors import TooLong
from warpimpact.scene import Plate, PolynomialCore, Scene
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.prepare import prepare
from warpimpact.solver.resolution import LADDER, LARGEST_WEAKENING, MOST_STEPS, THICK_PLATE_SHARE

from ...verification.scenes import shots_at

PAPER = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, density=7850.0)
PLATE = Plate(thickness=4e-3, resistance=2.6e9, degradation_length=0.6e-3)
SCENE = Scene(core=PAPER, target=PLATE)


def step_at(plate: Plate) -> float:
    """The time step at 800 m/s."""
    scene, shots = Scene(core=PAPER, target=plate), shots_at(np.zeros(1), velocity=800.0)
    return prepare(scene, shots, FastLaw(level=2)).conditions["time_step"].item()


def test_way_per_step_follows_the_plate_or_a_core_shorter_than_it() -> None:
    ways = [800.0 * step_at(PLATE.model_copy(update={"thickness": h, "resistance": 0.0})) for h in (1e-3, 1.0)]
    np.testing.assert_allclose(ways, LADDER[2].travel * np.array([1e-3, THICK_PLATE_SHARE * PAPER.length]))


def test_step_is_bounded_by_what_contact_takes_off_the_resistance() -> None:
    free = step_at(PLATE.model_copy(update={"resistance": 0.0}))
    for degradation, interval in ((1.0, 1e-6), (0.9, 1e-6), (0.05, 1e-6), (0.05, 1e-9), (0.0, 1e-6)):
        plate = PLATE.model_copy(update={"degradation": degradation, "degradation_interval": interval})
        bound = np.inf if degradation == 1.0 else 0.0
        if 0.0 < degradation < 1.0:
            bound = LARGEST_WEAKENING * LADDER[2].travel * interval / -np.log(degradation)
        assert step_at(plate) == pytest.approx(min(free, max(bound, 0.25 * free)))


def test_a_shot_of_too_many_steps_is_refused() -> None:
    steps = prepare(SCENE, shots_at(np.zeros(1)), FastLaw(time_step=1e-7)).steps
    shortest = 1e-7 * steps / MOST_STEPS
    slow = prepare(SCENE, shots_at(np.zeros(1)), FastLaw(time_step=1.1 * shortest))
    assert slow.steps == pytest.approx(MOST_STEPS / 1.1, rel=0.05)
    with pytest.raises(TooLong, match=r"takes 1\..*e\+07 steps of .* ns, but at most 1e\+07 are computed"):
        prepare(SCENE, shots_at(np.zeros(1)), FastLaw(time_step=0.9 * shortest))
