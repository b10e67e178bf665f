"""One shot computed again with its history, and with the resistance left in its plate."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any, NamedTuple, Self

import numpy as np
import warp as wp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from warpimpact.kernels.trace import COLUMNS, WIDTH
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import MassProperties, Plate, Scene, Shots
from warpimpact.scene.rigid import energies
from warpimpact.solver.device import find_device, free_memory
from warpimpact.solver.marching import March, march
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare
from warpimpact.solver.settings import FastLawSettings

Array = NDArray[np.float64]

HISTORY_BYTES = 1000
"""Memory per step of a history until it is written [bytes]: its trace, and twice the columns of its Dataset."""
SNAPSHOT_COPIES, OTHER_COPIES = 3, 8
"""Numbers per cell until the file is written: those of each snapshot, and those of the computation."""
NODES_AT_A_TIME = 2**13
"""Nodes of a window that are computed together."""
SAMPLES, MOST_POINTS = 16, 2**24
"""Points along the side of a node with an edge; and most points of all such nodes. A wide window full of small holes
has fewer points along a side, because it would take minutes."""


@dataclass(frozen=True)
class History:
    """State of a core in the middle of every step and at the end of contact: plate frame, SI.

    Attributes:
        time: since the first touch of the front face [s], shape [steps].
        step: length of the step, over which force and moment act [s], shape [steps].
        position: of the centre of mass, from the hit point [m], shape [steps, 3].
        attitude: unit quaternion (x, y, z, w) that turns the plate's axes into the core's, shape [steps, 4].
        core_axis: unit vector along the core towards its nose, shape [steps, 3].
        velocity: of the centre of mass, at the end of the step [m/s], shape [steps, 3].
        angular_velocity: at the end of the step [rad/s], shape [steps, 3].
        force, moment: means over the step, about the centre of mass [N] and [N m], shape [steps, 3].
        translational_energy, rotational_energy: at the end of the step [J], shape [steps].
    """

    time: Array
    step: Array
    position: Array
    attitude: Array
    core_axis: Array
    velocity: Array
    angular_velocity: Array
    force: Array
    moment: Array
    translational_energy: Array
    rotational_energy: Array

    @classmethod
    def from_trace(cls, trace: Array, body: MassProperties) -> Self:
        """Read a trace of shape [steps, WIDTH] (kernels/trace.py)."""
        columns = {name: trace[:, part] for name, part in COLUMNS.items()}
        momentum, velocity = columns.pop("angular_momentum"), columns["velocity"]
        columns |= {name: columns[name][:, 0] for name in ("time", "step")}
        axis = Rotation.from_quat(columns["attitude"]).apply([1.0, 0.0, 0.0])
        spin = np.sum(momentum * axis, axis=1, keepdims=True)
        along = spin * axis
        omega = along / body.inertia_axial + (momentum - along) / body.inertia_transverse
        # L × a is 0 where L − (L·a) a is what rounding leaves; ½ L·ω of a spinning disc would take it for a rotation.
        across = np.sum(np.cross(momentum, axis) ** 2, axis=1)
        translational, rotational = energies(body, np.sum(velocity**2, axis=1), spin[:, 0], across)
        return cls(
            **columns,
            core_axis=axis,
            angular_velocity=omega,
            translational_energy=translational,
            rotational_energy=rotational,
        )


class Weakened(NamedTuple):
    """Resistance left of the plate in the window about the hit.

    Attributes:
        cell_y, cell_z: centres of the cells in the plane of the plate [m], shapes [cells_y] and [cells_z].
        share: remaining share of the resistance Y, mean through the thickness, 0 in holes; shape
            [snapshots, cells_y, cells_z].
    """

    cell_y: Array
    cell_z: Array
    share: Array


class Deformed(NamedTuple):
    """The finite elements of all layers as they deform.

    Attributes:
        corners: numbers of the nodes at the corners of each element, in the order of VTK, shape [elements, 8].
        position: of the nodes from the hit point [m], shape [snapshots, nodes, 3].
        left: whether an element has not failed, shape [snapshots, elements].
        strain: plastic strain, same shape.
    """

    corners: NDArray[np.int32]
    position: NDArray[np.float32]
    left: NDArray[np.bool_]
    strain: NDArray[np.float32]


@dataclass(frozen=True)
class Replay:
    """One shot with its full history: SI, float64.

    Attributes:
        outcomes: outcomes of the one shot.
        history: state of the core at every step, and at the end.
        plate_time: instants at which the plate is shown [s], shape [snapshots]; 0 is the first touch.
        plate: the plate at these instants.
        deformed: the layers of a hit by finite elements.
    """

    outcomes: Outcomes
    history: History
    plate_time: Array
    plate: Weakened
    deformed: Deformed | None = None


def replay(scene: Scene, shots: Shots, *, numerics: FastLawSettings, snapshots: int = 6) -> Replay:
    """Compute one shot again on the CPU, with its history. The outcome equals that of `simulate` on the same CPU, bit
    for bit.

    Args:
        shots: the shot alone.
        numerics: the resolution with which `simulate` computed it.
        snapshots: number of instants at which the plate is shown, evenly from the first touch to the end. For each of
            them the shot is computed again up to there; 0 computes no field.

    Raises:
        MemoryError: history and snapshots do not fit; the message is for the user.
    """
    memory, cells, contact = traced(scene, shots, numerics, snapshots)
    trace = traces_of(memory, contact)[-1]
    outcomes = memory.report(contact)[-1:]  # before snapshots overwrite the results of the march
    time_step = float(memory.prepared.conditions["time_step"][-1])
    steps = np.unique(np.linspace(0, len(trace) - 1, snapshots).round().astype(int))
    spacing = memory.prepared.grid.spacing
    cell_y, cell_z = (
        np.asarray(hit[-1] + (np.arange(cells) - cells // 2) * spacing) for hit in (shots.hit_y, shots.hit_z)
    )
    own = {
        name: float(memory.prepared.conditions[name][-1]) for name in ("mass", "inertia_axial", "inertia_transverse")
    }
    history = History.from_trace(trace, scene.core.mass_properties._replace(**own))
    share = np.empty((0, len(cell_y), len(cell_z)))
    if len(steps):
        material = material_about(scene.target.layers[0], cell_y, cell_z, spacing)
        scratch = memory.scratch(1, cells)
        if memory.variant.layered and memory.variant.degrades:  # the window of a layer opens with a step
            scratch.fields.exposure.zero_()
        share = np.stack([_share_after(memory, cells, scratch, count, time_step, material) for count in steps])
    return Replay(
        outcomes=outcomes,
        history=history,
        plate_time=history.time[steps] - 0.5 * history.step[steps] if memory.variant.layered else steps * time_step,
        plate=Weakened(cell_y, cell_z, share),
    )


def traced(scene: Scene, shots: Shots, numerics: FastLawSettings, snapshots: int = 0) -> March:
    """March shots on the CPU with their histories.

    They march twice, because the largest number of steps that a shot may take is thousands of times the real one.

    Raises:
        MemoryError: the histories and the snapshots do not fit.
    """
    prepared = replace(prepare(scene, shots, numerics), slide=False)
    device = find_device("cpu")
    first = march(Memory(prepared, device))
    steps = int(first.outcomes.steps.numpy().max())
    cells = first.cells**2
    of_a_cell = 8 * (SNAPSHOT_COPIES * snapshots + OTHER_COPIES) if snapshots else 0
    needed = HISTORY_BYTES * len(shots) * steps + of_a_cell * cells + first.memory.slot_bytes(first.cells)
    if needed > (free := free_memory()):
        fewer = "; fewer snapshots need less" if snapshots else ""
        raise MemoryError(
            f"the history of {steps} steps with {snapshots} snapshots of {cells} cells needs {needed / 2**30:.3g} GiB, "
            f"and {free / 2**30:.3g} GiB are free{fewer}"
        )
    # Several shots would all get the widest window. One that left this window would take more steps in a wider one.
    cells_again = first.cells if len(shots) == 1 else None
    return march(Memory(replace(prepared, rows=steps + 1), device), cells=cells_again)


def traces_of(memory: Memory, contact: Any) -> list[Array]:
    """The trace of every shot of a traced march, with the state at its end."""
    prepared = memory.prepared
    rows = memory.history.numpy().reshape(len(prepared.shots), prepared.rows, WIDTH)
    return [row[: steps + 1].astype(np.float64) for row, steps in zip(rows, contact.steps.numpy(), strict=True)]


def _share_after(memory: Memory, cells: int, scratch: Any, steps: int, time_step: float, material: Array) -> Array:
    """Share of the plate's resistance after some steps of the shot on the CPU.

    Args:
        cells: of the plate's window.
        scratch: of one slot.
        material: share of material in each cell.
    """
    prepared, outcomes, fields = memory.prepared, memory.outcomes(), scratch.fields
    memory.give_up_after((steps - 0.5) * time_step * prepared.shots.velocity[-1])
    memory.launch(memory.put(np.arange(1), wp.int32), outcomes, scratch, 1, [(0, 1)])
    if memory.variant.nodal:
        return np.array(fields.share.numpy().reshape(cells, cells), dtype=np.float64)
    if not prepared.materials[0].weakens:
        return material
    exposure = fields.exposure.numpy()[: cells**2].reshape(cells, cells).astype(np.float64)
    return np.asarray(material * np.exp(prepared.materials[0].decay_rate[-1] * exposure))


def material_about(plate: Plate, y: Array, z: Array, spacing: float) -> Array:
    """Share of material about every node, shape [nodes_y, nodes_z]; points are taken where an edge may be."""
    share, rows = np.empty((len(y), len(z))), max(1, NODES_AT_A_TIME // len(z))
    parts = {first: y[first : first + rows, None] for first in range(0, len(y), rows)}
    edges = {first: np.abs(plate.edge_distance(along_y, z)) <= spacing for first, along_y in parts.items()}
    nodes = max(1, sum(int(edge.sum()) for edge in edges.values()))
    samples = min(SAMPLES, max(2, math.isqrt(MOST_POINTS // nodes)))
    fine = ((np.arange(samples) + 0.5) / samples - 0.5) * spacing
    for first, along_y in parts.items():
        share[first : first + rows] = plate.is_solid(along_y, z)
        row, column = np.nonzero(edges[first])
        points = along_y[row, :, None] + fine[:, None], z[column, None, None] + fine
        share[first + row, column] = plate.is_solid(*points).mean(axis=(1, 2))
    return share
