"""One hit of the continuum again, with the history of its core and what is left of its plate."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.continuum.encounter import WIDER, HitResult, March, march_of
from warpimpact.continuum.one_hit import OneHit
from warpimpact.continuum.simulate import check_continuum, memory_of, outcomes_of
from warpimpact.kernels.status import Status
from warpimpact.kernels.trace import WIDTH
from warpimpact.scene import Scene, Shots
from warpimpact.scene.flow import Continuum
from warpimpact.scene.model import Array
from warpimpact.solver.replay import Deformed, History, Replay, Weakened
from warpimpact.solver.worker import Worker

STRIDE = 20
"""Steps between two rows of a history."""
CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
"""Corners of an element along x, y and z, in the order of VTK."""


def replay_continuum(scene: Scene, shots: Shots, continuum: Continuum, snapshots: int = 6) -> Replay:
    """Compute one shot again with its history, every 20 steps; its end has the same bits as before. A cell of the plate
    has the share of its elements that are left, seen along the thickness.

    Raises:
        ValueError: as in `check_continuum`.
    """
    check_continuum(scene, shots, continuum)
    memory = memory_of(scene, shots, Worker("cpu", 1))
    for wider in WIDER:
        march = march_of(scene, shots, 0, continuum, memory.prepared.conditions, wider=wider)
        result, rows, _ = _followed(march, [])
        if result.status is not Status.LEFT_WINDOW:
            break
    shown = np.unique(np.linspace(0, len(rows) - 1, snapshots).round().astype(int))
    frames = list[Frame]()
    if snapshots:
        march = march_of(scene, shots, 0, continuum, memory.prepared.conditions, wider=wider)
        _, _, frames = _followed(march, shown)
    start = march.hit.start
    body = scene.core.mass_properties._replace(
        mass=start.mass, inertia_axial=start.inertia_axial, inertia_transverse=start.inertia_transverse
    )
    trace = np.array(rows)  # as a trace has it, a row holds the load that follows; the last one has none
    trace[:-1, 14:21], trace[-1, 14:21] = trace[1:, 14:21], 0.0
    sheet = march.hit.sheets[0]
    # The columns of the fine part of the mesh, which are cells of one size.
    places = np.ix_(*(np.isclose(np.diff(edges), sheet.spacing, rtol=1e-6) for edges in sheet.edges))
    y, z = (0.5 * (edges[1:] + edges[:-1]) for edges in sheet.edges)
    cell_y, cell_z = float(shots.hit_y[0]) + y[places[0][:, 0]], float(shots.hit_z[0]) + z[places[1][0]]
    material = np.asarray(sheet.solid[places], dtype=np.float64)
    elements = slice(march.hit.firsts[0], march.hit.firsts[0] + sheet.nodes)
    planes = (frame.alive[elements].reshape(len(sheet.x), *sheet.y.shape)[:-1, :-1, :-1] for frame in frames)
    share = np.array([alive.mean(axis=0)[places] for alive in planes], dtype=np.float64)
    return Replay(
        outcomes=outcomes_of(memory, [result]),
        history=History.from_trace(trace, body),
        plate_time=np.array([rows[row][0] for row in shown]),
        plate=Weakened(cell_y, cell_z, share.reshape(-1, *material.shape)),
        deformed=deformed(frames, march.hit) if frames else None,
    )


class Frame(NamedTuple):
    """A mesh at an instant, in the memory of the solver: places of nodes [m], what is left, plastic strain."""

    position: NDArray[np.float32]
    alive: NDArray[np.float32]
    strain: NDArray[np.float32]


def _followed(march: March, shown: Sequence[int] | NDArray[np.intp]) -> tuple[HitResult, list[Array], list[Frame]]:
    """What became of a hit, the rows of its trace, and the meshes at some of them."""
    rows, frames = list[Array](), list[Frame]()

    def follow(hit: OneHit) -> None:
        if len(rows) in shown:
            arrays = (getattr(hit.mesh, name).numpy().astype(np.float32) for name in Frame._fields)
            frames.append(Frame(*arrays))
        rows.append(_row(hit, rows[-1] if rows else None))

    follow(march.hit)
    return march.ended(every=STRIDE, follow=follow), rows, frames


def deformed(frames: list[Frame], hit: OneHit) -> Deformed:
    """The elements that there were at the beginning, and their nodes."""
    elements, corners = list[NDArray[np.intp]](), list[NDArray[np.intp]]()
    for sheet, first in zip(hit.sheets, hit.firsts, strict=True):
        present = first + np.flatnonzero(sheet.alive)
        offsets = [x * sheet.plane + y * sheet.row + z for x, y, z in CORNERS]
        elements.append(present)
        corners.append(present[:, None] + np.array(offsets))
    numbers, chosen = np.concatenate(elements), np.concatenate(corners)
    nodes, renumbered = np.unique(chosen, return_inverse=True)
    frames = [whole(frame, hit) for frame in frames]
    return Deformed(
        corners=renumbered.reshape(chosen.shape).astype(np.int32),
        position=np.array([frame.position.reshape(3, -1)[:, nodes].T for frame in frames]),
        left=np.array([frame.alive[numbers] > 0.0 for frame in frames]),
        strain=np.array([frame.strain[numbers] for frame in frames]),
    )


def whole(frame: Frame, hit: OneHit) -> Frame:
    """A frame with the layers that had no mesh yet, at rest."""
    size, there = int(hit.mesh.size), len(frame.alive)
    position, alive, strain = np.zeros((3, size), np.float32), np.zeros(size, np.float32), np.zeros(size, np.float32)
    for sheet, first in zip(hit.sheets, hit.firsts, strict=True):
        position[:, first : first + sheet.nodes] = sheet.positions
        alive[first : first + sheet.nodes] = sheet.alive
    position[:, :there], alive[:there] = frame.position.reshape(3, -1), frame.alive
    strain[:there] = frame.strain
    return Frame(position, alive, strain)


def _row(hit: OneHit, before: Array | None) -> Array:
    """A row of the trace (kernels/trace.py): the load is the mean since the row before."""
    flight, row = hit.flight, np.zeros(WIDTH)
    state = flight["state"]
    row[0], row[1:4], row[4:8] = flight["time"], state["position"], state["attitude"]
    row[8:11], row[11:14] = state["velocity"], state["angular_momentum"]
    if before is not None:
        row[20] = row[0] - before[0]
        row[14:17] = hit.start.mass * (row[8:11] - before[8:11]) / max(row[20], 1e-30)
        row[17:20] = (row[11:14] - before[11:14]) / max(row[20], 1e-30)
    return row
