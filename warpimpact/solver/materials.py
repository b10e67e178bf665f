"""The material of each layer in every shot."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from warpimpact.scene import Core, Scene, Shots, Target
from warpimpact.scene.interaction import coefficients

Array = NDArray[np.float64]

ONSET = 0.02
"""Onset speed of contact, as a share of the speed that full contact of a wall as deep as the plate takes in a step."""
FASTEST_DECAY = 1.0e30
"""Largest rate of decay of the resistance [1/s]. β = 0 takes all resistance at the first touch; its rate is beyond any
exposure, yet finite, because 0 × ∞ is no number."""


@dataclass(frozen=True)
class Materials:
    """Place and material of one layer in every shot: SI, each of shape [1] or [shots].

    Attributes:
        front: distance of its front face behind that of the target.
        thickness: thickness of the layer.
        offset_y, offset_z: place of its origin in the plane of the plate.
        a0, a1, a2, friction, degradation, decay_rate: coefficients of the law (kernels/interaction.py).
        onset_jump: onset speed per time step if the core touches this layer alone. Layers in contact add theirs.
        most_jump: onset jump of a layer of this material as thick as the core is long, the most that all layers
            together can add.
        per_reach: 1 / λH of a free surface [1/m]; 0 without one.
        by_path: whether exposure counts the path of the core instead of the time.
        weakens: whether it remembers contact.
    """

    front: Array
    thickness: Array
    offset_y: Array
    offset_z: Array
    a0: Array
    a1: Array
    a2: Array
    friction: Array
    degradation: Array
    decay_rate: Array
    onset_jump: Array
    most_jump: Array
    per_reach: Array
    by_path: bool
    weakens: bool


def materials_of(scene: Scene, shots: Shots) -> list[Materials]:
    """The Materials of all layers of a scene, front to back."""
    target = scene.target
    weakening = weakens(target, shots)
    thickness = [shots.layer_value(target, "thickness", k) for k in range(len(target.layers))]
    fronts = target.fronts(thickness)
    core, interaction, free = scene.core, scene.interaction, scene.interaction.free_surface
    mass = shots.value("mass", core.mass_properties.mass)
    static, linear, quadratic = (
        shots.value(name, getattr(interaction, name)) for name in ("static", "linear", "quadratic")
    )
    materials = []
    for k, plate in enumerate(target.layers):
        resistance, friction, degradation, offset_y, offset_z = (
            shots.layer_value(target, name, k)
            for name in ("resistance", "shear_coefficient", "degradation", "offset_y", "offset_z")
        )
        a0, a1, a2 = coefficients(static, linear, quadratic, resistance, plate.density)
        materials.append(
            Materials(
                front=fronts[k],
                thickness=thickness[k],
                offset_y=offset_y,
                offset_z=offset_z,
                a0=a0,
                a1=a1,
                a2=a2,
                friction=friction,
                degradation=degradation,
                decay_rate=decay_rate(degradation, plate.degradation_unit),
                onset_jump=onset_jump(core, thickness[k], mass, a0),
                most_jump=onset_jump(core, np.array([core.length]), mass, a0),
                per_reach=np.zeros(1) if free is None else 1.0 / (free.reach * thickness[k]),
                by_path=plate.degradation_distance is not None,
                weakens=weakening[k],
            )
        )
    return materials


def weakens(target: Target, shots: Shots | None = None) -> list[bool]:
    """Whether each layer weakens. A layer whose degradation differs from shot to shot counts as one that does."""
    return [
        layer.degradation < 1.0 or (shots is not None and shots.varies("degradation", k))
        for k, layer in enumerate(target.layers)
    ]


def onset_jump(core: Core, thickness: Array, mass: Array, static_stress: Array) -> Array:
    """Onset speed of contact per time step [m/s²] for masses [kg], thicknesses [m] and static stresses [Pa] of the same
    shape. It is positive even for a plate without resistance."""
    wall = 2.0 * core.max_radius * np.minimum(thickness, core.length)
    return np.maximum(ONSET * static_stress * wall / mass, 1.0)


def decay_rate(degradation: Array, unit: float) -> Array:
    """ln(β)/Δt_β [1/s], or ln(β)/Δs_β [1/m], of the shape of β."""
    log = np.log(degradation, where=degradation > 0.0, out=np.full_like(degradation, -np.inf))
    return np.maximum(log / unit, -FASTEST_DECAY)
