"""The scenes of the verification: the paper's core and plate, and similar ones."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from warpimpact.scene import (
    Core,
    Interaction,
    Layer,
    NoPattern,
    Plate,
    PolynomialCore,
    Record,
    Scene,
    Shots,
    SlotPattern,
)
from warpimpact.solver import replay
from warpimpact.solver import simulate as simulation
from warpimpact.solver.fast_law import FastLaw

from . import references

Array = NDArray[np.float64]

PAPER_CORE = PolynomialCore(
    coefficients=references.PAPER_COEFFICIENTS, length=references.PAPER_LENGTH, mass=references.PAPER_MASS
)
SLOTS = SlotPattern(length=12e-3, width=4e-3, spacing=(8e-3, 16e-3), staggered=True)
STANDOFFS = (0.05, 0.13)
STATIC = Interaction()


def paper_plate(**changes: Any) -> Plate:
    """The paper's plate and material (spacing assumed), except for `changes`."""
    paper = {
        "thickness": 4e-3,
        "resistance": 2.6e9,
        "shear_coefficient": 0.05,
        "degradation": 0.8,
        "degradation_interval": 1e-6,
        "degradation_length": 0.5e-3,
        "pattern": SLOTS,
    }
    return Plate(**paper | changes)


def solid_plate(**changes: Any) -> Plate:
    """The paper's plate without holes."""
    return paper_plate(pattern=NoPattern(), **changes)


def layer(plate: Plate, **changes: Any) -> Layer:
    """A plate as a layer behind another one."""
    return Layer(**{name: getattr(plate, name) for name in plate.model_fields_set} | changes)


BASE = layer(paper_plate(thickness=3e-3, resistance=1.5e9), gap=20e-3)


def shots_at(
    hit_y: ArrayLike = 0.0,
    hit_z: ArrayLike = 0.0,
    *,
    velocity: ArrayLike = 825.0,
    obliquity: ArrayLike = 0.0,
    azimuth: ArrayLike = 0.0,
    pitch: ArrayLike = 0.0,
    yaw: ArrayLike = 0.0,
    spin: ArrayLike = 0.0,
) -> Shots:
    """Shots at hit points [m], everything broadcast; angles in degrees here."""
    angles = (np.deg2rad(a) for a in (obliquity, azimuth, pitch, yaw))
    columns = np.broadcast_arrays(*map(np.atleast_1d, (hit_y, hit_z, velocity, *angles, spin)))
    return Shots(*(np.array(column, dtype=float) for column in columns))


REFERENCE: dict[str, Any] = {"level": 7, "patches_axial": 64, "travel": 0.05}
"""Settings that are far finer than those of most runs."""


def scattered_hits(count: int, seed: int = 0) -> Array:
    """Hit points over the unit cell of the slotted plate [m], shape (2, count): none on a line of symmetry."""
    return np.random.default_rng(seed).random((2, count)) * 16e-3


def simulate(
    plate: Plate,
    shots: Shots,
    *,
    core: Core = PAPER_CORE,
    interaction: Interaction = STATIC,
    standoffs: tuple[float, ...] = STANDOFFS,
    device: str = "cpu",
    **numerics: Any,
) -> simulation.Outcomes:
    """`warpimpact.simulate` with scene and numerics as arguments."""
    scene = Scene(core=core, target=plate, interaction=interaction, record=Record(standoffs=standoffs))
    return simulation.simulate(scene, shots, method=FastLaw(**{"level": 2} | numerics), device=device)


def histories(
    plate: Plate, shots: Shots, *, core: Core = PAPER_CORE, interaction: Interaction = STATIC, **numerics: Any
) -> list[replay.History]:
    """States of shots after each step, and the mean loads of the steps."""
    scene = Scene(core=core, target=plate, interaction=interaction)
    memory, _, contact = replay.traced(scene, shots, FastLaw(**{"level": 2} | numerics))
    return [replay.History.from_trace(rows, core.mass_properties) for rows in replay.traces_of(memory, contact)]
