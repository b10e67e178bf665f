"""What follows on the finite elements: cores go on by the fast law, through other layers and to the stand-offs.

A solid base is what the fast law is fitted to, by published limit velocities, and what takes elements longest.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.continuum.one_hit import HitResult
from warpimpact.kernels.continuum import choices
from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.records.variables import ENERGY_IMBALANCE, ERODED_ELEMENTS, HOURGLASS_SHARE
from warpimpact.scene import Core, Scene, Shots, Target
from warpimpact.scene.rigid import angle_between, axis_of, line_of_flight
from warpimpact.scene.target import layer_name
from warpimpact.solver.device import Worker, find_device
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.marching import march
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare

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


def outcomes_of(memory: Memory, hits: list[HitResult], worker: Worker) -> Outcomes:
    """The outcomes of some hits: the way through other layers and the flight to the stand-offs are by the fast law."""
    contact = memory.outcomes()
    flights = np.array([hit.flight for hit in hits])
    states, touched = flights["state"], flights["first_touch"] >= 0.0
    columns = {
        "status": [int(hit.status) for hit in hits],
        "steps": flights["steps"],
        "contact_duration": np.where(touched, flights["last_touch"] - flights["first_touch"], 0.0),
        "energy_loss": np.where(touched, [hit.energies.lost for hit in hits], 0.0),
        "axis": [axis_of(attitude) for attitude in states["attitude"]],
    } | {name: states[name] for name in ("position", "velocity", "angular_momentum")}
    for name, values in columns.items():
        array = getattr(contact, name)
        array.assign(np.asarray(values, dtype=array.numpy().dtype).reshape(array.numpy().shape))
    if memory.variant.bends:
        memory.bending.assign(flights["bending"].astype(memory.bending.numpy().dtype))
    if memory.variant.layered:
        _fill_passage(memory, hits)
    go_on(memory, hits, contact, worker)
    more = {
        ENERGY_IMBALANCE: [hit.energies.imbalance for hit in hits],
        HOURGLASS_SHARE: [hit.energies.hourglass_share for hit in hits],
        ERODED_ELEMENTS: [float(hit.eroded) for hit in hits],
    }
    return memory.report(contact).assign(**{name: np.array(values) for name, values in more.items()})


def _fill_passage(memory: Memory, hits: list[HitResult]) -> None:
    """How each core left each layer, as kernels/layers.py has it."""
    passage, shots, target = memory.passage, memory.prepared.shots, memory.prepared.scene.target
    columns = {name: getattr(passage, name).numpy() for name in passage._cls.vars}  # views of memory on the CPU
    for values in columns.values():
        values[...] = np.nan if values.dtype.kind == "f" else -1
    columns["status"][...] = Status.NOT_REACHED
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


def go_on(memory: Memory, hits: Sequence[HitResult], contact: Any, worker: Worker) -> None:
    """March cores on from their last layer of elements to the end of contact. Without further layers they stay.

    Args:
        memory: of the whole target on the CPU; its bending and its passage through the layers of elements are filled.
        hits: how the cores left these layers.
        contact: the end of contact by elements, which is replaced where a core goes on.
    """
    scene, shots, first = memory.prepared.scene, memory.prepared.shots, len(hits[0].touched)
    which = [k for k, hit in enumerate(hits) if hit.status in (Status.PERFORATED, Status.UNTOUCHED)]
    if first == len(scene.target.layers) or not which:
        return
    behind = Memory(prepare(scene, shots[np.array(which)], NUMERICS), memory.device, worker.cancel)
    states = np.array([hits[k].flight["state"] for k in which]).astype(behind.stage.State.numpy_dtype())
    behind.inputs.starts = wp.array(states, dtype=behind.stage.State, device=memory.device)
    _, _, ended = march(behind, worker)
    touched, status = np.array([hits[k].touched.any() for k in which]), ended.status.numpy()
    # Arrays of the CPU are changed in place.
    contact.status.numpy()[which] = np.where((status == Status.UNTOUCHED) & touched, Status.PERFORATED, status)
    for name in ("position", "axis", "velocity", "angular_momentum"):
        getattr(contact, name).numpy()[which] = getattr(ended, name).numpy()
    for name in ("steps", "contact_duration", "energy_loss"):
        getattr(contact, name).numpy()[which] += getattr(ended, name).numpy()
    for name in ("status", "velocity", "tilt"):
        getattr(memory.passage, name).numpy()[which, first:] = getattr(behind.passage, name).numpy()[:, first:]
    for name in ("stopped_in", "depth"):
        getattr(memory.passage, name).numpy()[which] = getattr(behind.passage, name).numpy()
    if memory.variant.bends:
        rows, later = memory.bending.numpy(), behind.bending.numpy()
        later["broken_time"] += [hits[k].flight["time"] for k in which]
        rows[which] = worse_bending(rows[which], later)
        memory.bending.assign(rows)


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
