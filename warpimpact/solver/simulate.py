"""Arrays of shots in, arrays of outcomes out."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels import free_flight
from warpimpact.kernels import march as marching
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
class Outcomes:
    """How the shots ended: SI and radians, NaN where a value does not exist.

    Attributes:
        status: codes of `Status`, shape [shots].
        residual_velocity: speed after contact [m/s], shape [shots]; 0 for an arrested core.
        deflection: angle between residual velocity and line of fire [rad], shape [shots].
        angular_velocity: after contact, plate frame [rad/s], shape [shots, 3].
        energy_loss: kinetic energy lost [J], shape [shots].
        contact_duration: time in contact [s], shape [shots].
        tilt: angle between core axis and line of fire [rad], shape [shots, stand-offs].
        pitch, yaw: projected angles of the axis [rad], shape [shots, stand-offs].
        total_yaw: angle between core axis and residual velocity [rad], shape [shots, stand-offs].
        exit_velocity: at the end of contact, plate frame [m/s], shape [shots, 3]; 0 for an arrested core.
        exit_axis: unit vector towards the nose then, shape [shots, 3].
        exit_position: centre of mass then, from the hit point [m], shape [shots, 3].
    """

    status: NDArray[np.int8]
    residual_velocity: Array
    deflection: Array
    angular_velocity: Array
    energy_loss: Array
    contact_duration: Array
    tilt: Array
    pitch: Array
    yaw: Array
    total_yaw: Array
    exit_velocity: Array
    exit_axis: Array
    exit_position: Array


@dataclass(frozen=True)
class BentOutcomes(Outcomes):
    """Outcomes with the largest bending of the rigid core (kernels/bending.py); arrays of shape [shots].

    Attributes:
        largest_bending_moment: [N m], 0 for a core that touched nothing.
        bending_section: distance of its section behind the nose tip [m].
        bending_stress: largest nominal stress 4M/(πr³) [Pa] where the core is thick enough (bending.THINNEST).
        bending_stress_section: distance of its section behind the nose tip [m].
    """

    largest_bending_moment: Array
    bending_section: Array
    bending_stress: Array
    bending_stress_section: Array


@dataclass(frozen=True)
class BrokenOutcomes(BentOutcomes):
    """Outcomes of cores that have a strength; arrays of shape [shots]. A broken core goes on as one rigid body.

    Attributes:
        broken: 1 where the nominal bending stress passed the strength, else 0.
        broken_time: when it first did, since the first touch of the front face [s]; the middle of a step.
        broken_x: where its most stressed section was then, behind the front face [m].
        broken_section: distance of this section behind the nose tip [m].
    """

    broken: Array
    broken_time: Array
    broken_x: Array
    broken_section: Array


@dataclass(frozen=True)
class LayeredOutcomes(Outcomes):
    """Outcomes with how each core left each layer; layer 0 is the plate. The others are those of the whole target.

    A core leaves a layer at the instant when its last point passes the rear face. NaN where it does not.

    Attributes:
        layer_status: codes of `LayerStatus`, shape [shots, layers].
        layer_residual_velocity: speed at that instant [m/s], shape [shots, layers].
        layer_tilt: angle between core axis and line of fire at that instant [rad], shape [shots, layers].
        layer_time: that instant, from the first touch of the front face on [s], shape [shots, layers].
        layer_deflection: angle between the velocity at that instant and the line of fire [rad], shape [shots, layers].
        layer_standoff_tilt: angle between core axis and line of fire at the stand-offs behind each layer [rad], shape
            [shots, layers, stand-offs]. NaN where the core does not get there, or where free flight ends at the next
            layer (`Record.flies_free`).
        layer_standoff_pitch, layer_standoff_yaw: projected angles of the axis there [rad], of that shape.
        stopped_in: the deepest layer that the core rests in, shape [shots]; −1 for a core that does not rest in one,
            such as one that stays between two of them.
        depth: how far behind the front face of this layer any point of the core came [m], shape [shots]; else NaN.
    """

    layer_status: NDArray[np.int8]
    layer_residual_velocity: Array
    layer_tilt: Array
    layer_time: Array
    layer_deflection: Array
    layer_standoff_tilt: Array
    layer_standoff_pitch: Array
    layer_standoff_yaw: Array
    stopped_in: NDArray[np.int8]
    depth: Array


@dataclass(frozen=True)
class LayeredBentOutcomes(BentOutcomes, LayeredOutcomes):
    """Outcomes with both."""


@dataclass(frozen=True)
class LayeredBrokenOutcomes(BrokenOutcomes, LayeredOutcomes):
    """Outcomes with both, of cores that have a strength."""


@dataclass(frozen=True)
class Replay:
    """One shot with its full history: SI, float64.

    Attributes:
        outcomes: how it ended, each of shape [1] or [1, …].
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
        The outcomes at the stand-offs that the scene records; `BentOutcomes` where it records the bending moment,
        `LayeredOutcomes` where the target has layers behind its plate, `LayeredBentOutcomes` where both.

    Raises:
        DeviceError: the device is absent.
        ValueError: the numerics have a tolerance, or they cannot compute the bending moment that the scene records or
            several shots at one plate.
    """
    march = March(scene, numerics or Numerics(), shots, find_device(device), threads=threads)
    return _outcomes(march, march.march(progress))


def build(scene: Scene, shots: Shots, *, numerics: Numerics | Fidelity | None = None, device: str = "auto") -> None:
    """Compile the kernels that `simulate` would need for these arguments, once per version and machine."""
    resolution = resolve(numerics or Numerics(), scene, shots.columns)
    variant = variant_of(resolution, scene, shots, materials_of(scene, shots))
    if resolution.block:  # the window is a part of this variant
        variant = arrays_of(scene, numerics or Numerics(), shots).variant
    for stage in (marching, free_flight):
        load(stage.build(variant).kernel, find_device(device))


def _outcomes(march: March, contact: Any) -> Outcomes:
    report = march.report(contact)
    kinds: dict[tuple[bool, bool, bool], type[Outcomes]] = {
        (False, False, False): Outcomes,
        (True, False, False): BentOutcomes,
        (True, True, False): BrokenOutcomes,
        (False, False, True): LayeredOutcomes,
        (True, False, True): LayeredBentOutcomes,
        (True, True, True): LayeredBrokenOutcomes,
    }
    return kinds[march.variant.bends, "broken" in report, march.variant.layered](**report)


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
        outcomes=replace(outcomes, **{name: values[-1:] for name, values in vars(outcomes).items()}),
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
