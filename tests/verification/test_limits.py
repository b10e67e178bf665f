"""Limit velocities and thicknesses against closed forms (docs/model.md §6.1, 6.2, 6.4, 6.8, 6.9)."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import brentq

from warpimpact.kernels.status import Status
from warpimpact.scene import ConeCore, Core, Interaction, Plate, Scene, Shots
from warpimpact.solver.device import Worker
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.limit import HIGHEST_VELOCITY, MOST_RUNS, Limits, LimitSpec
from warpimpact.solver.limit import limits as search

from . import references, scenes
from .scenes import PAPER_CORE, paper_plate, scattered_hits, shots_at, solid_plate

REFERENCE = FastLaw(**scenes.REFERENCE)
MIDDLE = FastLaw(level=2)
SMOOTH = 1e-9
"""No friction to speak of, in the build of the kernels that has it."""


def actual(
    plate: Plate,
    shots: Shots,
    *,
    core: Core = PAPER_CORE,
    law: Interaction | None = None,
    numerics: FastLaw = REFERENCE,
    tolerance: float = 0.5,
    highest: float = HIGHEST_VELOCITY,
) -> Limits:
    """Limit velocities, after the checks that hold of any."""
    scene = Scene(core=core, target=plate, interaction=law or Interaction())
    limits = search(scene, shots, LimitSpec("velocity", tolerance, highest), numerics, Worker("cpu"))
    assert limits.converged.all()
    assert (limits.runs <= MOST_RUNS).all()
    assert (limits.lower <= limits.value).all()
    assert (limits.value <= limits.upper).all()
    return limits


# ½ m v² = Y h 2π [r(0)²/2 + ∫ share (r' + η) r ds]. Measured: 0.16 and 0.33 m/s too low, of the step in which a core
# that has nearly stopped leaves; the standard fidelity is 0.7 and 3.1 m/s too low.
@pytest.mark.parametrize(("shear_coefficient", "tolerance", "onset"), [(SMOOTH, 0.3, 0.0), (0.05, 1.2, 0.005)])
def test_energy_at_the_limit_is_the_work_of_the_plate(shear_coefficient: float, tolerance: float, onset: float) -> None:
    shot = {"thickness": 4e-3, "resistance": 2.6e9, "shear_coefficient": shear_coefficient, "onset": onset}
    expected = np.sqrt(825.0**2 - references.solid_plate_residual(velocity=825.0, **shot) ** 2)
    plate, law = solid_plate(degradation=1.0, shear_coefficient=shear_coefficient), Interaction(onset=onset)
    # A search may begin far above the limit, near it, or far below.
    limits = actual(plate, shots_at([0.0, 0.3e-3, 0.0], velocity=[825.0, 480.0, 60.0]), law=law)
    assert limits.value == pytest.approx(expected, abs=tolerance)
    assert limits.runs.mean() < 9.0


def test_limit_thickness_and_limit_velocity_are_one_limit() -> None:
    plate = solid_plate(degradation=1.0)
    limits = actual(plate, shots_at(), tolerance=0.1)
    scene = Scene(core=PAPER_CORE, target=plate)
    shots = shots_at(velocity=[limits.value[0], limits.value[0] * np.sqrt(2.0)])
    thick = search(scene, shots, LimitSpec.of(scene, "thickness", tolerance=2e-6), REFERENCE, Worker("cpu"))
    assert thick.converged.all()
    # The step follows the thickness: twice the plate, twice the step. Measured: 0.1 % at most.
    assert thick.value == pytest.approx([4e-3, 8e-3], rel=4e-3)
    assert (thick.lower < thick.value).all()
    assert (thick.value < thick.upper).all()


# m v dv/dX = −(F0 + F2 v²): the impact velocity of which nothing is left. Measured: off by 0.02 and 0.002 m/s.
def test_limit_velocity_of_poncelets_law() -> None:
    shear_coefficient = 0.05
    core = ConeCore(diameter=6e-3, length=25e-3, cone_length=10e-3, mass=4e-3)
    nose = references.cone_nose(diameter=6e-3, length=10e-3)

    def left(velocity: float) -> float:
        law = references.Poncelet(nose, 4e-3, velocity, 1.2e9, 7850.0, shear_coefficient, 0.005)
        try:
            if law.depth_of_rest > 12e-3:
                return law.residual_velocity(12e-3)
        except ValueError:  # it comes to rest while the nose enters or leaves
            pass
        return -1.0

    expected = brentq(left, 300.0, 800.0, xtol=0.01)
    plate = solid_plate(thickness=12e-3, resistance=1.2e9, shear_coefficient=shear_coefficient, degradation=1.0)
    law = Interaction(static=1.0, quadratic=1.0)
    assert actual(plate, shots_at(), core=core, law=law).value == pytest.approx(expected, abs=0.2)


def test_a_core_passes_at_the_upper_end_and_is_stopped_at_the_lower_one() -> None:
    hit_y, hit_z = scattered_hits(24)
    plate = paper_plate(degradation_interval=None, degradation_distance=0.825e-3)
    shots = shots_at(hit_y, hit_z, obliquity=30.0, yaw=2.0)
    limits = actual(plate, shots, numerics=MIDDLE, tolerance=1.0)
    assert (limits.upper - limits.lower <= 1.0).all()
    assert (limits.outcomes.status == Status.PERFORATED).all()
    assert (limits.shots.velocity == limits.upper).all()
    below = replace(shots, velocity=limits.lower)
    again = actual(plate, below, numerics=MIDDLE, tolerance=1.0, highest=float(limits.lower.max()))
    assert (again.outcomes.status[again.runs == 1] != Status.PERFORATED).all()
