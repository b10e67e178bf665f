"""Hits by finite elements: from a scene and shots to the outcomes that the fast law has, too."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.continuum.many_hits import ended
from warpimpact.continuum.meshing import Extent, SheetMesh, meshed
from warpimpact.continuum.one_hit import STEPS, Energies, OneHit, Start
from warpimpact.kernels.status import Status
from warpimpact.records.continuum_variables import ENERGY_IMBALANCE, ERODED_ELEMENTS, HOURGLASS_SHARE
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.scene.flow import Continuum
from warpimpact.solver.device import cores, find_device
from warpimpact.solver.marching import Progress
from warpimpact.solver.memory import Memory
from warpimpact.solver.prepare import prepare
from warpimpact.solver.simulate import simulate as by_fast_law
from warpimpact.solver.worker import NEVER, Cancel, Worker

Array = NDArray[np.float64]

FINE, PATCH, BEHIND = 2.5, 5.0, 7.0
"""Half of the fine part of a mesh, half of it all, and half of a layer behind the first, which a core may reach turned;
in radii of the core."""
LARGEST_IMBALANCE, LARGEST_HOURGLASS_SHARE = 0.02, 0.12
"""Of the energy that the core lost: a hit beyond is a failure of the computation."""


@dataclass(frozen=True)
class Struck:
    """What became of one hit.

    Attributes:
        status: code of `Status`.
        flight: state and clock of the core, a row of the kernels' Flight.
        touched: whether the core touched each layer.
        left: state with which it left each layer, shape [layers, 7]: velocity, axis, time.
        energies: where the energy has gone.
        eroded: elements that failed.
    """

    status: Status
    flight: Any
    touched: NDArray[np.bool_]
    left: Array
    energies: Energies
    eroded: int


def simulate(
    scene: Scene,
    shots: Shots,
    *,
    numerics: Numerics | Continuum | None = None,
    device: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
    cancel: Cancel = NEVER,
) -> Outcomes:
    """Compute every shot by the fast law, on its own copy of the target (docs/model.md §§1–5), or those of a sample one
    after another on one copy (`Shots.sample`, docs/model.md §8); or by finite elements (docs/continuum.md).

    Args:
        numerics: as in a campaign. None is the standard fidelity: a pilot on some of the shots finds the resolution. A
            level or a single setting, such as Numerics(level=2), needs no pilot. A Continuum has every shot computed by
            finite elements; the stress of the scene's fast law does not count then.
        device: a name of Warp, such as "cpu" or "cuda:0"; by default a GPU if there is one. By finite elements a GPU
            computes hundreds of hits at a time.
        threads: on a CPU; one per core by default. A thread computes one hit of the continuum at a time.
        progress: called repeatedly with (shots done, all shots).
        cancel: can be told from elsewhere to break off.

    Returns:
        The outcomes, with what the scene records (records/registry.py), and, by finite elements, `energy_imbalance`,
        `hourglass_share` and `eroded_elements`.

    Raises:
        DeviceError: the device is absent.
        ValueError, MemoryError: as in `prepare`; or the continuum does not compute this (`check_continuum`).
    """
    if not isinstance(numerics, Continuum):
        given: dict[str, Any] = {"device": device, "threads": threads, "progress": progress, "cancel": cancel}
        return by_fast_law(scene, shots, numerics=numerics, **given)
    return struck(scene, shots, numerics, Worker(device, threads, cancel), progress)


def check_continuum(scene: Scene, shots: Shots, continuum: Continuum) -> None:
    """Refuse what the continuum does not compute.

    Raises:
        ValueError: names what it is.
    """
    if scene.record.bending:
        raise ValueError("the continuum has no bending moment of its rigid core; leave out output.bending")
    if shots.at_a_plate > 1:
        raise ValueError("the continuum computes every shot at a target of its own; leave out [burst]")
    if len(continuum.flows) > len(scene.target.layers):
        raise ValueError(f"got {len(continuum.flows)} materials, but the target has {len(scene.target.layers)} layers")


def struck(
    scene: Scene,
    shots: Shots,
    continuum: Continuum,
    worker: Worker,
    progress: Progress | None = None,
) -> Outcomes:
    """Compute the shots by finite elements, on a GPU or in the threads of a worker; see `simulate`."""
    check_continuum(scene, shots, continuum)
    memory, device = memory_of(scene, shots, worker), find_device(worker.device)
    march = partial(march_of, scene, shots, continuum=continuum, conditions=memory.prepared.conditions)
    if device.is_cpu:
        computed = _in_threads(lambda k: march(k).ended(worker.cancel), len(shots), worker.threads or cores())
    else:
        computed = together((march(k, device=device.alias) for k in range(len(shots))), worker.cancel)
    hits: dict[int, Struck] = {}
    for number, hit in computed:
        hits[number] = hit
        if progress:
            progress(len(hits), len(shots))
    return outcomes_of(memory, [hits[number] for number in range(len(shots))])


def memory_of(scene: Scene, shots: Shots, worker: Worker) -> Memory:
    """What the free flight behind the target needs of some shots, on the CPU."""
    return Memory(prepare(scene, shots, Numerics(level=0, precision="double")), find_device("cpu"), worker.cancel)


def _in_threads(compute: Callable[[int], Struck], count: int, threads: int) -> Iterator[tuple[int, Struck]]:
    """Results with their numbers, in their order; one thread is that of the caller."""
    if threads == 1:
        yield from enumerate(map(compute, range(count)))
        return
    with ThreadPoolExecutor(threads) as pool:
        yield from enumerate(pool.map(compute, range(count)))


def together(marches: Iterable[March], cancel: Cancel = NEVER) -> Iterator[tuple[int, Struck]]:
    """What became of hits that march together on their device, with their numbers, as they end."""
    coming = (((number, march), march.hit) for number, march in enumerate(marches))
    for (number, march), at_edge in ended(coming, cancel):
        yield number, march.struck(at_edge)


class March:
    """One hit, ready to march."""

    def __init__(self, hit: OneHit, sheets: list[SheetMesh]) -> None:
        self.hit, self.sheets = hit, sheets
        edges = [np.flatnonzero(sheet.outer_faces.any(axis=0)) for sheet in sheets]
        self._edge = np.concatenate([at + edge for at, edge in zip(hit.firsts, edges, strict=True)])

    def ended(
        self, cancel: Cancel = NEVER, *, every: int = STEPS, follow: Callable[[OneHit], object] = lambda hit: None
    ) -> Struck:
        """March to the end; `follow` is called at regular numbers of steps."""
        at_edge = False
        for _ in self.hit.steps(every, cancel):
            follow(self.hit)
            at_edge = bool(self.hit.mesh.near.numpy()[self._edge].any())
            if at_edge:
                break
        return self.struck(at_edge)

    def struck(self, at_edge: bool) -> Struck:
        """What became of the hit, which has ended, or whose core is near the outer edge of a mesh."""
        flight, energies = self.hit.flight, self.hit.energies
        status = Status.LEFT_WINDOW if at_edge else judged(Status(int(flight["status"])), energies)
        alive = self.hit.mesh.alive.numpy()
        eroded = sum(int(sheet.alive.sum()) for sheet in self.sheets) - int((alive > 0.0).sum())
        return Struck(status, flight, self.hit.touched, self.hit.left.numpy(), energies, eroded)


def judged(status: Status, energies: Energies) -> Status:
    """The status of a hit, by its energies, too."""
    if status.failed or energies.lost <= 0.0:
        return status
    if not energies.imbalance <= LARGEST_IMBALANCE:
        return Status.UNBALANCED
    return status if energies.hourglass_share <= LARGEST_HOURGLASS_SHARE else Status.HOURGLASSED


def march_of(
    scene: Scene,
    shots: Shots,
    number: int,
    continuum: Continuum,
    conditions: dict[str, NDArray[Any]],
    device: str = "cpu",
) -> March:
    """The march of one of the shots.

    Args:
        conditions: as `prepare` has them.
        device: that has its arrays.
    """
    core, target = scene.core, scene.target
    start = start_of(scene, shots, number, continuum.friction, conditions)
    flight = start.velocity / np.linalg.norm(start.velocity)
    own = {
        name: [float(np.resize(shots.own_of(target, name, k), len(shots))[number]) for k in range(len(target.layers))]
        for name in ("thickness", "offset_y", "offset_z")
    }
    fronts, sheets = target.fronts([np.array(value) for value in own["thickness"]]), []
    home = float(shots.hit_y[number]), float(shots.hit_z[number])
    for k, (layer, spacing) in enumerate(zip(target.layers, continuum.spacings(core, target), strict=True)):
        thickness, front = own["thickness"][k], float(fronts[k])
        half = (BEHIND if k else PATCH) * core.max_radius
        extents = [_extent(core.max_radius, half, flight, axis, front, thickness) for axis in (1, 2)]
        place = home[0] - own["offset_y"][k], home[1] - own["offset_z"][k]
        plate = layer.model_copy(update={"thickness": thickness})
        sheets.append(meshed(plate, place, front, spacing, (extents[0], extents[1])))
    flows = [continuum.flow(k) for k in range(len(sheets))]
    return March(OneHit(core, start, sheets, flows, continuum.double, device), sheets)


def _extent(radius: float, half: float, flight: Array, axis: int, front: float, thickness: float) -> Extent:
    """What the mesh of a layer covers along one axis: where the line of fire crosses it, and about it."""
    drift = float(flight[axis] / flight[0])
    middle, way = drift * (front + 0.5 * thickness), 0.5 * abs(drift) * thickness
    return Extent(middle, FINE * radius + way, half + way)


def start_of(scene: Scene, shots: Shots, number: int, friction: float, conditions: dict[str, NDArray[Any]]) -> Start:
    """How the core of a shot begins: its foremost point at the front face, as kernels/shots.py has it."""
    core = scene.core
    mass, axial, transverse, velocity, obliquity, azimuth, pitch, yaw, spin = (
        float(np.resize(conditions[name], len(shots))[number])
        if name in conditions
        else float(getattr(shots, name)[number])
        for name in (
            *("mass", "inertia_axial", "inertia_transverse"),
            *("velocity", "obliquity", "azimuth", "pitch", "yaw", "spin"),
        )
    )
    flight = np.array(
        [math.cos(obliquity), math.sin(obliquity) * math.cos(azimuth), math.sin(obliquity) * math.sin(azimuth)]
    )
    axis = np.array(
        [
            1.0,
            math.tan(math.atan2(flight[1], flight[0]) + yaw),
            math.tan(math.atan2(flight[2], flight[0]) + pitch),
        ]
    )
    axis /= np.linalg.norm(axis)
    attitude = np.array([0.0, -axis[2], axis[1], 1.0 + axis[0]])
    stations = np.linspace(0.0, core.length, 1001)
    ahead = core.mass_properties.centre_of_mass - stations
    foremost = float((ahead * axis[0] + core.radius(stations) * math.sqrt(max(0.0, 1.0 - axis[0] ** 2))).max())
    return Start(
        position=-foremost / flight[0] * flight,
        attitude=attitude / np.linalg.norm(attitude),
        velocity=velocity * flight,
        angular_momentum=axial * spin * axis,
        mass=mass,
        inertia_axial=axial,
        inertia_transverse=transverse,
        friction=friction,
    )


def outcomes_of(memory: Memory, hits: list[Struck]) -> Outcomes:
    """The outcomes of some hits: their flight to the stand-offs is that of the fast law's cores."""
    contact, count = memory.outcomes(), len(hits)
    columns: dict[str, list[Any]] = {name: [] for name in contact._cls.vars}
    for hit in hits:
        state, touched = hit.flight["state"], hit.flight["first_touch"] >= 0.0
        x, y, z, w = (float(part) for part in state["attitude"])
        lost = hit.energies.lost if touched else 0.0
        columns["status"].append(int(hit.status))
        columns["steps"].append(int(hit.flight["steps"]))
        columns["contact_duration"].append(hit.flight["last_touch"] - hit.flight["first_touch"] if touched else 0.0)
        columns["energy_loss"].append(lost)
        columns["position"].append(state["position"])
        columns["axis"].append([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)])
        columns["velocity"].append(state["velocity"])
        columns["angular_momentum"].append(state["angular_momentum"])
    for name, values in columns.items():
        array = getattr(contact, name)
        array.assign(np.asarray(values, dtype=array.numpy().dtype).reshape(array.numpy().shape))
    if memory.variant.layered:
        _fill_passage(memory, hits)
    outcomes = Outcomes.collected(memory.prepared.scene, memory.prepared.shots, memory.report(contact))
    energies = [hit.energies for hit in hits]
    return outcomes.assign(
        **{
            ENERGY_IMBALANCE: np.array([energy.imbalance for energy in energies]),
            HOURGLASS_SHARE: np.array([energy.hourglass_share for energy in energies]),
            ERODED_ELEMENTS: np.array([float(hit.eroded) for hit in hits]).reshape(count),
        }
    )


def _fill_passage(memory: Memory, hits: list[Struck]) -> None:
    """How each core left each layer, as kernels/passage.py has it."""
    passage, shots, target = memory.passage, memory.prepared.shots, memory.prepared.scene.target
    layers = len(target.layers)
    columns = {name: getattr(passage, name).numpy() for name in passage._cls.vars}  # views of memory on the CPU
    for values in columns.values():
        values[...] = np.nan if values.dtype.kind == "f" else -1
    for k, hit in enumerate(hits):
        obliquity, azimuth = float(shots.obliquity[k]), float(shots.azimuth[k])
        flight = np.array(
            [math.cos(obliquity), math.sin(obliquity) * math.cos(azimuth), math.sin(obliquity) * math.sin(azimuth)]
        )
        for layer in range(layers):
            velocity, axis, time = hit.left[layer, :3], hit.left[layer, 3:6], hit.left[layer, 6]
            has_left = not math.isnan(time)
            columns["status"][k, layer] = _layer_status(hit.status, has_left, bool(hit.touched[layer]))
            if has_left:
                columns["velocity"][k, layer], columns["time"][k, layer] = np.linalg.norm(velocity), time
                columns["tilt"][k, layer] = _angle(axis, flight)
                columns["deflection"][k, layer] = _angle(velocity, flight)
        resting = [layer for layer in range(layers) if columns["status"][k, layer] == Status.ARRESTED]
        if hit.status is Status.ARRESTED and resting:
            columns["stopped_in"][k] = resting[-1]
            state = hit.flight["state"]
            nose = memory.prepared.scene.core.mass_properties.centre_of_mass
            _, y, z, _ = (float(part) for part in state["attitude"])
            columns["depth"][k] = (
                state["position"][0] + nose * (1.0 - 2.0 * (y * y + z * z)) - target.faces[resting[-1], 0]
            )


def _layer_status(status: Status, has_left: bool, touched: bool) -> Status:
    if has_left:
        return Status.PERFORATED if touched else Status.MISSED
    if not touched:
        return Status.NOT_REACHED
    return status if status.failed or status is Status.ARRESTED else Status.RICOCHETED


def _angle(a: Array, b: Array) -> float:
    return math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))
