"""What follows on the finite elements: cores go on by the fast law, through other layers and to the stand-offs.

A solid base is what the fast law is fitted to, by published limit velocities, and what takes elements longest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.continuum.one_hit import HitResult
from warpimpact.kernels.continuum import choices
from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.records.variables import (
    ENERGY_IMBALANCE,
    ERODED_ELEMENTS,
    FRAGMENT_VARIABLES,
    HANDOVER_VARIABLES,
    HOURGLASS_SHARE,
    has_passed,
)
from warpimpact.scene import Core, MassProperties, Scene, Shots, Target
from warpimpact.scene.model import Array
from warpimpact.scene.rigid import angle_between, axis_of, energies, line_of_flight
from warpimpact.scene.target import layer_name
from warpimpact.solver.device import Worker, find_device
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.marching import march
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare

WHOLE = 0.0, math.inf
"""The stretch of a core that did not break."""
STRETCH_DIGITS = 6
"""Digits [m] of the ends of stretches, by which fragments march together."""
NUMERICS = FastLaw(level=2)
"""The fast law behind the elements, whose own error is larger."""


def room_of(core: Core) -> float:
    """Gap that a core needs between its last layer of elements and the next one [m]."""
    return core.length + float(choices.FREE_WAY.value)


def layers_before_base(core: Core, target: Target) -> int:
    """Number of layers in front of those that the fast law may compute: solid ones behind a gap with room for a
    core. Without such layers it is the number of all."""
    layers = len(target.layers)
    solid_from = 1 + max([k for k, layer in enumerate(target.layers) if layer.open_area > 0.0], default=0)
    return next((k for k in range(solid_from, layers) if target.gaps[k] >= room_of(core)), layers)


def check_handover(core: Core, target: Target, layers: int | None) -> None:
    """Refuse a number of layers of elements that the target does not have, or behind which a core has no room.

    Raises:
        ValueError: the message names what was found, and what is allowed.
    """
    count, room = len(target.layers), room_of(core)
    if layers is None or layers == count:
        return
    if layers > count:
        raise ValueError(f"continuum.layers: got {layers}, but the target has {count}")
    if (gap := target.gaps[layers]) < room:
        raise ValueError(
            f"continuum.layers: got {layers}, but the gap in front of {layer_name(layers)} is {1e3 * gap:.4g} mm; a "
            f"core that goes on by the fast law needs {1e3 * room:.4g} mm"
        )


def memory_of(scene: Scene, shots: Shots, worker: Worker) -> Memory:
    """What the free flight behind the target needs of some shots, on the CPU."""
    return Memory(prepare(scene, shots, FastLaw(level=0, precision="double")), find_device("cpu"), worker.cancel)


class Exits(NamedTuple):
    """Cores as they leave the first layers, in the plate frame; the origin is the hit point.

    Attributes:
        status: codes of `Status`, shape [hits].
        position, velocity, momentum: centre of mass [m], its velocity [m/s], angular momentum of a whole core that
            turns so [N m s], shape [hits, 3].
        attitude: quaternion, shape [hits, 4].
        touched: whether the core touched each of these layers, shape [hits, layers].
        time: when it leaves them, since the impact [s]; shape [hits].
        share: of the mass of the core that goes on, shape [hits].
        stretch: of the core that goes on, from front to rear behind its nose [m], shape [hits, 2]; WHOLE is all of it.
    """

    status: NDArray[np.int8]
    position: Array
    velocity: Array
    momentum: Array
    attitude: Array
    touched: NDArray[np.bool_]
    time: Array
    share: Array
    stretch: Array

    @classmethod
    def of(cls, hits: Sequence[HitResult]) -> Exits:
        """The cores of hits by finite elements."""
        flights = np.array([hit.flight for hit in hits])
        states = flights["state"]
        return cls(
            status=np.array([int(hit.status) for hit in hits], dtype=np.int8),
            position=np.asarray(states["position"], dtype=np.float64),
            velocity=np.asarray(states["velocity"], dtype=np.float64),
            momentum=np.asarray(states["angular_momentum"], dtype=np.float64),
            attitude=np.asarray(states["attitude"], dtype=np.float64),
            touched=np.array([hit.touched for hit in hits]),
            time=flights["time"],
            share=np.array([hit.fragments.share if hit.fragments else 1.0 for hit in hits]),
            stretch=np.array([(hit.fragments.front, hit.fragments.rear) if hit.fragments else WHOLE for hit in hits]),
        )

    @property
    def axis(self) -> Array:
        """Unit vectors along the cores towards their noses, shape [hits, 3]."""
        return axis_of(self.attitude)


def outcomes_of(memory: Memory, hits: list[HitResult], worker: Worker) -> Outcomes:
    """The outcomes of some hits: the way through other layers and the flight to the stand-offs are by the fast law."""
    contact, exits, flights = memory.outcomes(), Exits.of(hits), np.array([hit.flight for hit in hits])
    touched = flights["first_touch"] >= 0.0
    duration = np.where(touched, flights["last_touch"] - flights["first_touch"], 0.0)
    losses = [hit.fragments.lost if hit.fragments else hit.energies.lost for hit in hits]
    loss = np.where(touched, losses, 0.0)
    _fill(contact, exits, steps=flights["steps"], contact_duration=duration, energy_loss=loss)
    if memory.variant.bends:
        memory.bending.assign(flights["bending"].astype(memory.bending.numpy().dtype))
    if memory.variant.layered:
        _fill_passage(memory, hits)
    go_on(memory, exits, contact, worker)
    more: dict[str, Any] = {
        ENERGY_IMBALANCE: [hit.energies.imbalance for hit in hits],
        HOURGLASS_SHARE: [hit.energies.hourglass_share for hit in hits],
        ERODED_ELEMENTS: [float(hit.eroded) for hit in hits],
    }
    if hits and hits[0].fragments is not None:
        more |= _fragment_columns(hits)
    if exits.touched.shape[1] < len(memory.prepared.scene.target.layers):
        more |= _handover_columns(memory, exits)
    return memory.report(contact).assign(**{name: np.array(values) for name, values in more.items()})


def _fragment_columns(hits: Sequence[HitResult]) -> dict[str, Any]:
    """What is left of cores of elements."""
    every = [hit.fragments for hit in hits if hit.fragments]
    names = ("number", "mass", "front", "rear", "eroded", "energy", "broken", "section")
    rows = [[float(getattr(one, name)) for name in names] for one in every]
    columns = zip(FRAGMENT_VARIABLES, np.array(rows).T, strict=True)
    failed = np.array([hit.status.failed for hit in hits])
    return {name: np.where(failed, np.nan, column) for name, column in columns}


def _handover_columns(memory: Memory, exits: Exits) -> dict[str, Any]:
    """How cores leave the last layer of elements; NaN of those that stop before."""
    body = memory.prepared.scene.core.mass_properties
    along = np.sum(exits.momentum * exits.axis, axis=1, keepdims=True) * exits.axis
    rate = along / body.inertia_axial + (exits.momentum - along) / body.inertia_transverse
    passed = has_passed(exits.status)[:, None]
    columns = zip(HANDOVER_VARIABLES, (exits.velocity, exits.axis, rate, exits.position), strict=True)
    return {name: np.where(passed, values, np.nan) for name, values in columns}


def march_on(scene: Scene, shots: Shots, exits: Exits, worker: Worker, method: FastLaw) -> Outcomes:
    """How cores end that have left the first layers so, by the fast law; without other layers they fly on.

    Args:
        scene: the whole target; it records no bending.
        method: at a resolution.
    """
    memory = memory_of(scene, shots, worker)
    contact, body = memory.outcomes(), scene.core.mass_properties
    heavier = shots.value("mass", body.mass) / body.mass  # moments of inertia in the same ratio
    along = np.sum(exits.momentum * exits.axis, axis=1) / heavier
    across = np.maximum(np.sum(exits.momentum**2, axis=1) / heavier**2 - along**2, 0.0)
    left = sum(energies(body, np.sum(exits.velocity**2, axis=1), along, across))
    loss = heavier * (0.5 * body.mass * shots.velocity**2 - exits.share * left)
    _fill(contact, exits, steps=0, contact_duration=np.nan, energy_loss=np.where(exits.touched.any(axis=1), loss, 0.0))
    if memory.variant.layered:
        columns, last, passed = _empty_passage(memory), exits.touched.shape[1] - 1, has_passed(exits.status)
        crossed = np.where(exits.touched, Status.PERFORATED, Status.UNTOUCHED)
        columns["status"][:, : last + 1] = np.where(passed[:, None], crossed, exits.status[:, None])
        fire = line_of_flight(shots.obliquity, shots.azimuth)
        columns["velocity"][:, last] = np.where(passed, np.linalg.norm(exits.velocity, axis=1), np.nan)
        columns["tilt"][:, last] = np.where(passed, angle_between(exits.axis, fire), np.nan)
    go_on(memory, exits, contact, worker, method)
    return memory.report(contact)


def _fill(contact: Any, exits: Exits, **others: Any) -> None:
    """The end of contact of cores that leave the first layers so."""
    columns = {"status": exits.status, "position": exits.position, "velocity": exits.velocity, "axis": exits.axis}
    for name, values in (columns | {"angular_momentum": exits.momentum} | others).items():
        array = getattr(contact, name)
        shape, dtype = array.numpy().shape, array.numpy().dtype
        array.assign(np.broadcast_to(np.asarray(values, dtype=dtype), shape).reshape(shape).copy())


def _empty_passage(memory: Memory) -> dict[str, NDArray[Any]]:
    """The passage through all layers, which no core reaches yet, as views of memory on the CPU."""
    columns = {name: getattr(memory.passage, name).numpy() for name in memory.passage._cls.vars}
    for values in columns.values():
        values[...] = np.nan if values.dtype.kind == "f" else -1
    columns["status"][...] = Status.NOT_REACHED
    return columns


def _fill_passage(memory: Memory, hits: list[HitResult]) -> None:
    """How each core left each layer, as kernels/layers.py has it."""
    shots, target, columns = memory.prepared.shots, memory.prepared.scene.target, _empty_passage(memory)
    for k, hit in enumerate(hits):
        flight = line_of_flight(float(shots.obliquity[k]), float(shots.azimuth[k]))
        for layer, (velocity, axis) in enumerate(zip(hit.left[:, :3], hit.left[:, 3:6], strict=True)):
            touched = bool(hit.touched[layer])
            if not math.isnan(hit.left[layer, 6]):
                status = Status.PERFORATED if touched else Status.UNTOUCHED
                columns["velocity"][k, layer] = np.linalg.norm(velocity)
                columns["tilt"][k, layer] = angle_between(axis, flight)
            elif not touched:
                status = Status.NOT_REACHED
            else:
                status = hit.status if hit.status.failed or hit.status is Status.ARRESTED else Status.RICOCHETED
            columns["status"][k, layer] = status
        resting = np.flatnonzero(columns["status"][k] == Status.ARRESTED)
        if hit.status is Status.ARRESTED and len(resting):
            columns["stopped_in"][k] = resting[-1]
            state = hit.flight["state"]
            nose = memory.prepared.scene.core.mass_properties.centre_of_mass
            foremost = state["position"][0] + nose * axis_of(state["attitude"])[0]
            columns["depth"][k] = foremost - target.faces[resting[-1]][0]


def go_on(memory: Memory, exits: Exits, contact: Any, worker: Worker, method: FastLaw = NUMERICS) -> None:
    """March cores on from the first layers to the end of contact. Without further layers they stay.

    Args:
        memory: of the whole target on the CPU; its bending and its passage through the first layers are filled.
        exits: how the cores left these layers.
        contact: the end of contact there, which is replaced where a core goes on.
    """
    scene, first = memory.prepared.scene, exits.touched.shape[1]
    which = np.flatnonzero(has_passed(exits.status))
    if first == len(scene.target.layers) or not len(which):
        return
    stretches, of_core = np.unique(exits.stretch[which].round(STRETCH_DIGITS), axis=0, return_inverse=True)
    for number, (front, rear) in enumerate(stretches):
        alike = which[of_core.ravel() == number]
        _go_on_as(scene.core.between(front, rear), memory, exits, alike, contact, worker, method)


def _go_on_as(
    body: Core, memory: Memory, exits: Exits, which: NDArray[np.int64], contact: Any, worker: Worker, method: FastLaw
) -> None:
    """March some cores on, of which the same body is left; other arguments as in `go_on`."""
    scene, shots, first = memory.prepared.scene, memory.prepared.shots[which], exits.touched.shape[1]
    share, whole, part = exits.share[which], scene.core.mass_properties, body.mass_properties
    if body is not scene.core or (share != 1.0).any():
        shots = shots.assign({"mass": share * shots.value("mass", whole.mass)})
    behind = Memory(prepare(scene.model_copy(update={"core": body}), shots, method), memory.device, worker.cancel)
    states = np.zeros(len(which), dtype=behind.stage.State.numpy_dtype())
    for name in ("position", "velocity", "attitude"):
        states[name] = getattr(exits, name)[which]
    momentum = _as_body(exits.momentum[which], exits.axis[which], whole, part)
    states["angular_momentum"] = share[:, None] * momentum
    behind.inputs.starts = wp.array(states, dtype=behind.stage.State, device=memory.device)
    _, _, ended = march(behind, worker)
    touched, status = exits.touched[which].any(axis=1), ended.status.numpy()
    # Arrays of the CPU are changed in place.
    contact.status.numpy()[which] = np.where((status == Status.UNTOUCHED) & touched, Status.PERFORATED, status)
    for name in ("position", "axis", "velocity"):
        getattr(contact, name).numpy()[which] = getattr(ended, name).numpy()
    momentum = _as_body(ended.angular_momentum.numpy(), ended.axis.numpy(), part, whole)
    contact.angular_momentum.numpy()[which] = momentum / share[:, None]
    for name in ("steps", "contact_duration", "energy_loss"):
        getattr(contact, name).numpy()[which] += getattr(ended, name).numpy()
    for name in ("status", "velocity", "tilt"):
        getattr(memory.passage, name).numpy()[which, first:] = getattr(behind.passage, name).numpy()[:, first:]
    for name in ("stopped_in", "depth"):
        getattr(memory.passage, name).numpy()[which] = getattr(behind.passage, name).numpy()
    if memory.variant.bends:
        rows, later = memory.bending.numpy(), behind.bending.numpy()
        later["broken_time"] += exits.time[which]
        rows[which] = worse_bending(rows[which], later)
        memory.bending.assign(rows)


def _as_body(momentum: Array, axis: Array, one: MassProperties, other: MassProperties) -> Array:
    """Angular momentum of another body of the same mass and rate of turn, shape [hits, 3]."""
    axial, transverse = (
        getattr(other, name) * one.mass / (getattr(one, name) * other.mass)
        for name in ("inertia_axial", "inertia_transverse")
    )
    along = np.sum(momentum * axis, axis=1, keepdims=True) * axis
    return np.asarray(transverse * momentum + (axial - transverse) * along)


def worse_bending(before: NDArray[Any], later: NDArray[Any]) -> NDArray[Any]:
    """The larger moment and stress of two passages, and the first break, as rows of the kernels' Bending."""
    worst = before.copy()
    for name in ("moment", "stress"):
        larger = later[name] > before[name]
        for column in (name, f"{name}_station"):
            worst[column] = np.where(larger, later[column], before[column])
    breaks = (before["broken"] == 0) & (later["broken"] != 0)
    for column in (name for name in before.dtype.names or () if name.startswith("broken")):
        worst[column] = np.where(breaks, later[column], before[column])
    return worst
