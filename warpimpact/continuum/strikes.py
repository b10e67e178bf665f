"""Hits by finite elements: from a scene and shots to the outcomes that the fast law has, too."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.continuum.many_hits import ended
from warpimpact.continuum.meeting import WIDER, March, Struck, line_of_flight, march_of
from warpimpact.continuum.one_hit import axis_of
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

    def computed(numbers: list[int], wider: float) -> Iterator[tuple[int, Struck]]:
        if not device.is_cpu:
            return together((march(k, device=device.alias, wider=wider) for k in numbers), worker.cancel)
        compute = lambda k: march(k, wider=wider).ended(worker.cancel)  # noqa: E731
        return _in_threads(compute, numbers, worker.threads or cores())

    hits: dict[int, Struck] = {}
    for wider in WIDER:
        numbers = [number for number in range(len(shots)) if number not in hits]
        for place, hit in computed(numbers, wider):
            if hit.status is not Status.LEFT_WINDOW or wider == WIDER[-1]:
                hits[numbers[place]] = hit
                if progress:
                    progress(len(hits), len(shots))
    return outcomes_of(memory, [hits[number] for number in range(len(shots))])


def memory_of(scene: Scene, shots: Shots, worker: Worker) -> Memory:
    """What the free flight behind the target needs of some shots, on the CPU."""
    return Memory(prepare(scene, shots, Numerics(level=0, precision="double")), find_device("cpu"), worker.cancel)


def _in_threads(compute: Callable[[int], Struck], hits: list[int], threads: int) -> Iterator[tuple[int, Struck]]:
    """Results with their places, in their order; one thread is that of the caller."""
    if threads == 1:
        yield from enumerate(map(compute, hits))
        return
    with ThreadPoolExecutor(threads) as pool:
        yield from enumerate(pool.map(compute, hits))


def together(marches: Iterable[March], cancel: Cancel = NEVER) -> Iterator[tuple[int, Struck]]:
    """What became of hits that march together on their device, with their numbers, as they end."""
    coming = (((number, march), march.hit) for number, march in enumerate(marches))
    for (number, march), at_edge in ended(coming, lambda key: key[1].extended(), cancel):
        yield number, march.struck(at_edge)


def outcomes_of(memory: Memory, hits: list[Struck]) -> Outcomes:
    """The outcomes of some hits: their flight to the stand-offs is that of the fast law's cores."""
    contact, count = memory.outcomes(), len(hits)
    columns: dict[str, list[Any]] = {name: [] for name in contact._cls.vars}
    for hit in hits:
        state, touched = hit.flight["state"], hit.flight["first_touch"] >= 0.0
        lost = hit.energies.lost if touched else 0.0
        columns["status"].append(int(hit.status))
        columns["steps"].append(int(hit.flight["steps"]))
        columns["contact_duration"].append(hit.flight["last_touch"] - hit.flight["first_touch"] if touched else 0.0)
        columns["energy_loss"].append(lost)
        columns["position"].append(state["position"])
        columns["axis"].append(axis_of(state["attitude"]))
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
        flight = line_of_flight(float(shots.obliquity[k]), float(shots.azimuth[k]))
        for layer in range(layers):
            velocity, axis = hit.left[layer, :3], hit.left[layer, 3:6]
            has_left = not math.isnan(hit.left[layer, 6])
            columns["status"][k, layer] = _layer_status(hit.status, has_left, bool(hit.touched[layer]))
            if has_left:
                columns["velocity"][k, layer] = np.linalg.norm(velocity)
                columns["tilt"][k, layer] = _angle(axis, flight)
        resting = [layer for layer in range(layers) if columns["status"][k, layer] == Status.ARRESTED]
        if hit.status is Status.ARRESTED and resting:
            columns["stopped_in"][k] = resting[-1]
            state = hit.flight["state"]
            nose = memory.prepared.scene.core.mass_properties.centre_of_mass
            foremost = state["position"][0] + nose * axis_of(state["attitude"])[0]
            columns["depth"][k] = foremost - target.faces[resting[-1], 0]


def _layer_status(status: Status, has_left: bool, touched: bool) -> Status:
    if has_left:
        return Status.PERFORATED if touched else Status.MISSED
    if not touched:
        return Status.NOT_REACHED
    return status if status.failed or status is Status.ARRESTED else Status.RICOCHETED


def _angle(a: Array, b: Array) -> float:
    return math.atan2(float(np.linalg.norm(np.cross(a, b))), float(a @ b))
