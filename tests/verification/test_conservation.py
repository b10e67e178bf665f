"""Each step of hard, glancing and tumbling shots: energy never grows, and momentum is impulse (docs/model.md §4, 5)."""

from dataclasses import dataclass, field
from functools import cache
from typing import Any

import numpy as np
import pytest

from warpimpact.scene import Plate, Shots

from .scenes import PAPER_CORE, History, histories, paper_plate, scattered_hits, shots_at, solid_plate

HITS = scattered_hits(12)
SLOW = np.linspace(50.0, 150.0, 12)
EPSILON = {"single": 2.0**-23, "double": 2.0**-52}


@dataclass(frozen=True)
class Scene:
    plate: Plate
    shot: dict[str, Any] = field(default_factory=dict)

    @property
    def shots(self) -> Shots:
        return shots_at(*HITS, **self.shot)


SCENES = {
    "normal": Scene(paper_plate()),
    "glancing at 70 degrees": Scene(paper_plate(), {"obliquity": 70.0, "azimuth": 40.0}),
    "tumbling past 90 degrees": Scene(paper_plate(), {"pitch": 60.0, "velocity": 300.0}),
    "slow against a rigid, rough plate": Scene(
        paper_plate(shear_coefficient=1.0, resistance=1e12), {"velocity": SLOW, "pitch": 3.0}
    ),
    "slow, tilted and spinning": Scene(
        paper_plate(shear_coefficient=1.0), {"velocity": SLOW, "pitch": 20.0, "spin": 3e3}
    ),
    "thick": Scene(solid_plate(thickness=30e-3), {"yaw": 10.0, "obliquity": 30.0}),
}
PRECISIONS = pytest.mark.parametrize("precision", list(EPSILON))
EVERY_SCENE = pytest.mark.parametrize("name", list(SCENES))


@cache
def traced(name: str, precision: str) -> list[History]:
    scene = SCENES[name]
    return histories(scene.plate, scene.shots, precision=precision)


@EVERY_SCENE
@PRECISIONS
def test_kinetic_energy_never_grows_in_any_step(name: str, precision: str) -> None:
    # Every element's power is ≤ 0. Rounding of the state alone makes up to 1.7 ε of the impact energy (measured).
    shots, spin_inertia = SCENES[name].shots, PAPER_CORE.mass_properties.inertia_axial
    for k, history in enumerate(traced(name, precision)):
        impact = 0.5 * (PAPER_CORE.mass_properties.mass * shots.velocity[k] ** 2 + spin_inertia * shots.spin[k] ** 2)
        growth = np.diff([impact, *history.energy])
        assert growth.max() <= 4 * EPSILON[precision] * impact
        assert history.energy[-1] < impact


@EVERY_SCENE
def test_change_of_momentum_is_the_impulse_of_the_load(name: str) -> None:
    # m Δv = F Δt and ΔL = M Δt in every step, and so over the whole shot. The rounding errors of the steps are
    # independent, and each is less than one ε (measured: 0.3 ε).
    shots, mass, reach = SCENES[name].shots, PAPER_CORE.mass_properties.mass, PAPER_CORE.bounding_radius
    for k, history in enumerate(traced(name, "double")):
        step = history.time[1] - history.time[0]
        momentum = mass * shots.velocity[k]
        rounding = 2 * EPSILON["double"] * momentum
        change = mass * np.diff(history.velocity, axis=0)
        assert change == pytest.approx(step * history.force[1:], abs=rounding, rel=1e-7)
        turning = np.diff(history.angular_momentum, axis=0)
        assert turning == pytest.approx(step * history.moment[1:], abs=rounding * reach, rel=1e-7)
