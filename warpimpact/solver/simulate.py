"""Arrays of shots in, arrays of outcomes out."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels import free_flight, march
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.solver.device import find_device, free_memory, load
from warpimpact.solver.history import History
from warpimpact.solver.layering import Weakened
from warpimpact.solver.marching import March, Progress
from warpimpact.solver.pilot import HitErrors, pilot_hits, pilot_size
from warpimpact.solver.prepare import Prepared, prepare
from warpimpact.solver.resolution import at_level
from warpimpact.solver.worker import NEVER, Cancel, Worker

Array = NDArray[np.float64]

HISTORY_BYTES = 1000
"""That a step of a history takes until it is written [bytes]: its trace, and twice the columns of its Dataset."""
SNAPSHOT_COPIES, OTHER_COPIES = 3, 8
"""Numbers for every cell that each snapshot takes until it is written, and that computing any takes."""


@dataclass(frozen=True)
class Replay:
    """One shot with its full history: SI, float64.

    Attributes:
        outcomes: how it ended; of one shot.
        history: the core at every step, and at the end.
        plate_time: instants at which the plate is shown [s], shape [snapshots]; 0 is the first touch.
        resistance_share: resistance left, as a share of Y, in the cells of the plate that the core may reach: 0 in
            holes, shape [snapshots, cells_y, cells_z].
        cell_y, cell_z: centres of those cells in the plate [m], shapes [cells_y] and [cells_z].
        behind: the same of every layer behind the plate that weakens and is reached, by its number, with `share` of
            shape [snapshots, cells_y, cells_z].
    """

    outcomes: Outcomes
    history: History
    plate_time: Array
    resistance_share: Array
    cell_y: Array
    cell_z: Array
    behind: dict[int, Weakened]


def simulate(
    scene: Scene,
    shots: Shots,
    *,
    numerics: Numerics | None = None,
    device: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
    cancel: Cancel = NEVER,
) -> Outcomes:
    """Compute every shot on its own copy of the target (docs/model.md §§1–5), or those of a sample one after another on
    one copy (`Shots.sample`, docs/model.md §8).

    Args:
        numerics: as in a campaign. None is the standard fidelity: a pilot on some of the shots finds the resolution. A
            level or a single setting, such as Numerics(level=2), needs no pilot.
        device, threads, cancel: as in `Worker`.
        progress: called repeatedly with (shots done, all shots).

    Returns:
        The outcomes, with what the scene records (records/registry.py).

    Raises:
        DeviceError: the device is absent.
        ValueError, MemoryError: as in `prepare`.
    """
    numerics, worker = numerics or Numerics(), Worker(device, threads, cancel)
    if numerics.explicit is None:
        numerics = pilot_of(scene, spread(shots, pilot_size(numerics.asked)), numerics, worker).numerics
    return computed(prepare(scene, shots, numerics), worker, progress)


def computed(prepared: Prepared, worker: Worker, progress: Progress | None = None) -> Outcomes:
    """Compute what was prepared; see `simulate`."""
    march = March(prepared, find_device(worker.device), threads=worker.threads)
    return _outcomes(march, march.march(progress, worker.cancel))


def pilot_of(
    scene: Scene, pilot: Shots, numerics: Numerics, worker: Worker, trying: Callable[[int], object] = lambda level: None
) -> HitErrors:
    """Find the level of resolution for an accuracy (solver/pilot.py).

    Args:
        pilot: some of the shots.
        trying: called with every level that is computed.
    """

    def outcomes_at(level: int) -> Outcomes:
        trying(level)
        return computed(prepare(scene, pilot, at_level(level, numerics)), worker)

    return pilot_hits(outcomes_at, pilot, numerics)


def spread(shots: Shots, most: int) -> Shots:
    """Some of the shots at even distances; those at one plate go together."""
    together = shots.at_a_plate
    plates = len(shots) // together
    places = np.linspace(0, plates, min(plates, -(-most // together)), endpoint=False).astype(int)
    return shots[(places[:, None] * together + np.arange(together)).reshape(-1)]


def build(prepared: Prepared, device: str = "auto") -> None:
    """Compile the kernels that `computed` needs, once per version and machine."""
    for stage in (march, free_flight):
        load(stage.build(prepared.variant).kernel, find_device(device))


def _outcomes(march: March, contact: Any) -> Outcomes:
    return Outcomes.collected(march.scene, march.shots, march.report(contact))


def trace(scene: Scene, shots: Shots, *, numerics: Numerics) -> list[Array]:
    """Histories of shots on the CPU: one array [steps + 1, WIDTH] per shot (kernels/trace.py)."""
    march, contact = traced(scene, shots, numerics)
    return march.traces(contact)


def replay(scene: Scene, shots: Shots, *, numerics: Numerics, snapshots: int = 6) -> Replay:
    """Compute one shot again on the CPU, with its history. The outcome equals that of `simulate` on the same CPU, bit
    for bit.

    Args:
        shots: the shot, after those that hit the same plate before it.
        numerics: the resolution with which `simulate` computed it.
        snapshots: number of instants at which the plate is shown, evenly from the first touch to the end. Each computes
            the shot again up to there; 0 computes no field of any layer.

    Raises:
        MemoryError: history and snapshots do not fit; the message is for the user.
    """
    march, contact = traced(scene, shots, numerics, snapshots)
    trace, outcomes = march.traces(contact)[-1], _outcomes(march, contact)
    time_step = 2.0 * trace[0, 0]
    steps = np.unique(np.linspace(0, len(trace) - 1, snapshots).round().astype(int))
    cell_y, cell_z = march.nodes()
    left = [march.plate_after(count, time_step) for count in steps]
    return Replay(
        outcomes=outcomes[-1:],
        history=History.from_trace(trace, march.body()),
        plate_time=trace[steps, 0] - 0.5 * time_step if march.variant.layered else steps * time_step,
        resistance_share=np.array([share for share, _ in left]).reshape(-1, len(cell_y), len(cell_z)),
        cell_y=cell_y,
        cell_z=cell_z,
        behind={number: _over_time(number, [behind for _, behind in left]) for number in (left[-1][1] if left else ())},
    )


def _over_time(number: int, left: list[dict[int, Weakened]]) -> Weakened:
    """A layer at all snapshots, in its last window: before the core came there it was as new."""
    last = left[-1][number]

    def share(one: Weakened | None) -> Array:
        if one is None or not (np.array_equal(one.cell_y, last.cell_y) and np.array_equal(one.cell_z, last.cell_z)):
            return last.material
        return one.share

    return last._replace(share=np.stack([share(one.get(number)) for one in left]))


def traced(scene: Scene, shots: Shots, numerics: Numerics, snapshots: int = 0) -> tuple[March, Any]:
    """March shots on the CPU with their histories; returns what marched, and the outcomes on the device.

    They march twice: the most steps that a shot may take are thousands of times those that it takes.

    Raises:
        MemoryError: the histories, and so many snapshots, do not fit.
    """
    prepared = prepare(scene, shots, numerics)
    first = March(prepared, find_device("cpu"))
    steps = int(first.march().steps.numpy().max())
    cells = first.cells_in_all()
    of_a_cell = 8 * (SNAPSHOT_COPIES * snapshots + OTHER_COPIES) if snapshots else 0
    needed = HISTORY_BYTES * len(shots) * steps + of_a_cell * cells
    if needed > (free := free_memory()):
        raise MemoryError(
            f"the history of {steps} steps with {snapshots} snapshots of {cells} cells needs {needed / 2**30:.3g} GiB, "
            f"and {free / 2**30:.3g} GiB are free"
        )
    march = March(replace(prepared, rows=steps + 1), find_device("cpu"))
    return march, march.march()
