"""Rigid-body motion: closed forms of the symmetric top, and conditions that a kick must meet (docs/model.md §5)."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from warpimpact.kernels import rigid_body, structs
from warpimpact.kernels.variant import Variant

from .probes import attitudes, poisoned, records

Array = NDArray[np.float64]

VARIANT = Variant(double=True)
real, vec3 = VARIANT.real, VARIANT.vec3
use, struct = VARIANT.use(rigid_body), structs.build(VARIANT)
Body, State, Load = struct.Body, struct.State, struct.Load

COUNT = 64
MASS, AXIAL, TRANSVERSE = 4.0e-3, 1.5e-8, 1.65e-7  # the paper's core, SI
STIFF = 1.0e-3  # [s], so long that the damping of these tests stops most of the motion within it
GENERALISED_INERTIA = np.array([MASS] * 3 + [TRANSVERSE] * 3)


def convert(
    body: Body,
    states: wp.array(dtype=State),
    rates: wp.array(dtype=vec3),
    momenta: wp.array(dtype=vec3),
    axes: wp.array(dtype=vec3),
    energies: wp.array(dtype=real),
) -> None:
    """ω from the states' L, and L from that ω."""
    i = wp.tid()
    state = states[i]
    axis = use.rigid_body.axis_of(state.attitude)
    axes[i] = axis
    rates[i] = use.rigid_body.angular_velocity(body, axis, state.angular_momentum)
    momenta[i] = use.rigid_body.angular_momentum(body, axis, rates[i])
    energies[i] = use.rigid_body.kinetic_energy(body, axis, state.velocity, state.angular_momentum)


def drift(
    body: Body, states: wp.array(dtype=State), dt: real, repeats: wp.int32, drifted: wp.array(dtype=State)
) -> None:
    i = wp.tid()
    state = states[i]
    for _ in range(repeats):
        state = use.rigid_body.drift(body, state, dt)
    drifted[i] = state


def kick(
    body: Body,
    states: wp.array(dtype=State),
    loads: wp.array(dtype=Load),
    dt: real,
    kicked: wp.array(dtype=State),
    forces: wp.array(dtype=vec3),
    moments: wp.array(dtype=vec3),
) -> None:
    """The kicked states, and the mean force and moment of each kick."""
    i = wp.tid()
    kicked[i] = use.rigid_body.kick(body, states[i], loads[i], dt)
    force, moment = use.rigid_body.mean_load(body, states[i], loads[i], dt)
    forces[i] = force
    moments[i] = moment


CONVERT, DRIFT, KICK = (VARIANT.kernel(function) for function in (convert, drift, kick))


def paper_body() -> Any:
    body = Body()
    body.mass, body.inertia_axial, body.inertia_transverse = MASS, AXIAL, TRANSVERSE
    return body


def random_motion() -> SimpleNamespace:
    """States of cores that spin and tumble at about 1e4 rad/s, and their inertia in the plate frame."""
    rng = np.random.default_rng(1)
    attitude = attitudes(rng, COUNT)
    turned = Rotation.from_quat(attitude)
    matrices = turned.as_matrix()
    inertia = matrices @ np.diag([AXIAL, TRANSVERSE, TRANSVERSE]) @ matrices.transpose(0, 2, 1)
    omega = 1e4 * rng.standard_normal((COUNT, 3))
    return SimpleNamespace(
        position=1e-2 * rng.standard_normal((COUNT, 3)),
        attitude=attitude,
        velocity=800.0 * rng.standard_normal((COUNT, 3)),
        angular_momentum=np.einsum("nij,nj->ni", inertia, omega),
        rotation=turned,
        axis=matrices[:, :, 0],
        omega=omega,
        inertia=inertia,
    )


def states_of(start: SimpleNamespace, device: str) -> wp.array:
    names = ("position", "attitude", "velocity", "angular_momentum")
    return records(State, device, **{name: getattr(start, name) for name in names})


def drifted(start: SimpleNamespace, dt: float, device: str, repeats: int = 1) -> Any:
    after = poisoned(COUNT, State, device)
    inputs = [paper_body(), states_of(start, device), dt, repeats]
    wp.launch(DRIFT, COUNT, inputs=inputs, outputs=[after], device=device)
    return after.numpy()


def along_body(start: SimpleNamespace, load: dict[str, Array]) -> dict[str, Array]:
    """Members of a Load, given in the plate frame, along the body axes."""
    turn = start.rotation.as_matrix().transpose(0, 2, 1)
    axes = {1: "nij,nj->ni", 2: "nij,njk,nlk->nil"}
    turned = {
        name: np.einsum(axes[value.ndim - 1], *[turn, value, turn][: value.ndim])
        for name, value in load.items()
        if value.ndim > 1
    }
    return load | turned


def kicked(start: SimpleNamespace, dt: float, device: str, **load: Any) -> tuple[Any, dict[str, Array]]:
    """States after a kick by loads in the plate frame, and the mean force and moment there."""
    after = poisoned(COUNT, State, device)
    means = {name: poisoned(COUNT, vec3, device) for name in ("force", "moment")}
    inputs = [paper_body(), states_of(start, device), records(Load, device, **along_body(start, load)), dt]
    wp.launch(KICK, COUNT, inputs=inputs, outputs=[after, *means.values()], device=device)
    return after.numpy(), {name: array.numpy() for name, array in means.items()}


def energy(start: SimpleNamespace, velocity: Array, momentum: Array) -> Array:
    omega = np.linalg.solve(start.inertia, momentum[..., None])[..., 0]
    return 0.5 * (MASS * (velocity**2).sum(axis=1) + (momentum * omega).sum(axis=1))


def mass_matrices(start: SimpleNamespace) -> Array:
    """M of (v, ω), shape [COUNT, 6, 6]."""
    matrices = np.zeros((COUNT, 6, 6))
    matrices[:, :3, :3] = MASS * np.eye(3)
    matrices[:, 3:, 3:] = start.inertia
    return matrices


def drag() -> Array:
    """Random positive semidefinite −∂(force, moment)/∂(v, ω) of rank 1 to 6, shape [COUNT, 6, 6]."""
    rng = np.random.default_rng(2)
    directions = rng.standard_normal((COUNT, 6, 6)) * (np.arange(6) <= np.arange(COUNT)[:, None] % 6)[:, None]
    directions *= np.sqrt(GENERALISED_INERTIA / STIFF)[:, None]
    return directions @ directions.transpose(0, 2, 1)


def damping(matrices: Array) -> dict[str, Array]:
    """Members of a Load for the damping D, shape [COUNT, 6, 6]."""
    return {
        "damping_vv": matrices[:, :3, :3],
        "damping_vw": matrices[:, :3, 3:],
        "damping_ww": matrices[:, 3:, 3:],
        "damped": np.full(COUNT, True),
    }


def test_rates_momenta_and_energy_are_those_of_the_inertia_tensor(device: str) -> None:
    start = random_motion()
    rates, momenta, axes = (poisoned(COUNT, vec3, device) for _ in range(3))
    energies = poisoned(COUNT, real, device)
    outputs = [rates, momenta, axes, energies]
    wp.launch(CONVERT, COUNT, inputs=[paper_body(), states_of(start, device)], outputs=outputs, device=device)
    np.testing.assert_allclose(axes.numpy(), start.axis, atol=1e-14)
    np.testing.assert_allclose(rates.numpy(), start.omega, rtol=1e-12, atol=1e-8)
    np.testing.assert_allclose(momenta.numpy(), start.angular_momentum, rtol=1e-12, atol=1e-17)
    expected = energy(start, start.velocity, start.angular_momentum)
    np.testing.assert_allclose(energies.numpy(), expected, rtol=1e-13)


@pytest.mark.parametrize("dt", [1e-6, 1e-3])
def test_drift_is_the_closed_form_of_the_symmetric_top(dt: float, device: str) -> None:
    # §6.5: the axis precesses about L at |L|/I_t; in the body frame the spin stays and the transverse rate
    # turns about the axis at (I_a − I_t)/I_t of the spin. Together they fix the attitude. For any dt.
    start = random_motion()
    after = drifted(start, dt, device)
    np.testing.assert_allclose(after["position"], start.position + dt * start.velocity, rtol=1e-14)
    np.testing.assert_array_equal(after["velocity"], start.velocity)
    np.testing.assert_array_equal(after["angular_momentum"], start.angular_momentum)

    rotation = Rotation.from_quat(after["attitude"])
    precession = Rotation.from_rotvec(dt / TRANSVERSE * start.angular_momentum)
    np.testing.assert_allclose(rotation.as_matrix()[:, :, 0], precession.apply(start.axis), atol=1e-11)

    body_rate = start.rotation.inv().apply(start.omega)
    angle = dt * (AXIAL - TRANSVERSE) / TRANSVERSE * body_rate[:, 0]
    turned_rate = Rotation.from_rotvec(angle[:, None] * [1.0, 0.0, 0.0]).apply(body_rate)
    inertia = np.array([AXIAL, TRANSVERSE, TRANSVERSE])
    np.testing.assert_allclose(
        rotation.inv().apply(start.angular_momentum), inertia * turned_rate, rtol=1e-9, atol=1e-13
    )


def test_damped_kick_is_rosenbrock_s_step(device: str) -> None:
    # (M + γ dt J) Δu₁ = dt F, (M + γ dt J) Δu = γ dt F + (1 − γ) M Δu₁, γ = 1 − √½, with the load's derivative J = 2 D.
    start, matrices = random_motion(), drag()
    u = np.concatenate([start.velocity, start.omega], axis=1)
    load = -np.einsum("nij,nj->ni", matrices, u)
    after, means = kicked(start, STIFF, device, force=load[:, :3], moment=load[:, 3:], **damping(matrices))

    inertia = mass_matrices(start)
    gamma = 1 - np.sqrt(0.5)
    implicit, push = inertia + gamma * STIFF * 2 * matrices, STIFF * load[..., None]
    first = np.linalg.solve(implicit, push)
    change = np.linalg.solve(implicit, gamma * push + (1 - gamma) * inertia @ first)[..., 0]
    scale = np.abs(change[:, :3]).max(), np.abs(change[:, 3:]).max()
    dv = after["velocity"] - start.velocity
    dl = (after["angular_momentum"] - start.angular_momentum)[..., None]
    dw = np.linalg.solve(start.inertia, dl)[..., 0]
    np.testing.assert_allclose(dv, change[:, :3], rtol=0, atol=1e-9 * scale[0])
    np.testing.assert_allclose(dw, change[:, 3:], rtol=0, atol=1e-9 * scale[1])

    # The mean load of the step is its change of momentum.
    impulse = np.einsum("nij,nj->ni", inertia, change)
    applied = STIFF * np.concatenate([means["force"], means["moment"]], axis=1)
    np.testing.assert_allclose(applied[:, :3], impulse[:, :3], rtol=0, atol=1e-9 * np.abs(impulse[:, :3]).max())
    np.testing.assert_allclose(applied[:, 3:], impulse[:, 3:], rtol=0, atol=1e-9 * np.abs(impulse[:, 3:]).max())


@pytest.mark.parametrize("dt", [1e-5, 1e-3])
@pytest.mark.parametrize("with_drag", [False, True])
def test_kick_never_raises_the_energy(with_drag: bool, dt: float, device: str) -> None:
    # Random loads of the size that stops the core in 10 µs; half of them push along the motion.
    start, rng = random_motion(), np.random.default_rng(3)
    load = {
        "force": MASS * 800.0 / 1e-5 * rng.standard_normal((COUNT, 3)),
        "moment": TRANSVERSE * 1e4 / 1e-5 * rng.standard_normal((COUNT, 3)),
    } | (damping(drag()) if with_drag else {})
    after, _ = kicked(start, dt, device, **load)
    before = energy(start, start.velocity, start.angular_momentum)
    left = energy(start, after["velocity"], after["angular_momentum"])
    assert (left <= before * (1 + 1e-12)).all()
    assert (left < 0.999 * before).any()


@pytest.mark.parametrize(("overshoot", "applied"), [(0.9, 0.9), (1.1, 1.0), (1e3, 1.0)])
def test_overshooting_kick_stops_at_the_least_energy_along_it(overshoot: float, applied: float, device: str) -> None:
    # Along a direction d the impulse −m (v·d) takes the most energy. A larger impulse is reduced to it.
    start = random_motion()
    d = Rotation.random(COUNT, random_state=4).apply([1.0, 0.0, 0.0])
    along = (start.velocity * d).sum(axis=1, keepdims=True) * d
    after, means = kicked(start, 1.0, device, force=-overshoot * MASS * along)
    np.testing.assert_allclose(after["velocity"], start.velocity - applied * along, rtol=0, atol=1e-9)
    np.testing.assert_allclose(means["force"], -applied * MASS * along, rtol=0, atol=1e-11)
    np.testing.assert_array_equal(after["angular_momentum"], start.angular_momentum)


def swing(
    body: Body, before: wp.array(dtype=struct.Change), last: struct.Change, swings: wp.array(dtype=wp.bool)
) -> None:
    i = wp.tid()
    swings[i] = use.rigid_body.swings(body, before[i], last)


SWING = VARIANT.kernel(swing)


def test_a_core_swings_when_a_step_turns_back_the_last_one(device: str) -> None:
    # Changes across the axis that are smaller than 1e-4 of those along it are rounding.
    across = np.array([-1.0, -1.2e-4, -0.8e-4, 0.0, 0.8e-4, 1.0])
    before = records(struct.Change, device, velocity=np.stack([np.ones(6), across, 0.0 * across], axis=1))
    last, swings = struct.Change(), poisoned(6, wp.bool, device)
    last.velocity = vec3(1.0, 1.0e-4, 0.0)
    wp.launch(SWING, 6, inputs=[paper_body(), before, last], outputs=[swings], device=device)
    np.testing.assert_array_equal(swings.numpy(), [True, True, False, False, False, False])


def moving(
    body: Body, axis: vec3, momentum: vec3, ahead: real, velocity: real, distance: real, axes: wp.array(dtype=vec3)
) -> None:
    axes[0] = use.rigid_body.axis_at(body, axis, momentum, ahead, velocity, distance)


MOVING = VARIANT.kernel(moving)


def test_a_point_that_swings_at_half_of_the_speed_of_flight_is_located(device: str) -> None:
    # The axis turns about z from 30° to 90°, where the point swings straight along x: each iteration halves the error.
    ahead, velocity, rate = 1.0e-2, 100.0, 5.0e3
    time = np.deg2rad(60.0) / rate
    axes = wp.empty(1, dtype=vec3, device=device)
    start = vec3(*np.cos(np.deg2rad([30.0, 60.0, 90.0])))
    inputs = [paper_body(), start, vec3(0.0, 0.0, TRANSVERSE * rate), ahead, velocity, velocity * time]
    wp.launch(MOVING, 1, inputs=inputs, outputs=[axes], device=device)
    np.testing.assert_allclose(axes.numpy()[0], [0.0, 1.0, 0.0], atol=1e-12)
