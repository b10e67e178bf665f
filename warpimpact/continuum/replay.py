"""One hit of the continuum again, with the history of its core and what is left of its plate."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.continuum.finite_elements import FiniteElements
from warpimpact.continuum.handover import memory_of, outcomes_of
from warpimpact.continuum.one_hit import FIRST, Attempt, HitResult, OneHit
from warpimpact.kernels.trace import WIDTH
from warpimpact.scene import Scene, Shots
from warpimpact.scene.model import Array
from warpimpact.solver.device import Worker
from warpimpact.solver.replay import Deformed, History, Replay, Weakened

STRIDE = 20
"""Steps between two rows of a history."""


def replay_continuum(scene: Scene, shots: Shots, method: FiniteElements, snapshots: int = 6) -> Replay:
    """Compute one shot again with its history, every 20 steps; its end has the same bits as before. A cell of the plate
    has the share of its elements that are left, seen along the thickness.

    Raises:
        ValueError: as in `FiniteElements.check`.
    """
    method.check(scene)
    memory = memory_of(scene, shots, Worker("cpu", 1))
    prepared = partial(method.prepare_hit, scene, shots, 0, memory.prepared.conditions)
    following: Attempt | None = FIRST
    while following:
        attempt, hit = following, prepared(attempt=following)
        result, rows, _ = _followed(hit, [])
        following = attempt.after(result.status)
    shown, frames = np.unique(np.linspace(0, len(rows) - 1, snapshots).round().astype(int)), list[Frame]()
    if snapshots:
        hit = prepared(attempt=attempt)
        _, _, frames = _followed(hit, shown)
    trace = np.array(rows)  # as a trace has it, a row holds the load that follows; the last one has none
    trace[:-1, 14:21], trace[-1, 14:21] = trace[1:, 14:21], 0.0
    plate = len(hit.bullet)  # behind the bodies of the bullet
    mesh, first = hit.meshes[plate], hit.firsts[plate]
    # The columns of the fine part of the mesh, which are cells of one size.
    places = np.ix_(*(np.isclose(np.diff(edges), mesh.spacing, rtol=1e-6) for edges in mesh.edges))
    y, z = (0.5 * (edges[1:] + edges[:-1]) for edges in mesh.edges)
    planes = (frame.alive[first : first + mesh.nodes].reshape(mesh.present.shape) for frame in frames)
    share = [alive[:-1, :-1, :-1].mean(axis=0)[places] for alive in planes]
    weakened = Weakened(
        float(shots.hit_y[0]) + y[places[0][:, 0]],
        float(shots.hit_z[0]) + z[places[1][0]],
        np.array(share, dtype=np.float64).reshape(-1, *mesh.present[0, :-1, :-1][places].shape),
    )
    return Replay(
        outcomes=outcomes_of(memory, [result], Worker("cpu", 1)),
        history=History.from_trace(trace, hit.start.body),
        plate_time=trace[shown, 0],
        plate=weakened,
        deformed=_deformed(frames, hit) if frames else None,
    )


class Frame(NamedTuple):
    """A mesh at an instant, in the memory of the solver: places of nodes [m], what is left, plastic strain."""

    position: NDArray[np.float32]
    alive: NDArray[np.float32]
    strain: NDArray[np.float32]


def _followed(hit: OneHit, shown: Sequence[int] | NDArray[np.intp]) -> tuple[HitResult, list[Array], list[Frame]]:
    """What became of a hit, the rows of its trace, and the meshes at some of them."""
    rows, frames = list[Array](), list[Frame]()

    def follow(hit: OneHit) -> None:
        if len(rows) in shown:
            frames.append(Frame(*(getattr(hit.mesh, name).numpy().astype(np.float32) for name in Frame._fields)))
        rows.append(_row(hit, rows[-1] if rows else None))

    follow(hit)
    return hit.march(every=STRIDE, follow=follow), rows, frames


def _row(hit: OneHit, before: Array | None) -> Array:
    """A row of the trace (kernels/trace.py): the load is the mean since the row before."""
    flight, row = hit.flight, np.zeros(WIDTH)
    state = flight["state"]
    row[0], row[1:4], row[4:8] = flight["time"], state["position"], state["attitude"]
    row[8:11], row[11:14] = state["velocity"], state["angular_momentum"]
    if before is not None:
        row[20] = row[0] - before[0]
        row[14:17] = hit.start.body.mass * (row[8:11] - before[8:11]) / max(row[20], 1e-30)
        row[17:20] = (row[11:14] - before[11:14]) / max(row[20], 1e-30)
    return row


def _deformed(frames: list[Frame], hit: OneHit) -> Deformed:
    """The elements that there were at the beginning, and their nodes; layers without a mesh yet lie at rest."""
    elements, corners = list[NDArray[np.intp]](), list[NDArray[np.intp]]()
    position = np.zeros((3, int(hit.mesh.size)), dtype=np.float32)
    for mesh, first in zip(hit.meshes, hit.firsts, strict=True):
        present = np.flatnonzero(mesh.present)
        elements.append(first + present)
        corners.append(first + mesh.corners(present))
        position[:, first : first + mesh.nodes] = mesh.position.reshape(3, -1)
    numbers, chosen = np.concatenate(elements), np.concatenate(corners)
    nodes, renumbered = np.unique(chosen, return_inverse=True)
    left = np.ones((len(frames), len(numbers)), dtype=bool)
    positions, strain = [], np.zeros(left.shape, np.float32)
    for k, frame in enumerate(frames):
        there = numbers < len(frame.alive)
        left[k, there], strain[k, there] = frame.alive[numbers[there]] > 0.0, frame.strain[numbers[there]]
        places = np.hstack([frame.position.reshape(3, -1), position[:, len(frame.alive) :]])
        positions.append(places[:, nodes].T)
    return Deformed(renumbered.reshape(chosen.shape).astype(np.int32), np.array(positions), left, strain)
