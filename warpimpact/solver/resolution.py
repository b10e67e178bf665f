"""From a scene to the arrays that the kernels read: rings of the core, tile of the plate, filter, time step."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpimpact.scene import Impact, Numerics, Plate, Scene, Shots, Target

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Fidelity:
    """Numbers behind a named fidelity; lengths scale with the scene (docs/model.md §4's table)."""

    patches_axial: int
    patches_around: int
    cells_per_length: float
    """Cells per degradation length ℓ."""
    travel: float
    """Way per time step at impact velocity, as a share of the thickness of the plate, or of SLENDER times the
    core's length where the plate is thicker than that."""
    double: bool = False
    block: bool = False
    """Whether a block of threads computes a shot (kernels/block.py)."""

    @property
    def patch_width(self) -> float:
        """Widest patch as the plate sees it, in degradation lengths: wider ones leave gaps in the exposure, and
        weaken the plate under themselves too much. It is that of the paper's core (R = 3.02 mm, ℓ = 0.5 mm), for
        which the patches of two neighbouring rings together go round."""
        return 19.0 / self.patches_around


SLENDER = 1.0 / 7.0
ALONG = 1.6
"""Way of a step in the plane of the plate, in degradation lengths and per unit of `travel`: contact that sweeps
sideways by more than that leaves gaps in the exposure."""

WEAKENING = 2.7
"""ln of what a step may take off the resistance where it acts all the time, per unit of `travel`: exposure counts as
it is in mid-step, and a longer step leaves too little of a plate that weakens at once."""

SLOWING = 0.25
"""Share of the core's energy that a step may take if the plate acts on the whole cross section of the core, per unit of
`travel`: near the limit velocity a core would else lose most of its energy in one step. No step of the paper's shots is
shortened by it."""

FIDELITIES = {
    "draft": Fidelity(14, 16, 1.0, 0.5),
    "standard": Fidelity(23, 32, 1.5, 0.37),
    "reference": Fidelity(64, 56, 5.0, 0.05),
}
"""What `simulate` takes for a name; a campaign takes the level of LADDER that keeps the promise (solver/promise.py)."""

LADDER = (
    Fidelity(14, 16, 1.0, 0.5),
    Fidelity(18, 24, 1.2, 0.42),
    Fidelity(23, 32, 1.5, 0.37),
    Fidelity(28, 40, 1.5, 0.28),
    Fidelity(32, 48, 2.0, 0.2),
    Fidelity(44, 60, 2.5, 0.14),
    Fidelity(60, 80, 3.5, 0.1),
    Fidelity(84, 108, 5.0, 0.07),
    Fidelity(116, 148, 7.0, 0.05),
    Fidelity(160, 204, 10.0, 0.035),
)
"""Levels of resolution, coarse to fine: patches, grid and step are refined together. The error about halves from one
to the next, and the cost about doubles."""

NODAL: dict[str, Any] = {
    "patches_axial": 36,
    "patches_around": 36,
    "grid_spacing": 1.0e-5,
    "time_step": 1.0e-6,
}
"""The paper's own resolution; its time step is the one that meets its rows (docs/model.md §4)."""


ONE_PLATE = "the nodal scheme knows one plate and no layers behind it; the consistent scheme takes layers"


def level(index: int, numerics: Numerics) -> Fidelity:
    """A level of the ladder, in precision and layout of the numerics."""
    return computed_as(LADDER[index], numerics)


def computed_as(fidelity: Fidelity, numerics: Numerics) -> Fidelity:
    """A fidelity in precision and layout of the numerics."""
    return replace(fidelity, double=numerics.precision == "double", block=numerics.layout == "block")


@dataclass(frozen=True)
class Resolution:
    """Numerics with every choice made: SI. The time step is fixed, or follows from the way per step."""

    nodal: bool
    time_step: float | None
    travel: float
    """Way per step at impact velocity, as a share of the passage: the thickness of the plate, or `slender` [m] where
    that is less. A step, also a given one, that is longer than the passage jumps over what happens in the plate."""
    slender: float
    way_along: float
    """The most of a step's way that may lie in the plane of the plate [m], if a quarter of it is enough for that."""
    weakening: float
    """The most that contact may take off ln of the resistance in a step, likewise."""
    slowing: float
    """The most that contact may take off the energy in a step, likewise, over twice the cross section [1/m²]."""
    mass: float
    """Of the core, where no other is given [kg]."""
    static: float
    """Static stress over the resistance."""
    patches_axial: int
    patches_around: int
    grid_spacing: float
    """In the plate [m]; in a layer in proportion to its degradation length."""
    double: bool
    block: bool
    """Whether a block of threads computes a shot."""
    patch_width: float
    """No ring is wider than this radially [m]."""

    def passage(self, thickness: ArrayLike) -> Array:
        """Way [m] on which the plate acts on a core, for some thicknesses [m], of their shape."""
        return np.minimum(thickness, self.slender)

    def longest_time(
        self, degradation: Array, plate: Plate, velocity: ArrayLike, mass: ArrayLike, static_stress: ArrayLike
    ) -> Array:
        """Time [s] in which contact weakens a plate, and slows down a core, by as much as a step may, for some β,
        impact velocities [m/s], masses [kg] and static stresses [Pa], of their shape."""
        longest = self.weakening / np.maximum(-decay_rate(degradation, plate.degradation_unit), SLOWEST_DECAY)
        weakened = longest if plate.degradation_distance is None else longest / np.asarray(velocity)
        slowed = self.slowing * np.asarray(mass) * np.asarray(velocity) / np.maximum(static_stress, SMALLEST_STRESS)
        return np.asarray(np.minimum(weakened, slowed))

    def step_at(
        self, velocity: ArrayLike, obliquity: ArrayLike, thickness: ArrayLike, longest_time: ArrayLike
    ) -> Array:
        """Time steps [s] at impact velocities [m/s], obliquities [rad], thicknesses of the plate [m] and `longest_time`
        [s], of their shape."""
        passage = self.passage(thickness)
        longest = self.travel * passage
        aslant = self.way_along / np.maximum(np.sin(obliquity), 1e-9)
        way = np.clip(np.minimum(aslant, np.multiply(longest_time, velocity)), 0.25 * longest, longest)
        if self.time_step is not None:
            way = self.time_step * np.asarray(velocity)
        return np.asarray(np.minimum(way, passage) / velocity)

    def step_of(self, impact: Impact, plate: Plate) -> float:
        """Time step [s] of a plate that stands alone, or where it scatters, of its means."""
        stress = self.static * plate.resistance
        longest_time = self.longest_time(np.array(plate.degradation), plate, impact.velocity, self.mass, stress)
        return float(self.step_at(impact.velocity, impact.obliquity, plate.thickness, longest_time))

    def step_in(self, impact: Impact, target: Target) -> float:
        """Time step [s] of a target, likewise: that of the layer that needs the shortest."""
        return min(self.step_of(impact, plate) for plate in target.layers)


def resolve(numerics: Numerics | Fidelity, scene: Scene, shots: Shots | None = None) -> Resolution:
    """Fill in what the numerics leave to fidelity and scheme; a fidelity need not have a name.

    Args:
        shots: whose own quantities count, too.
    """
    core, plate, plates = scene.core, scene.target.layers[0], scene.target.layers
    weakening = weakens(scene.target, shots)
    if isinstance(numerics, Fidelity):
        fidelity, numerics = numerics, Numerics()
    else:
        fidelity = FIDELITIES[numerics.fidelity]
    lengths = [one.degradation_length for one, does in zip(plates, weakening, strict=True) if does]
    finest = min(lengths, default=plate.degradation_length)
    width = fidelity.patch_width * finest if lengths else math.inf
    defaults: dict[str, Any] = {
        "time_step": None,
        "patches_axial": fidelity.patches_axial,
        "patches_around": max(fidelity.patches_around, 4 * math.ceil(0.25 * math.pi * core.max_radius / width)),
        "grid_spacing": plate.degradation_length / fidelity.cells_per_length,
    }
    if numerics.scheme == "nodal":
        defaults = NODAL
        if len(plates) > 1:
            raise ValueError(ONE_PLATE)
        if plate.degradation_distance is not None:
            raise ValueError(
                "the nodal scheme weakens the plate once per time step: it knows no degradation_distance, which the "
                "consistent scheme takes"
            )
    given = {name: getattr(numerics, name) for name in defaults if getattr(numerics, name) is not None}
    return Resolution(
        nodal=numerics.scheme == "nodal",
        double=fidelity.double if numerics.precision is None else numerics.precision == "double",
        block=fidelity.block or numerics.layout == "block",
        travel=fidelity.travel,
        slender=SLENDER * core.length,
        way_along=ALONG * fidelity.travel * finest,
        weakening=WEAKENING * fidelity.travel,
        slowing=SLOWING * fidelity.travel * 0.5 / (math.pi * core.max_radius**2),
        mass=core.mass_properties.mass,
        static=scene.interaction.static,
        patch_width=math.inf if numerics.scheme == "nodal" else width,
        **(defaults | given),
    )


def weakens(target: Target, shots: Shots | None = None) -> list[bool]:
    """Whether each layer weakens; one that differs from shot to shot may."""
    return [
        layer.degradation < 1.0 or (shots is not None and shots.differs("degradation", k))
        for k, layer in enumerate(target.layers)
    ]


def spelt_out(fidelity: Fidelity, scene: Scene, impact: Impact) -> Numerics:
    """Numerics that give, for one impact, what `resolve` would make of the fidelity if it had a name."""
    plate = scene.target.layers[0]
    return Numerics(
        time_step=resolve(fidelity, scene).step_in(impact, scene.target),
        patches_axial=fidelity.patches_axial,
        patches_around=fidelity.patches_around,
        grid_spacing=plate.degradation_length / fidelity.cells_per_length,
        precision="double" if fidelity.double else "single",
        **({"layout": "block"} if fidelity.block else {}),
    )


FASTEST_DECAY = 1.0e30
"""Of the resistance [1/s]: β = 0 takes all of it at the first touch, a rate beyond any exposure, yet finite (0 × it
is 0)."""
SLOWEST_DECAY = 1.0e-30
"""Below which nothing weakens [1/s]."""
SMALLEST_STRESS = 1.0
"""Below which nothing slows down [Pa]."""


def decay_rate(degradation: Array, unit: float) -> Array:
    """ln(β)/Δt_β [1/s], or ln(β)/Δs_β [1/m], for some β, of their shape."""
    log = np.log(degradation, where=degradation > 0.0, out=np.full_like(degradation, -np.inf))
    return np.maximum(log / unit, -FASTEST_DECAY)
