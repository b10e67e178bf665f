"""What a shot takes, before it is computed (`Prepared.seconds`)."""

from typing import Any

import pytest

from warpimpact.scene import (
    Hits,
    Impact,
    Layer,
    Numerics,
    Plate,
    PolynomialCore,
    Scene,
    Target,
    make_shots,
)
from warpimpact.solver import prepare as preparing
from warpimpact.solver.prepare import Prepared, prepare

CORE = PolynomialCore(coefficients=(3e-4, 0.24, -5.29), length=27.86e-3, mass=4e-3)
PLATE = Plate(thickness=6e-3, resistance=2.6e9, degradation=0.8)
IMPACT = Impact(velocity=825.0)


def prepared(plate: Plate = PLATE, *behind: Layer, **numerics: Any) -> Prepared:
    scene = Scene(core=CORE, target=Target(layers=(plate, *behind)))
    return prepare(scene, make_shots(IMPACT, Hits(count=2), plate), Numerics(**({"level": 2} | numerics)))


def of_steps(found: Prepared) -> float:
    return found.seconds - preparing.PER_BYTE * found.window_bytes


def test_a_plate_that_weakens_takes_the_nodes_below_the_core_in_each_step() -> None:
    found, still = prepared(), prepared(PLATE.model_copy(update={"degradation": 1.0}))
    assert still.window_bytes == 0 < found.window_bytes
    nodes = (2.0 * CORE.max_radius / found.grid.spacing) ** 2
    steps = (6e-3 + CORE.length) / (float(found.conditions["time_step"][0]) * 825.0)
    assert nodes > 100.0
    assert of_steps(found) / steps - preparing.PER_NODE * nodes == pytest.approx(
        preparing.PER_PATCH * len(found.surfaces[0].rings.station) * found.resolution.patches_around
    )


def test_twice_as_many_steps_take_twice_as_long() -> None:
    coarse, fine = (prepared(travel=travel, grid_spacing=0.3e-3) for travel in (0.1, 0.05))
    assert of_steps(fine) == pytest.approx(2.0 * of_steps(coarse))
