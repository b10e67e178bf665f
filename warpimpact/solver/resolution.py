"""Patches, grid and time step of a scene, from what its numerics give (docs/model.md §4); materials of its layers."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import reduce
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.errors import TooLong
from warpimpact.scene import Core, NoPattern, Scene, Shots, Target
from warpimpact.scene.interaction import TERMS, coefficients
from warpimpact.scene.quantities import BY_LAYER
from warpimpact.solver.settings import FastLawSettings

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Level:
    """Settings of one level of resolution; lengths scale with the scene (docs/model.md §4's table)."""

    patches_axial: int
    patches_around: int
    cells_per_length: float
    """Cells per degradation length ℓ."""
    travel: float
    """Way per time step at impact velocity, as a share of the thickness of the plate, or of THICK_PLATE_SHARE times the
    core's length where the plate is thicker than that."""

    @property
    def patch_width(self) -> float:
        """Largest width of a patch as the plate sees it, in degradation lengths. Wider patches leave gaps in the
        exposure, and weaken the plate under themselves too much. It is the width for the paper's core (R = 3.02 mm, ℓ =
        0.5 mm) at which the patches of two neighbouring rings together close the circle."""
        return 19.0 / self.patches_around


THICK_PLATE_SHARE = 1.0 / 7.0
LARGEST_SIDE_STEP = 1.6
"""Largest way of a step in the plane of a plate, in degradation lengths and per unit of `travel`. Contact that sweeps
farther sideways leaves gaps in the exposure, and jumps over edges of holes."""

LARGEST_WEAKENING = 2.7
"""Largest decrease of ln(resistance) in a step of permanent contact, per unit of `travel`. Exposure counts as it is in
mid-step, and a longer step leaves too little of a plate that weakens at once."""

LARGEST_ENERGY_LOSS = 0.25
"""Largest share of the core's energy that a step may take if the plate acts on the core's whole cross section, per unit
of `travel`. Otherwise a core near the limit velocity would lose most of its energy in one step. It shortens no step of
the paper's shots."""

SLOWEST_DECAY = 1.0e-30
"""Rate of decay below which nothing weakens [1/s]."""
SMALLEST_STRESS = 1.0
"""Stress below which nothing slows down [Pa]."""

STEP_ALLOWANCE = 200
"""Ratio of the way at impact velocity after which a shot is given up to the way of an unhindered passage."""
MOST_STEPS = 10**7
"""Most steps of an unhindered passage. A shot may take STEP_ALLOWANCE times as many, and they are counted in 32
bits."""
UNBREAKABLE = 1.0e30
"""Strength of a core without a strength [Pa], beyond any stress."""

LADDER = (
    Level(14, 16, 1.0, 0.5),
    Level(18, 24, 1.2, 0.42),
    Level(23, 32, 1.5, 0.37),
    Level(28, 40, 1.5, 0.28),
    Level(32, 48, 2.0, 0.2),
    Level(44, 60, 2.5, 0.14),
    Level(60, 80, 3.5, 0.1),
    Level(84, 108, 5.0, 0.07),
    Level(116, 148, 7.0, 0.05),
    Level(160, 204, 10.0, 0.035),
)
"""Levels of resolution, coarse to fine: patches, grid and step are refined together. The error about halves from one
to the next, and the cost about doubles."""

NODAL_SETTINGS: dict[str, Any] = {
    "patches_axial": 36,
    "patches_around": 36,
    "grid_spacing": 1.0e-5,
    "time_step": 1.0e-6,
}
"""The paper's own resolution. Its time step is the one that reproduces its rows (docs/model.md §4)."""


def level_of(numerics: FastLawSettings) -> Level:
    """The level that supplies the settings which the numerics do not give."""
    return LADDER[coarsest_level(numerics.required.strictness) if numerics.level is None else numerics.level]


def coarsest_level(strictness: float) -> int:
    """The first level that is tried for an accuracy, by how many times as strict as draft it is."""
    return int(np.clip(math.floor(math.log2(max(strictness, 1.0)) + 1e-9), 0, len(LADDER) - 3))


@dataclass(frozen=True)
class Resolution:
    """Settings of the fast law with every choice made: SI. The time step is fixed, or follows from the way per step."""

    nodal: bool
    time_step: float | None
    travel: float
    """Way per step at impact velocity, as a share of the passage, which is the thickness of the plate or, if less,
    `slender` [m]. A step longer than the passage, also a given one, jumps over what happens in the plate."""
    slender: float
    section: float
    """The core's largest cross section [m²]."""
    patches_axial: int
    patches_around: int
    grid_spacing: float
    """Spacing of the grid in the plate [m]; in a layer it is proportional to the degradation length."""
    double: bool
    block: bool
    """Whether a block of threads computes a shot."""
    patch_width: float
    """Largest radial width of a ring [m]."""

    @property
    def slowing(self) -> float:
        """Largest share of the speed that contact may take in a step."""
        return 0.5 * LARGEST_ENERGY_LOSS * self.travel


def resolve(scene: Scene, numerics: FastLawSettings, weakening: Sequence[bool]) -> Resolution:
    """Fill in what the numerics do not give.

    Args:
        weakening: whether each layer weakens.
    """
    core, every = scene.core, [layer.degradation_length for layer in scene.target.layers]
    nodal, level = numerics.scheme == "nodal", level_of(numerics)
    finest = min((length for length, does in zip(every, weakening, strict=True) if does), default=every[0])
    width = level.patch_width * finest if any(weakening) else math.inf
    defaults: dict[str, Any] = {
        "time_step": None,
        "patches_axial": level.patches_axial,
        "patches_around": max(level.patches_around, 4 * math.ceil(0.25 * math.pi * core.max_radius / width)),
        "grid_spacing": every[0] / level.cells_per_length,
    }
    if nodal:
        defaults = NODAL_SETTINGS
    given = {name: getattr(numerics, name) for name in defaults if getattr(numerics, name) is not None}
    travel = level.travel if numerics.travel is None else numerics.travel
    return Resolution(
        nodal=nodal,
        double=numerics.precision == "double",
        block=numerics.layout == "block",
        travel=travel,
        slender=THICK_PLATE_SHARE * core.length,
        section=math.pi * core.max_radius**2,
        patch_width=math.inf if nodal else width,
        **(defaults | given),
    )


def layer_steps(scene: Scene, shots: Shots, materials: Sequence[Materials], resolution: Resolution) -> list[Array]:
    """Time steps in all layers [s], each of shape [shots].

    A step is a share of the passage, the way on which a plate acts on a core. Down to a quarter of this, it is so short
    that contact weakens the layer, slows down the core, and sweeps along the plane by no more than it may. In the
    plane, a layer behind another one has no bound where it is and stays homogeneous.
    """
    mass, velocity = shots.value("mass", scene.core.mass_properties.mass), shots.velocity
    travel, steps = resolution.travel, list[Array]()
    for k, (layer, material) in enumerate(zip(scene.target.layers, materials, strict=True)):
        passage = np.minimum(material.thickness, resolution.slender)
        longest, weakened = (
            travel * passage,
            LARGEST_WEAKENING * travel / np.maximum(-material.decay_rate, SLOWEST_DECAY),
        )
        stopping = resolution.section * np.maximum(material.a0, SMALLEST_STRESS)
        slowed = resolution.slowing * mass * velocity / stopping
        time = np.minimum(weakened / velocity if material.by_path else weakened, slowed)
        is_uniform = isinstance(layer.pattern, NoPattern) and layer.size is None and not material.weakens
        along = math.inf if k > 0 and is_uniform else LARGEST_SIDE_STEP * travel * layer.degradation_length
        aslant = along / np.maximum(np.sin(shots.obliquity), 1e-9)
        way = np.clip(np.minimum(aslant, time * velocity), 0.25 * longest, longest)
        way = way if resolution.time_step is None else resolution.time_step * velocity
        steps.append(np.minimum(way, passage) / velocity)
    return steps


def conditions_of(
    scene: Scene, shots: Shots, materials: Sequence[Materials], steps: Sequence[Array]
) -> dict[str, Array]:
    """The conditions of every shot, under the names of the kernels' Shots; of shape [1] where all shots share one."""
    core, target = scene.core, scene.target
    body = core.mass_properties
    mass, depth = shots.value("mass", body.mass), materials[-1].front + materials[-1].thickness
    scale = mass / body.mass  # the whole body is scaled, so its moments of inertia are, too
    gaps = sum(target.gaps)
    return {name: values for name, values in shots.columns.items() if name not in BY_LAYER} | {
        "mass": mass,
        "inertia_axial": scale * body.inertia_axial,
        "inertia_transverse": scale * body.inertia_transverse,
        "strength": shots.value("strength", UNBREAKABLE if core.strength is None else core.strength),
        "onset_share": shots.value("onset", scene.interaction.onset),
        "time_step": reduce(np.minimum, steps),
        "longest_way": STEP_ALLOWANCE * (depth - gaps + 2.0 * len(materials) * core.bounding_radius) + gaps,
    }


def steps_of(shots: Shots, conditions: dict[str, Array]) -> Array:
    """Numbers of steps of unhindered passages, shape [shots], for the `conditions_of` the shots.

    Raises:
        TooLong: a passage takes more than MOST_STEPS.
    """
    step = conditions["time_step"]
    steps = conditions["longest_way"] / STEP_ALLOWANCE / (step * shots.velocity)
    if (most := float(steps.max())) > MOST_STEPS:
        raise TooLong(
            f"a passage through the target takes {most:.3g} steps of {1e9 * float(step.min()):.3g} ns, but at most "
            f"{MOST_STEPS:.0e} are computed; the thinnest layer and numerics.time_step set the step"
        )
    return np.asarray(steps)


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
    terms = {name: shots.value(name, getattr(interaction, name)) for name in TERMS}
    materials = []
    for k, plate in enumerate(target.layers):
        own = {name: shots.layer_value(target, name, k) for name in ("degradation", "offset_y", "offset_z")}
        law = coefficients(terms, shots.layer_value(target, "resistance", k), plate.density)
        materials.append(
            Materials(
                front=fronts[k],
                thickness=thickness[k],
                **own,
                **law,
                friction=shots.layer_value(target, "shear_coefficient", k),
                decay_rate=decay_rate(own["degradation"], plate.degradation_unit),
                onset_jump=onset_jump(core, thickness[k], mass, law["a0"]),
                most_jump=onset_jump(core, np.array([core.length]), mass, law["a0"]),
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
