"""Scenes far beyond any realistic shot, and what holds for each of them: a finite outcome or a named status, kinetic
energy that grows in no step, a unit quaternion, and an end.

The envelope: speeds 1 to 5000 m/s, Y 0 to 1e12 Pa, β 0 and 1 included, Δt_β 1 ns to 1 s or Δs_β 1 nm to 10 m, η 0 to
10, κ 0 to 10, thickness 0.1 to 200 mm, obliquity 0 to 89°, any attitude, spin ±1e5 rad/s, cores of 1 to 100 mm from
needle to disc, of 1 to 1e5 kg/m³, with moments of inertia of a tenth to ten times those of their shape, holes from
hairline to wider than the core, finite plates hit at the rim, hits 10 m away from the origin, both precisions; behind
half of the plates up to three more, laminated or up to a metre behind.
"""

import math
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
import pytest
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import (
    AnyPattern,
    CirclePattern,
    Core,
    Interaction,
    Layer,
    NoPattern,
    Plate,
    ProfileCore,
    Record,
    Scene,
    Shots,
    SlotPattern,
    Target,
)
from warpimpact.scene.core import MassProperties
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.replay import History, traced, traces_of

from .scenes import shots_at

STEEL = 7850.0
MOST_RISE = 64.0
"""Largest rise of the kinetic energy in a step, in ε of the precision and of the impact energy: rounding. Where the
energy changes faster with the direction of the axis than by the impact energy per radian, it is that much larger
(`_steepness`)."""
MOST_STRETCH = 4.0
"""Largest difference of a quaternion's length from 1, in ε."""
WIDEST = 300.0
"""Degradation lengths that a straight shot may sweep: the memory and time of a window grow with their square."""


class Extreme(NamedTuple):
    """A scene, shots at it that differ in hit and attitude, and the precision of the numerics."""

    scene: Scene
    shots: Shots
    precision: Any


class ExtremeResult(NamedTuple):
    """How the shots of a scene ended; of those that did not fail, the largest rise of the energy in a step, in ε and
    impact energies (or `_steepness`), and the largest difference of a quaternion's length from 1, in ε; and shots whose
    outcome lacks a value that their status promises, or has one that it excludes."""

    statuses: list[Status]
    steep_rise: float
    stretch: float
    undefined: int


def drawn(share: Callable[[], float], hits: int) -> Extreme:
    """A scene from a source of numbers within [0, 1]."""
    draw = _Draw(share)
    core = _core(draw)
    diameter = 2.0 * core.max_radius
    side = draw.one_of(None, draw.between(0.5, 3.0) * diameter)
    obliquity, azimuth = draw.between(0.0, 89.0), draw.between(-180.0, 180.0)
    thickness = draw.spread(1e-4, 0.2)
    steep = math.radians(obliquity)
    swept = core.bounding_radius + core.max_radius / math.cos(steep) + thickness * math.tan(steep)
    interval, distance = draw.spread(1e-9, 1.0), draw.spread(1e-9, 10.0)
    by_time = {"degradation_interval": interval}
    plate: dict[str, Any] = {
        "thickness": thickness,
        "resistance": draw.one_of(0.0, *[draw.spread(1e3, 1e12)] * 7),
        "shear_coefficient": draw.one_of(0.0, draw.spread(1e-3, 10.0)),
        "degradation": draw.one_of(0.0, 0.8, 1.0, 1.0, draw.between(0.0, 1.0), draw.spread(1e-30, 1.0)),
        "degradation_length": max(diameter * draw.spread(0.05, 1.0), swept / WIDEST),
        "pattern": _pattern(draw, diameter),
        "size": None if side is None else (side, side),
        **draw.one_of(by_time, by_time, {"degradation_distance": distance}),
    }
    interaction = Interaction(
        linear=draw.one_of(0.0, 0.0, 1.0),
        quadratic=draw.one_of(0.0, 0.0, 1.0),
        onset=draw.one_of(0.005, 0.005, 0.0, draw.spread(1e-6, 10.0)),
    )
    flight = np.degrees(np.arctan(math.tan(steep) * np.sin(np.radians([azimuth, azimuth + 90.0]))))
    away = draw.one_of(0.0, 10.0) if side is None else 0.0
    aim = diameter if side is None else 0.5 * side
    shots = shots_at(
        [away + aim * draw.between(-1.0, 1.0) for _ in range(hits)],
        [away + aim * draw.between(-1.0, 1.0) for _ in range(hits)],
        velocity=draw.spread(1.0, 5000.0),
        obliquity=obliquity,
        azimuth=azimuth,
        pitch=[draw.between(-89.9, 89.9) - flight[0] for _ in range(hits)],  # any projected attitude of the axis
        yaw=[draw.between(-89.9, 89.9) - flight[1] for _ in range(hits)],
        spin=draw.one_of(0.0, -1e5, 1e5, draw.between(-1e5, 1e5)),
    )
    precision = draw.one_of("single", "single", "single", "double")
    layers = tuple(_layer(draw, plate) for _ in range(draw.one_of(0, 0, 0, 1, 2, 3)))
    target = Target(layers=(Plate(**plate), *layers))
    return Extreme(
        Scene(core=core, target=target, interaction=interaction, record=Record(standoffs=(1.0,))), shots, precision
    )


def computed(extreme: Extreme) -> ExtremeResult:
    """Compute the shots of a scene with their histories, at draft, on the CPU."""
    scene, shots, precision = extreme
    numerics = FastLaw(level=0, precision=precision)
    memory, _, contact = traced(scene, shots, numerics)
    report, traces = memory.report(contact), traces_of(memory, contact)
    statuses = [Status(int(code)) for code in report.status]
    properties = scene.core.mass_properties
    steep, stretches = [0.0], [0.0]
    epsilon = np.finfo(np.float32 if precision == "single" else np.float64).eps
    spinning = properties.inertia_axial * shots.spin**2
    for status, steps, impact in zip(
        statuses, traces, 0.5 * (properties.mass * shots.velocity**2 + spinning), strict=True
    ):
        if status not in (Status.NOT_FINITE, Status.GAINED_ENERGY):
            history = History.from_trace(steps, properties)
            energy = np.append(impact, history.translational_energy + history.rotational_energy) / impact
            rise = np.diff(energy) / epsilon
            steep.append((rise / np.maximum(1.0, _steepness(history, properties) / impact)).max())
            stretches.append(np.abs(np.linalg.norm(history.attitude, axis=1) - 1.0).max() / epsilon)
    return ExtremeResult(
        statuses=statuses,
        steep_rise=float(np.max(steep)),
        stretch=float(np.max(stretches)),
        undefined=sum(not _defined(report, shot, status) for shot, status in enumerate(statuses)),
    )


def _steepness(history: History, properties: MassProperties) -> NDArray[np.float64]:
    """Change of the kinetic energy per angle by which rounding turns the axis [J/rad], the larger one of the start and
    the end of every step; shape [steps].

    The angular momentum L stays, so ½(L·a)²/I_a + ½|L × a|²/I_t changes by |ω·a| |ω × a| |I_t − I_a|. A needle or a
    disc may turn mostly across the axis that holds its energy.
    """
    along = np.sum(history.angular_velocity * history.core_axis, axis=1)
    across = np.linalg.norm(np.cross(history.angular_velocity, history.core_axis), axis=1)
    after = np.abs(along) * across * abs(properties.inertia_transverse - properties.inertia_axial)
    return np.maximum(after, np.append(after[0], after[:-1]))


def _defined(report: Outcomes, shot: int, status: Status) -> bool:
    """Whether an outcome has the values that its status promises, and no other ones."""
    scalars = np.array([report.residual_velocity[shot], report.energy_loss[shot], report.contact_duration[shot]])
    seen = np.isfinite(report.tilt[shot]).all()
    if status.failed:
        return bool(np.isnan(scalars).all() and not seen)
    passed = status is Status.PERFORATED
    return bool(
        np.isfinite(scalars).all()
        and np.isfinite(report.angular_velocity[shot]).all()
        and (seen == passed or status is Status.UNTOUCHED)
    )


class _Draw:
    """Values of any kind from a source of numbers within [0, 1]."""

    def __init__(self, share: Callable[[], float]) -> None:
        self.share = share

    def between(self, low: float, high: float) -> float:
        """Spread evenly, both ends included."""
        return low + (high - low) * self.share()

    def spread(self, low: float, high: float) -> float:
        """Spread evenly in the logarithm, both ends included."""
        return min(high, max(low, low * (high / low) ** self.share()))

    def one_of(self, *choices: Any) -> Any:
        return choices[min(len(choices) - 1, int(len(choices) * self.share()))]


def _core(draw: _Draw) -> Core:
    length, diameter = draw.spread(1e-3, 0.1), draw.spread(1e-3, 0.1)
    diameter = draw.one_of(diameter, min(diameter, length / 20))  # a needle
    shoulder = draw.between(0.05, 1.0) * length
    nose, base = draw.between(0.0, 1.0), draw.between(0.0, 1.0)
    stations = (0.0, shoulder, length) if shoulder < length else (0.0, length)
    radii = (0.5 * nose * diameter, 0.5 * diameter, 0.5 * base * diameter)[: len(stations)]
    core = ProfileCore(s=stations, r=radii, density=draw.one_of(STEEL, draw.spread(1.0, 1e5)))
    own = core.mass_properties
    axial, transverse = (draw.one_of(1.0, draw.spread(0.1, 10.0)) for _ in range(2))
    inertia = {"inertia_axial": axial * own.inertia_axial, "inertia_transverse": transverse * own.inertia_transverse}
    return core.model_copy(update=inertia)


def _pattern(draw: _Draw, diameter: float) -> AnyPattern:
    hole = draw.spread(0.01, 3.0) * diameter
    gap_y, gap_z = draw.between(1.01, 3.0), draw.between(1.01, 3.0)
    pattern: AnyPattern = draw.one_of(
        NoPattern(),
        CirclePattern(diameter=hole, spacing=(gap_y * hole, gap_z * hole)),
        SlotPattern(length=2 * hole, width=hole, spacing=(gap_y * hole, 2 * gap_z * hole)),
    )
    return pattern


def _layer(draw: _Draw, plate: dict[str, Any]) -> Layer:
    """A plate behind one with these values, weaker or stronger; another pattern of holes may be in it, or none."""
    return Layer(
        **plate
        | {
            "gap": draw.one_of(0.0, draw.spread(1e-6, 1.0)),
            "thickness": min(0.2, plate["thickness"] * draw.spread(0.1, 10.0)),
            "resistance": plate["resistance"] * draw.spread(0.1, 10.0),
            "degradation": draw.one_of(plate["degradation"], 1.0),
            "pattern": draw.one_of(plate["pattern"], NoPattern()),
            "offset": (draw.spread(1e-4, 0.1), 0.0),
        }
    )


SCENES = (0, 4, 17, 27, 32, 37, 49)
"""Of a seed: single plates and layers, with and without weakening, rate and rim, in both precisions. Other tests need
their builds of the kernels, too."""


@pytest.mark.parametrize("index", SCENES)
def test_extremes(index: int) -> None:
    outcome = computed(drawn(np.random.default_rng([7, index]).random, hits=2))
    assert Status.NOT_FINITE not in outcome.statuses
    assert Status.GAINED_ENERGY not in outcome.statuses
    assert outcome.undefined == 0
    assert outcome.steep_rise <= MOST_RISE
    assert outcome.stretch <= MOST_STRETCH


def test_energy_of_a_needle_that_tumbles_while_it_spins() -> None:
    assert computed(drawn(np.random.default_rng([1, 4002]).random, hits=3)).steep_rise <= MOST_RISE
