"""Stability at extremes, far beyond any realistic shot: finite outcomes or a named status, kinetic energy that grows in
no step, a unit quaternion, and an end within the step limit.

The envelope: speeds 1 to 5000 m/s, Y 0 to 1e12 Pa, β 0 and 1 included, η 0 to 10, Δt_β 1 ns to 1 s, thickness 0.1 to
200 mm, obliquity 0 to 89°, any attitude, spin ±1e5 rad/s, cores of 1 to 100 mm from needle to disc, holes from
hairline to wider than the core, finite plates hit at the rim, hits 10 m away from the origin, both precisions.
"""

import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from warpimpact.kernels.status import Status
from warpimpact.scene import (
    AnyPattern,
    CirclePattern,
    Core,
    Interaction,
    NoPattern,
    Numerics,
    Plate,
    ProfileCore,
    Record,
    Scene,
    Shots,
    SlotPattern,
)
from warpimpact.solver.history import History
from warpimpact.solver.simulate import Outcomes, simulate, trace

from .scenes import shots_at

STEEL = 7850.0
EPSILON = {"single": float(np.finfo(np.float32).eps), "double": float(np.finfo(np.float64).eps)}


def spread(low: float, high: float) -> st.SearchStrategy[float]:
    """Numbers spread evenly in their logarithm, both ends included."""
    return st.floats(0.0, 1.0).map(lambda share: min(high, max(low, low * (high / low) ** share)))


@st.composite
def cores(draw: st.DrawFn) -> Core:
    length, diameter = draw(spread(1e-3, 0.1)), draw(spread(1e-3, 0.1))
    if draw(st.booleans()):
        diameter = min(diameter, length / 20)  # a needle
    shoulder = draw(st.floats(0.05, 1.0)) * length
    nose, base = draw(st.floats(0.0, 1.0)), draw(st.floats(0.1, 1.0))
    stations = (0.0, shoulder, length) if shoulder < length else (0.0, length)
    radii = (0.5 * nose * diameter, 0.5 * diameter, 0.5 * base * diameter)[: len(stations)]
    return ProfileCore(s=stations, r=radii, density=STEEL)


@st.composite
def patterns(draw: st.DrawFn, diameter: float) -> AnyPattern:
    hole = draw(spread(0.01, 3.0)) * diameter
    gap_y, gap_z = draw(st.floats(1.01, 3.0)), draw(st.floats(1.01, 3.0))
    return draw(
        st.sampled_from(
            [
                NoPattern(),
                CirclePattern(diameter=hole, spacing=(gap_y * hole, gap_z * hole)),
                SlotPattern(length=2 * hole, width=hole, spacing=(gap_y * hole, 2 * gap_z * hole)),
            ]
        )
    )


@st.composite
def scenes_and_shots(draw: st.DrawFn) -> tuple[Scene, Shots]:
    core = draw(cores())
    diameter = 2.0 * core.max_radius
    side = draw(st.none() | st.floats(0.5, 3.0).map(lambda sides: sides * diameter))
    plate = Plate(
        thickness=draw(spread(1e-4, 0.2)),
        resistance=draw(st.just(0.0) | spread(1e3, 1e12)),
        shear_coefficient=draw(st.just(0.0) | spread(1e-3, 10.0)),
        degradation=draw(st.sampled_from([0.0, 0.8, 1.0]) | st.floats(0.0, 1.0)),
        degradation_interval=draw(spread(1e-9, 1.0)),
        degradation_length=diameter * draw(spread(0.05, 1.0)),  # cost grows with its inverse square
        pattern=draw(patterns(diameter)),
        size=None if side is None else (side, side),
    )
    rates = st.sampled_from([0.0, 1.0])
    away = draw(st.sampled_from([0.0, 10.0])) if side is None else 0.0
    aim = st.floats(-1.0, 1.0) if side is None else st.floats(-0.5, 0.5).map(lambda sides: sides * side / diameter)
    obliquity, azimuth = draw(st.floats(0.0, 89.0)), draw(st.floats(-180.0, 180.0))
    flight = np.degrees(np.arctan(math.tan(math.radians(obliquity)) * np.array(_direction(azimuth))))
    attitude = [draw(st.floats(-89.9, 89.9)) - own for own in flight]  # any projected attitude of the axis
    shots = shots_at(
        away + diameter * draw(aim),
        away + diameter * draw(aim),
        velocity=draw(spread(1.0, 5000.0)),
        obliquity=obliquity,
        azimuth=azimuth,
        pitch=attitude[0],
        yaw=attitude[1],
        spin=draw(st.sampled_from([0.0, -1e5, 1e5]) | st.floats(-1e5, 1e5)),
    )
    interaction = Interaction(static=1.0, linear=draw(rates), quadratic=draw(rates))
    return Scene(core=core, target=plate, interaction=interaction, record=Record(standoffs=(1.0,))), shots


def _direction(azimuth: float) -> tuple[float, float]:
    return math.sin(math.radians(azimuth)), math.cos(math.radians(azimuth))


def check_outcome(outcomes: Outcomes) -> None:
    status = Status(int(outcomes.status[0]))
    told = [outcomes.residual_velocity[0], outcomes.energy_loss[0], outcomes.contact_duration[0]]
    if status.failed:
        assert status is not Status.NOT_FINITE
        assert np.isnan(told).all()
    else:
        assert np.isfinite(told).all()
        assert np.isfinite(outcomes.angular_velocity).all()
    assert (
        np.isfinite(outcomes.tilt[0]).all() == (status in (Status.PERFORATED, Status.MISSED)) or status is Status.MISSED
    )


def check_history(history: History, impact_energy: float, precision: str) -> None:
    energy = history.translational_energy + history.rotational_energy
    assert np.diff([impact_energy, *energy]).max() <= 16 * EPSILON[precision] * impact_energy
    assert np.abs(np.linalg.norm(history.attitude, axis=1) - 1.0).max() <= 4 * EPSILON[precision]


@pytest.mark.parametrize("precision", list(EPSILON))
@settings(max_examples=20, deadline=None, derandomize=True, database=None, suppress_health_check=list(HealthCheck))
@given(case=scenes_and_shots())
def test_extremes(precision: Any, case: tuple[Scene, Shots]) -> None:
    scene, shots = case
    numerics = Numerics(fidelity="draft", precision=precision)
    check_outcome(simulate(scene, shots, numerics=numerics, device="cpu"))
    (steps,) = trace(scene, shots, numerics=numerics)
    properties = scene.core.mass_properties
    impact = 0.5 * (properties.mass * shots.velocity[0] ** 2 + properties.inertia_axial * shots.spin[0] ** 2)
    check_history(History.from_trace(steps, properties), impact, precision)
