"""What each layer of a target resists with, shot by shot."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from warpimpact.solver.resolution import decay_rate

if TYPE_CHECKING:
    from warpimpact.scene import Core, Scene, Shots

Array = NDArray[np.float64]

ONSET = 0.02
"""Onset speed of contact in units of what full contact of a wall as deep as the plate does in one step."""


@dataclass(frozen=True)
class Materials:
    """Place and material of one layer in every shot: SI, each of shape [1] or [shots].

    Attributes:
        front: its front face behind that of the target.
        thickness: of the layer.
        offset_y, offset_z: place of its origin in the plane of the plate.
        a0, a1, friction, degradation, decay_rate: of the law (kernels/interaction.py).
        onset_jump: of the law if the core touches this layer alone; all the layers that it touches add theirs.
        most_jump: that of a layer of this material as thick as the core is long, which is the most that all can add.
        a2: likewise, one number.
        by_path: whether exposure counts the path of the core, not the time.
        weakens: whether β is below 1 in any shot.
    """

    front: Array
    thickness: Array
    offset_y: Array
    offset_z: Array
    a0: Array
    a1: Array
    friction: Array
    degradation: Array
    decay_rate: Array
    onset_jump: Array
    most_jump: Array
    a2: float
    by_path: bool
    weakens: bool


def materials_of(scene: Scene, shots: Shots) -> list[Materials]:
    """Those of all layers of a scene, front to back."""
    target = scene.target
    fronts = target.fronts([shots.own_of(target, "thickness", k) for k in range(len(target.layers))])
    return [_material(scene, shots, k, front) for k, front in enumerate(fronts)]


def _material(scene: Scene, shots: Shots, layer: int, front: Array) -> Materials:
    core, plate, mass = scene.core, scene.target.layers[layer], shots.own("mass", scene.core.mass_properties.mass)
    thickness, resistance, friction, degradation, offset_y, offset_z = (
        shots.own_of(scene.target, name, layer)
        for name in ("thickness", "resistance", "shear_coefficient", "degradation", "offset_y", "offset_z")
    )
    a0, a1, a2 = scene.interaction.coefficients(resistance, plate.density)
    return Materials(
        front=front,
        thickness=thickness,
        offset_y=offset_y,
        offset_z=offset_z,
        a0=a0,
        a1=a1,
        friction=friction,
        degradation=degradation,
        decay_rate=decay_rate(degradation, plate.degradation_unit),
        onset_jump=onset_jump(core, thickness, mass, a0),
        most_jump=onset_jump(core, np.array([core.length]), mass, a0),
        a2=a2,
        by_path=plate.degradation_distance is not None,
        weakens=bool((degradation < 1.0).any()),
    )


def onset_jump(core: Core, thickness: Array, mass: Array, static_stress: Array) -> Array:
    """Onset speed of contact per time step [m/s²] of cores of some masses [kg] in plates of some thicknesses [m] and
    static stresses [Pa], of their shape; positive, also for a plate without resistance."""
    wall = 2.0 * core.max_radius * np.minimum(thickness, core.length)
    return np.maximum(ONSET * static_stress * wall / mass, 1.0)
