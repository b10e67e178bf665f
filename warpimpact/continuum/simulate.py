"""Hits by finite elements: from a scene and shots to the outcomes that the fast law has, too.

On a GPU many hits march together, by a thread for each node and each element of all (kernels/continuum/march_many.py).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from functools import partial
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.continuum.handover import check_handover, go_on
from warpimpact.continuum.meshing import WIDER
from warpimpact.continuum.one_hit import STEPS, HitResult, OneHit, axis_of, cost_of, line_of_flight, prepare_hit
from warpimpact.errors import TooLong
from warpimpact.kernels.continuum import march_many
from warpimpact.kernels.continuum.fields import PIECE
from warpimpact.kernels.status import RUNNING, WAITING, Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.records.variables import ENERGY_IMBALANCE, ERODED_ELEMENTS, HOURGLASS_SHARE
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.scene.flow import Continuum
from warpimpact.scene.units import count_text, duration_text
from warpimpact.solver.device import NEVER, Cancel, Worker, block_size, cores, find_device, free_memory, load
from warpimpact.solver.marching import Progress
from warpimpact.solver.memory import MEMORY_SHARE, Memory, built
from warpimpact.solver.prepare import prepare
from warpimpact.solver.simulate import computed, numerics_for
from warpimpact.solver.structs import filled


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
    """Compute every shot by the fast law (docs/model.md), or by finite elements (docs/continuum.md).

    Args:
        numerics: as in a campaign. None is the standard fidelity: a pilot on some of the shots finds the resolution. A
            level or a single setting, such as Numerics(level=2), needs no pilot. A Continuum has every shot computed by
            finite elements; the stress of the scene's fast law does not count then.
        device: a name of Warp, such as "cpu" or "cuda:0"; by default a GPU if there is one.
        threads: on a CPU; one per core by default. A thread computes one hit of the continuum at a time.
        progress: called repeatedly with (shots done, all shots).
        cancel: can be told from elsewhere to break off.

    Returns:
        The outcomes, with what the scene records (records/variables.py), and, by finite elements, `energy_imbalance`,
        `hourglass_share` and `eroded_elements`.

    Raises:
        DeviceError: the device is absent.
        ValueError, MemoryError: as in `prepare`; or the continuum does not compute this (`check_continuum`).
    """
    worker = Worker(device, threads, cancel)
    if isinstance(numerics, Continuum):
        return simulate_elements(scene, shots, numerics, worker, progress)
    resolution = numerics_for(scene, shots, numerics or Numerics(), worker)
    return computed(prepare(scene, shots, resolution), worker, progress)


def check_continuum(scene: Scene, continuum: Continuum) -> None:
    """Refuse what the continuum does not compute, by a ValueError that names it."""
    if len(continuum.flows) > len(scene.target.layers):
        raise ValueError(f"got materials: {len(continuum.flows)}, layers of the target: {len(scene.target.layers)}")
    check_handover(scene.core, scene.target, continuum.layers)


def simulate_elements(
    scene: Scene, shots: Shots, continuum: Continuum, worker: Worker, progress: Progress | None = None
) -> Outcomes:
    """Compute the shots by finite elements, on a GPU or in the threads of a worker; see `simulate`."""
    check_continuum(scene, continuum)
    memory, device = memory_of(scene, shots, worker), find_device(worker.device)
    threads = min(worker.threads or cores(), len(shots)) if device.is_cpu else 1
    if device.is_cpu:
        check_cost(scene, shots, continuum, threads)
    prepared = partial(prepare_hit, scene, shots, continuum=continuum, conditions=memory.prepared.conditions)

    def marched(numbers: list[int], wider: float) -> Iterator[tuple[int, HitResult]]:
        if not device.is_cpu:
            yield from together((prepared(k, device=device.alias, wider=wider) for k in numbers), worker.cancel)
            return
        with ThreadPoolExecutor(threads) as pool:
            every: Callable[..., Iterator[HitResult]] = map if threads == 1 else pool.map  # here, where its time counts
            yield from enumerate(every(lambda k: prepared(k, wider=wider).march(worker.cancel), numbers))

    hits: dict[int, HitResult] = {}
    for wider in WIDER:
        numbers = [number for number in range(len(shots)) if number not in hits]
        for place, hit in marched(numbers, wider):
            if hit.status is not Status.LEFT_WINDOW or wider == WIDER[-1]:
                hits[numbers[place]] = hit
                if progress:
                    progress(len(hits), len(shots))
    return outcomes_of(memory, [hits[number] for number in range(len(shots))], worker)


MOST_SECONDS = 7200.0
"""Most time of a core that a hit may take on a CPU [s]."""
ANNOUNCED_SECONDS, ANNOUNCED_BYTES = 20.0, 2**28
"""Time and memory of a hit from which they are announced."""


def check_cost(scene: Scene, shots: Shots, continuum: Continuum, threads: int) -> str:
    """What a hit takes on a CPU, in words, before anything is meshed; empty if that is little.

    Raises:
        TooLong: a hit takes more than MOST_SECONDS.
        MemoryError: so many at a time take too much memory; the message is for the user.
    """
    cost, gigabyte = cost_of(scene, shots, continuum), 2.0**30
    needed, allowed = threads * cost.bytes / gigabyte, MEMORY_SHARE * free_memory() / gigabyte
    size = 1e3 * min(continuum.spacings(scene.core, scene.target))
    elements = f"a hit takes up to {cost.elements:.2g} elements of {size:.2g} mm"
    time = f"about {duration_text(cost.seconds)} of one CPU core"
    if cost.seconds > MOST_SECONDS:
        most = duration_text(MOST_SECONDS)
        raise TooLong(f"{elements} and {time}, but at most {most} are allowed; give larger elements (--element)")
    if needed > allowed:
        at_a_time = f"{count_text(threads, 'hit')} at a time take" if threads > 1 else "it takes"
        raise MemoryError(
            f"{elements}; {at_a_time} {needed:.2g} GiB, but {allowed:.2g} GiB are free for it; give larger elements "
            "(--element)"
        )
    words = f"{elements}, {cost.bytes / gigabyte:.2g} GiB and {time}, several times as long if the bullet core tumbles"
    return words if cost.seconds >= ANNOUNCED_SECONDS or cost.bytes >= ANNOUNCED_BYTES else ""


def memory_of(scene: Scene, shots: Shots, worker: Worker) -> Memory:
    """What the free flight behind the target needs of some shots, on the CPU."""
    return Memory(prepare(scene, shots, Numerics(level=0, precision="double")), find_device("cpu"), worker.cancel)


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
                columns["tilt"][k, layer] = math.atan2(np.linalg.norm(np.cross(axis, flight)), axis @ flight)
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


MOST = 256
"""Hits that march together at most: drafts of the slotted plate have 2.4 million elements then, some ten times as many
as a large GPU has threads at a time."""


class ManyHits:
    """Hits of one device and one precision. Those that have ended stay as they are.

    The steps of `advance` are one graph on CUDA, which is captured again when a larger hit comes.
    """

    def __init__(self, hits: Sequence[OneHit]) -> None:
        self.device, variant = hits[0].device, hits[0].variant
        self.stage = built(march_many, variant)
        for kernel in vars(self.stage.kernels).values():
            load(kernel, self.device)
        count, room = len(hits), partial(wp.zeros, device=self.device)
        self._places: list[Any] = [None] * count  # with all arrays whose addresses the device has
        self._hits = room(count, dtype=self.stage.struct.Hit)
        self._loads = room((count, march_many.PARTS), dtype=self.stage.Load)
        self._crossings = room((count, march_many.PARTS), dtype=variant.real)
        self._cylinders = room(count, dtype=self.stage.struct.Cylinder)
        self._seen = room((count, 2), dtype=wp.int32)
        self._most = 0, 0  # nodes and elements of a hit
        self._step: list[Any] = []
        self._graphs: dict[int, Any] = {}
        for place, hit in enumerate(hits):
            self.put(place, hit)

    def put(self, place: int, hit: OneHit) -> None:
        """Have a hit march at a place: that of one that has ended, whose arrays it lets go."""
        put, runs = partial(wp.array, device=self.device), (hit.mesh.node_runs, hit.mesh.runs)
        nodes, elements = (pieces_of(values.numpy().reshape(-1, 3)) for values in runs)
        own = filled(
            self.stage.struct.Hit,
            node_pieces=put(nodes.ravel(), dtype=wp.int32),
            pieces=put(elements.ravel(), dtype=wp.int32),
            **{name: getattr(hit, name) for name in ("core", "limits", "mesh", "flights", "left")},
        )
        self._hits[place : place + 1].assign(put([own], dtype=self.stage.struct.Hit))
        self._places[place] = own
        most = max(self._most[0], PIECE * len(nodes)), max(self._most[1], PIECE * len(elements))
        if most != self._most:
            self._most = most
            self._step, self._graphs = self._launches(), {}

    def _launches(self) -> list[Any]:
        """Those of a step, recorded."""
        count, hits, (nodes, elements) = len(self._places), self._hits, self._most
        parts = count, march_many.PARTS
        step: dict[str, tuple[Any, list[Any]]] = {
            "press": (parts, [hits, self._loads]),
            "push": (count, [hits, self._loads, self._cylinders]),
            "move": ((count, nodes), [hits, self._cylinders]),
            "deform": ((count, elements), [hits]),
            "cross": (parts, [hits, self._crossings]),
            "step": (count, [hits, self._crossings]),
        }
        return [self._launch(name, *launch, record_cmd=True) for name, launch in step.items()]

    def _launch(self, name: str, dim: Any, inputs: list[Any], **how: Any) -> Any:
        kernel = getattr(self.stage.kernels, name)
        return wp.launch(kernel, dim, inputs, device=self.device, block_dim=block_size(kernel, self.device), **how)

    def advance(self, steps: int = STEPS) -> None:
        """March all by some steps."""
        if self.device.is_cpu:
            self._march(steps)
            return
        if steps not in self._graphs:
            with wp.ScopedCapture(self.device, force_module_load=False) as capture:
                self._march(steps)
            self._graphs[steps] = capture.graph
        wp.capture_launch(self._graphs[steps])

    def _march(self, steps: int) -> None:
        for _ in range(steps):
            for launch in self._step:
                launch.launch()

    def look(self) -> NDArray[np.int32]:
        """The status of each hit, and 1 where its core is near the outer edge of a mesh, shape [hits, 2]."""
        self._seen.zero_()
        self._launch("look", (len(self._places), march_many.PARTS), [self._hits, self._seen])
        return np.array(self._seen.numpy())


def pieces_of(runs: NDArray[np.int32]) -> NDArray[np.int32]:
    """First number and sheet of each piece of some runs, shape [pieces, 2]; the runs as in the kernels' Mesh, shape
    [runs, 3]."""
    counts = (runs[:, 1] - runs[:, 0]) // PIECE
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.stack([np.repeat(runs[:, 0], counts) + PIECE * within, np.repeat(runs[:, 2], counts)], axis=1)


def together(hits: Iterable[OneHit], cancel: Cancel = NEVER) -> Iterator[tuple[int, HitResult]]:
    """What became of hits that march together on their device, with their numbers, as they end.

    Args:
        hits: of one device and one precision; as many march at a time as fit half of the free memory of a GPU, but at
            most MOST. The next one takes the place of one that has ended.
    """
    coming, first = enumerate(hits), list[tuple[int, OneHit]]()
    for number, hit in coming:
        first.append((number, hit))
        sizes = [one.bytes for _, one in first]
        free = 0 if hit.device.is_cpu else int(hit.device.free_memory)
        if len(first) == MOST or (free and sum(sizes) + max(sizes) > MEMORY_SHARE * (free + sum(sizes))):
            break
    if not first:
        return
    running, many = dict(enumerate(first)), ManyHits([hit for _, hit in first])
    del first  # ended hits make room
    while running:
        cancel.check()
        many.advance()
        for place, (status, at_edge) in enumerate(many.look()):
            if place in running and status == WAITING and not at_edge:
                many.put(place, running[place][1].extend())
            elif place in running and (status != RUNNING or at_edge):
                number, hit = running.pop(place)
                yield number, hit.result(bool(at_edge))
                if one := next(coming, None):
                    running[place] = one
                    many.put(place, one[1])
