"""Arrays of shots in, arrays of outcomes out."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels import free_flight
from warpimpact.kernels import march as marching
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.solver.arrays import arrays_of, variant_of
from warpimpact.solver.device import find_device, load
from warpimpact.solver.history import History
from warpimpact.solver.layering import Weakened
from warpimpact.solver.marching import March, Progress
from warpimpact.solver.materials import materials_of
from warpimpact.solver.resolution import Fidelity, resolve

Array = NDArray[np.float64]


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
    numerics: Numerics | Fidelity | None = None,
    device: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
) -> Outcomes:
    """Compute every shot on its own copy of the target (docs/model.md §§1–5), or those of a sample one after another on
    one copy (`Shots.sample`, docs/model.md §8).

    Args:
        numerics: resolution and scheme; None is the standard fidelity.
        device: "auto" (CUDA if there is one, else CPU), "cpu", "cuda:0", …
        threads: number on a CPU; None is one for every core that this process may use.
        progress: called repeatedly with (shots done, all shots); an exception that it raises ends the computation.

    Returns:
        The outcomes, with what the scene records (records/registry.py).

    Raises:
        DeviceError: the device is absent.
        ValueError: the numerics cannot compute the bending moment that the scene records or
            several shots at one plate.
    """
    march = March(scene, numerics or Numerics(), shots, find_device(device), threads=threads)
    return _outcomes(march, march.march(progress))


def build(scene: Scene, shots: Shots, *, numerics: Numerics | Fidelity | None = None, device: str = "auto") -> None:
    """Compile the kernels that `simulate` would need for these arguments, once per version and machine."""
    resolution = resolve(numerics or Numerics(), scene, shots)
    variant = variant_of(resolution, scene, shots, materials_of(scene, shots))
    if resolution.block:  # the window is a part of this variant
        variant = arrays_of(scene, numerics or Numerics(), shots).variant
    for stage in (marching, free_flight):
        load(stage.build(variant).kernel, find_device(device))


def _outcomes(march: March, contact: Any) -> Outcomes:
    return Outcomes.collected(march.scene, march.shots, march.report(contact))


def trace(scene: Scene, shots: Shots, *, numerics: Numerics | Fidelity | None = None) -> list[Array]:
    """Histories of shots on the CPU: one array [steps + 1, WIDTH] per shot (kernels/trace.py)."""
    march = _traced(scene, shots, numerics)
    return march.traces(march.march())


def replay(scene: Scene, shots: Shots, *, numerics: Numerics | Fidelity | None = None, snapshots: int = 6) -> Replay:
    """Compute one shot again on the CPU, with its history. The outcome equals that of `simulate` on the same CPU, bit
    for bit.

    Args:
        shots: the shot, after those that hit the same plate before it; the numerics as in `simulate`.
        snapshots: number of instants at which the plate is shown, evenly from the first touch to the end. Each computes
            the shot again up to there; 0 computes no field of any layer.
    """
    march = _traced(scene, shots, numerics)
    contact = march.march()
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


def _traced(scene: Scene, shots: Shots, numerics: Numerics | Fidelity | None) -> March:
    return March(scene, numerics or Numerics(), shots, find_device("cpu"), traced=True)
