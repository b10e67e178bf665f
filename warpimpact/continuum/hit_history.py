"""One hit of the continuum again, with the history of its core and what is left of its plate."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpimpact.continuum.meshing import SheetMesh
from warpimpact.continuum.one_hit import OneHit
from warpimpact.continuum.strikes import check_continuum, march_of, memory_of, outcomes_of
from warpimpact.kernels.trace import WIDTH
from warpimpact.scene import Scene, Shots
from warpimpact.scene.flow import Continuum
from warpimpact.solver.history import History
from warpimpact.solver.replay import Replay
from warpimpact.solver.worker import Worker

Array = NDArray[np.float64]

STRIDE = 20
"""Steps between two rows of a history."""


def replay_continuum(scene: Scene, shots: Shots, continuum: Continuum, snapshots: int = 6) -> Replay:
    """Compute one shot again with its history, every 20 steps; its end has the same bits as before. A cell of the plate
    has the share of its elements that are left, seen along the thickness.

    Raises:
        ValueError: as in `check_continuum`.
    """
    check_continuum(scene, shots, continuum)
    memory = memory_of(scene, shots, Worker("cpu", 1))
    march = march_of(scene, shots, 0, continuum, memory.prepared.conditions)
    rows, left, places = list[Array](), list[Array](), cells_of(march.sheets[0])

    def follow(hit: OneHit) -> None:
        rows.append(_row(hit, rows[-1] if rows else None))
        if snapshots:
            left.append(_left(hit, march.sheets[0])[places])

    follow(march.hit)
    struck = march.ended(every=STRIDE, follow=follow)
    start = march.hit.start
    body = scene.core.mass_properties._replace(
        mass=start.mass, inertia_axial=start.inertia_axial, inertia_transverse=start.inertia_transverse
    )
    history = History.from_trace(np.array([*rows[1:], _unloaded(rows[-1])]), body)
    shown = (
        np.unique(np.linspace(0, len(rows) - 1, snapshots).round().astype(int)) if snapshots else np.empty(0, dtype=int)
    )
    y, z = (0.5 * (edges[1:] + edges[:-1]) for edges in march.sheets[0].edges)
    home = float(shots.hit_y[0]), float(shots.hit_z[0])
    share = np.array([left[row] for row in shown]).reshape(-1, len(places[0]), places[1].shape[1])
    cell_y, cell_z = home[0] + y[places[0][:, 0]], home[1] + z[places[1][0]]
    return Replay(
        outcomes=outcomes_of(memory, [struck]),
        history=history,
        plate_time=np.array([rows[row][0] for row in shown]),
        resistance_share=share,
        cell_y=cell_y,
        cell_z=cell_z,
        behind={},
    )


def cells_of(sheet: SheetMesh) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """The columns of the fine part of a mesh, which are cells of one size, as indices of `solid`."""
    chosen = []
    for edges in sheet.edges:
        chosen.append(np.flatnonzero(np.isclose(np.diff(edges), sheet.spacing, rtol=1e-6)))
    rows, columns = np.ix_(*chosen)
    return np.asarray(rows), np.asarray(columns)


def _left(hit: OneHit, sheet: SheetMesh) -> Array:
    """Share of the elements of each column that are left."""
    alive = hit.mesh.alive.numpy()[hit.firsts[0] : hit.firsts[0] + sheet.nodes]
    planes = alive.reshape(len(sheet.x), *sheet.y.shape)[:-1, :-1, :-1]
    return np.asarray(planes.mean(axis=0), dtype=np.float64)


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


def _unloaded(row: Array) -> Array:
    """The last row again, without load."""
    last = row.copy()
    last[14:21] = 0.0
    return last
