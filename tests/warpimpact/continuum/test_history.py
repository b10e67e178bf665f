"""The history of a hit by finite elements, whose layers get their meshes one after the other."""

import numpy as np
import pytest

from warpimpact import CirclePattern, Continuum, Layer, Plate, Record, Scene, simulate
from warpimpact.catalogue.catalogue import flow_entry
from warpimpact.continuum import meshing, one_hit
from warpimpact.continuum.replay import replay_continuum
from warpimpact.kernels.status import Status
from warpimpact.scene import PolynomialCore, Shots

CORE = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, mass=4.0e-3)
HOLES = CirclePattern(diameter=5e-3, spacing=(9e-3, 9e-3))
PLATE, GAP, BASE = Plate(thickness=4e-3, resistance=2.6e9, pattern=HOLES), 20e-3, 2e-3
SHOT = Shots(*(np.array([value]) for value in (2e-3, 0.0, 825.0, 0.0, 0.0, 0.0, 0.0, 0.0)))


def test_a_layer_is_at_rest_until_it_has_its_mesh(monkeypatch: pytest.MonkeyPatch) -> None:
    """The first picture shows the base as it lies, the last one with what the core has left; the end has the same bits
    as without a history."""
    monkeypatch.setattr(meshing, "PATCH", 3.5)
    monkeypatch.setattr(one_hit, "LARGEST_HOURGLASS_SHARE", 1.0)
    layer = Layer(thickness=BASE, resistance=2.6e9, gap=GAP)
    scene = Scene(core=CORE, target=(PLATE, layer), record=Record(standoffs=(0.05,)))
    continuum = Continuum(flows=(flow_entry("ARMOX560T").flow,), spacing=1e-3)
    replayed = replay_continuum(scene, SHOT, continuum)
    outcomes, deformed = simulate(scene, SHOT, numerics=continuum), replayed.deformed
    assert outcomes.status[0] == Status.PERFORATED
    assert replayed.outcomes.residual_velocity[0] == outcomes.residual_velocity[0]
    assert deformed is not None
    middles = deformed.position[:, deformed.corners].mean(axis=2)
    front = PLATE.thickness + GAP
    of_base = middles[0, :, 0] > front - 1e-3
    assert of_base.any()
    assert deformed.position[0, :, 0].max() == pytest.approx(front + BASE)
    assert deformed.left[0].all()
    assert not deformed.left[-1, of_base].all()
    assert deformed.strain[-1, ~of_base].max() > 0.0
    assert deformed.strain[0, of_base].max() == 0.0
    assert deformed.strain[-1, of_base & deformed.left[-1]].max() > 0.1
