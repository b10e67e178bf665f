"""Marches the shots of a scene on a device: windows, memory and threads.

Long because the windows, the memory and the threads of a march share its state.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from concurrent.futures import FIRST_COMPLETED, Future, ThreadPoolExecutor, wait
from dataclasses import replace
from functools import cached_property, partial
from queue import SimpleQueue
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.kernels import free_flight
from warpimpact.kernels.lanes import LANES
from warpimpact.kernels.status import Status
from warpimpact.kernels.trace import WIDTH
from warpimpact.records.group import Returned
from warpimpact.scene import MassProperties
from warpimpact.solver.bursts import (
    bytes_of,
    chunk_of,
    earlier_hits,
    in_turns,
    spoilt,
    turns,
    whole_plates,
)
from warpimpact.solver.device import cores, free_memory, halving, load
from warpimpact.solver.inputs import Inputs
from warpimpact.solver.layering import (
    Passages,
    Weakened,
    deep_cells,
    firsts_of,
    material_about,
    nodes_about,
    nodes_of,
    share_left,
    weakened,
)
from warpimpact.solver.prepare import Prepared
from warpimpact.solver.worker import NEVER, Cancel

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]
Progress1 = Callable[[int], None]

CPU_CHUNK = 64
"""Most shots per launch on the CPU."""
SHARES = 3
"""Launches per thread into which the shots that are left would be divided at least."""
CPU_LAUNCH = 0.25
"""Seconds that a launch on the CPU is to take at most: a computation can be broken off between two of them."""
CUDA_CHUNK = 65536
MAX_DOUBLINGS = 6
"""Largest number of times that the windows are doubled for the shots that left theirs."""
MEMORY_SHARE = 0.5
"""Share of the free memory that scratch may take."""


class March:
    """What was prepared, on one device, ready to march; see `simulate` for the arguments."""

    def __init__(self, prepared: Prepared, device: Any, *, threads: int | None = None) -> None:
        self.scene, self.shots, self.device = prepared.scene, prepared.shots, device
        self.threads = 1 if wp.config.enable_cpu_blocks else threads or cores()
        self._take(prepared)
        self.at_a_plate = self.shots.at_a_plate if self.variant.burst else 1
        self.history = wp.empty((len(self.shots) * self.arrays.rows, WIDTH), dtype=self.variant.real, device=device)
        self.cells = self._window_cells()

    def _take(self, arrays: Prepared) -> None:
        """Put the arrays on the device, with what their build of the kernels fills besides the outcomes."""
        self.arrays, count = arrays, len(self.shots)
        self.inputs = Inputs(arrays, self.device)
        self.variant, self.stage = arrays.variant, self.inputs.stage
        self.bending = wp.empty(count if self.variant.bends else 0, dtype=self.stage.Bending, device=self.device)
        free = self.scene.record.flies_free(self.scene.core, self.scene.target)
        self.passages = Passages(self.stage, count, free, self.variant, self.device)

    def march(self, progress: Progress | None = None, cancel: Cancel = NEVER) -> Any:
        """March all shots; repeat those that leave their window in wider windows."""
        count = len(self.shots)

        def reached(done: int) -> None:
            cancel.check()
            if progress is not None:
                progress(done, count)

        outcomes = self._empty(self.stage.Outcomes, (count,))
        pending = np.arange(count)
        for _ in range(MAX_DOUBLINGS):
            self._march_some(pending, outcomes, _after(count - len(pending), reached))
            pending = whole_plates(outcomes.status.numpy() == Status.LEFT_WINDOW, self.at_a_plate)
            if not len(pending) or not self._fits(2 * self.cells[0], 2 * self.cells[1]):
                break
            self._widen()
        outcomes.status.assign(spoilt(outcomes.status.numpy(), self.at_a_plate))
        reached(count)
        return outcomes

    def _widen(self) -> None:
        """Double the windows; those that do not fit a block are for the simple layout."""
        self.cells = (2 * self.cells[0], 2 * self.cells[1])
        if 0 < self.variant.window < math.prod(self.cells):
            self._take(replace(self.arrays, variant=replace(self.variant, window=0)))

    def traces(self, contact: Any) -> list[Array]:
        """The trace of every shot of a traced march, with the state at its end."""
        rows = self.history.numpy().reshape(len(self.shots), self.arrays.rows, WIDTH)
        return [row[: steps + 1].astype(np.float64) for row, steps in zip(rows, contact.steps.numpy(), strict=True)]

    def plate_after(self, steps: int, time_step: float) -> tuple[Array, dict[int, Weakened]]:
        """Share of the plate's resistance that is left after some steps of the last shot on the CPU, in the window of
        its march, and what is left of the layers behind it by their numbers. All shots hit one plate."""
        scratch, before = self._scratch(1, *self.cells), len(self.shots) - 1
        order = self.inputs.put(np.arange(before + 1), wp.int32)
        outcomes = self._empty(self.stage.Outcomes, (before + 1,))
        if self.variant.layered and before:
            steps = max(1, steps)  # the window of a layer opens with the first step
        self.inputs.give_up_after((steps - 0.5) * time_step * self.shots.velocity[-1])
        if before:
            self._launch(order, outcomes, scratch, 1, 0, before)
        for name in self._fields():  # the window of a layer that is not reached stays closed
            getattr(scratch[0], name).zero_()
        self._launch(order, outcomes, scratch, 1, before, 1)
        if self.variant.nodal:
            return _host(scratch[0].share).reshape(self.cells), {}
        left = np.ones(self.cells)
        if self.variant.degrades and self.arrays.materials[0].weakens:
            left = share_left(self.arrays, 0, scratch[0].exposure.numpy(), self._windows(*self.cells))
        return np.asarray(self._material * left), self._behind(scratch)

    def _behind(self, scratch: tuple[Any, ...]) -> dict[int, Weakened]:
        if not (self.variant.layered and self.variant.degrades):
            return {}
        hit = float(self.shots.hit_y[-1]), float(self.shots.hit_z[-1])
        return weakened(self.arrays, self.scene.target.layers, hit, scratch, self._windows(*self.cells))

    def body(self) -> MassProperties:
        """Mass properties of the last shot."""
        names = ("mass", "inertia_axial", "inertia_transverse")
        return self.scene.core.mass_properties._replace(
            **{name: float(self.arrays.conditions[name][-1]) for name in names}
        )

    def nodes(self) -> tuple[Array, Array]:
        """Coordinates in the plate of the nodes of the last shot's window, along y and z [m]."""
        hit = float(self.shots.hit_y[-1]), float(self.shots.hit_z[-1])
        return nodes_about(hit, self.cells, self.arrays.grid.spacing)

    @cached_property
    def _material(self) -> Array:
        """Share of material about every node of the last shot's window."""
        return material_about(self.scene.target.layers[0], *self.nodes(), self.arrays.grid.spacing)

    def report(self, contact: Any) -> Returned:
        """Compute the free flight to the stand-offs; return all that the device knows of the shots."""
        count, standoffs = len(self.shots), np.array(self.scene.record.standoffs, dtype=np.float64)
        flight = free_flight.build(self.variant)
        report = self._empty(flight.Report, (count,), (count, len(standoffs)))
        load(flight.kernel, self.device)
        wp.launch(
            flight.kernel,
            count,
            inputs=[
                self.inputs.shots,
                self.inputs.target,
                contact,
                self.inputs.put(standoffs, wp.float64),
                self.scene.record.ahead(self.scene.core),
            ],
            outputs=[report],
            device=self.device,
        )
        status, passages = contact.status.numpy().astype(np.int8), self.passages
        return Returned(status, contact, report, self.bending.numpy(), passages.filled, passages.free)

    def _empty(self, struct: Any, *shapes: tuple[int, ...]) -> Any:
        """A struct of empty arrays; each has the shape with its number of dimensions."""
        filled = struct()
        for name, variable in struct.vars.items():
            array = variable.type
            shape = shapes[array.ndim - 1]
            setattr(filled, name, wp.empty(shape, dtype=array.dtype, device=self.device))
        return filled

    def _window_cells(self) -> tuple[int, int]:
        """Cells of a first window, or what memory allows."""
        cells_y = cells_z = self.arrays.cells
        while not self._fits(cells_y, cells_z):  # a shot that leaves a smaller window ends as LEFT_WINDOW
            cells_y, cells_z = cells_y // 2, cells_z // 2
        return cells_y, cells_z

    def cells_in_all(self) -> int:
        """Cells of the windows of all layers."""
        return sum(math.prod(cells) for cells in self._windows(*self.cells))

    def _windows(self, cells_y: int, cells_z: int) -> list[tuple[int, int]]:
        """Cells of the windows of all layers, if the plate's has this many."""
        own = [(cells_y, cells_z)] + [
            deep_cells(self.arrays, layer, cells_y) for layer in range(1, len(self.inputs.plates))
        ]
        return [own[material.laminate] for material in self.arrays.materials]

    def _nodes(self, cells_y: int, cells_z: int) -> list[int]:
        """Nodes of a slot in the windows of all layers; those of a laminate are those of its first layer."""
        return nodes_of(self.arrays, self._windows(cells_y, cells_z))

    def _slot_bytes(self, cells_y: int, cells_z: int) -> int:
        size = 8 if self.variant.double else 4
        per_ring: int = size + (wp.types.type_size_in_bytes(self.stage.Sums) if self.variant.bends else 0)
        rings: int = self.inputs.surface.rings * per_ring
        nodes = sum(self._nodes(cells_y, cells_z))
        earlier = bytes_of(self.at_a_plate, nodes, len(self.inputs.plates), size)
        return len(self._fields()) * nodes * size + earlier + self._patches() * (7 * size + 2 * 4) + rings

    def _fields(self) -> list[str]:
        """Names of the fields that a slot needs."""
        if self.variant.window and self.device.is_cuda:  # the others are in shared memory
            return ["filtered"] if self._keeps_fields else []
        members, real = self.stage.Fields.vars.items(), self.variant.real
        return [name for name, member in members if self._keeps_fields and getattr(member.type, "dtype", None) is real]

    @property
    def _keeps_fields(self) -> bool:
        return bool(self.variant.nodal or self.variant.degrades)

    def _patches(self) -> int:
        """Patches of a slot's touches."""
        return 0 if self.variant.nodal else self.inputs.surface.rings * self.inputs.surface.around

    def _slots(self, cells_y: int, cells_z: int) -> int:
        """Slots of scratch that the device's free memory and 32-bit indices allow."""
        free = free_memory() if self.device.is_cpu else self.device.free_memory
        wanted = self.threads if self.device.is_cpu else min(CUDA_CHUNK, len(self.shots) // self.at_a_plate)
        affordable = int(MEMORY_SHARE * free / self._slot_bytes(cells_y, cells_z))
        return min(wanted, affordable, (2**31 - 1) // (self.at_a_plate * sum(self._nodes(cells_y, cells_z))))

    def _fits(self, cells_y: int, cells_z: int) -> bool:
        return self._slots(cells_y, cells_z) > 0

    def _scratch(self, slots: int, cells_y: int, cells_z: int) -> tuple[Any, ...]:
        """Fields, touches, layers and earlier hits of some slots."""
        empty = partial(wp.empty, dtype=self.variant.real, device=self.device)
        fields, touches, put = self.stage.Fields(), self.stage.Touches(), self.inputs.put
        nodes = self._nodes(cells_y, cells_z)
        fields.nodes, fields.first = sum(nodes), put(firsts_of(self.arrays, nodes), wp.int32)
        cells = np.array(self._windows(cells_y, cells_z)).T
        fields.cells_y, fields.cells_z = (put(column, wp.int32) for column in cells)
        for name in self._fields():
            setattr(fields, name, empty(slots * fields.nodes))
        patches = slots * self._patches()
        for name in ("area", "slope", "shift", "gain", "y", "z", *(["x"] if self.variant.deep else [])):
            setattr(touches, name, empty(patches))
        for name in ("tile", "cell"):
            setattr(touches, name, wp.empty(patches, dtype=wp.int32, device=self.device))
        rings = slots * self.inputs.surface.rings
        touches.ring_area = empty(rings)
        if self.variant.bends:
            touches.sums = wp.empty(rings, dtype=self.stage.Sums, device=self.device)
            touches.total_area = empty(rings)
        earlier = earlier_hits(self.stage, self.at_a_plate, slots, nodes, self.device)
        return fields, touches, self.passages.stack(slots), earlier

    def _launch(
        self,
        order: Any,
        outcomes: Any,
        scratch: tuple[Any, ...],
        slots: int,
        first: int,
        count: int,
    ) -> int:
        """March `count` shots from order[first] on; returns `count`."""
        inputs = self.inputs
        launch = partial(wp.launch, dim=count)
        if self.variant.window:
            launch = partial(wp.launch_tiled, dim=[count], block_dim=LANES)
        launch(
            self.stage.kernel,
            inputs=[
                first,
                slots,
                order,
                inputs.surface,
                inputs.sections,
                inputs.target,
                inputs.law,
                inputs.shots,
                inputs.pace,
                *scratch,
            ],
            outputs=[outcomes, self.passages.filled, self.bending, self.history],
            device=self.device,
        )
        return count

    def _march_some(self, which: NDArray[np.int64], outcomes: Any, progress: Progress1) -> None:
        """March the shots of the given indices in windows of one size."""
        load(self.stage.kernel, self.device)
        if self.device.is_cpu:
            launch = partial(self._launch, self.inputs.put(which, wp.int32), outcomes)
            self._on_threads(launch, self._cpu_scratch(), len(which), progress)
        else:
            slots, scratch = halving(self._slots(*self.cells), lambda slots: self._scratch(slots, *self.cells))
            order = self.inputs.put(in_turns(which, self.at_a_plate, slots), wp.int32)
            for first, count in turns(len(which), self.at_a_plate, slots):
                self._launch(order, outcomes, scratch, slots, first, count)
                wp.synchronize_device(self.device)
                progress(first + count)

    def _cpu_scratch(self) -> list[Any]:
        """Scratch of one slot for every thread."""
        slots = self._slots(*self.cells)
        return halving(slots, lambda slots: [self._scratch(1, *self.cells) for _ in range(slots)])[1]

    def _on_threads(self, launch: Callable[..., int], slots: list[Any], total: int, progress: Progress1) -> None:
        """Distribute chunks over threads, each with one slot. A CPU launch runs its shots one after another on the
        calling thread, without the interpreter lock."""
        idle = SimpleQueue[Any]()
        for scratch in slots:
            idle.put(scratch)

        def work(first: int, count: int) -> tuple[int, float]:
            scratch, begin = idle.get(), time.perf_counter()
            try:
                return launch(scratch, 1, first, count), time.perf_counter() - begin
            finally:
                idle.put(scratch)

        # The first launches are of one shot each, as some scenes take seconds per shot; so are the last ones, as no
        # thread is to wait long for another.
        most, begun, done = 1, 0, 0
        waiting: set[Future[tuple[int, float]]] = set()
        with ThreadPoolExecutor(len(slots)) as pool:
            try:
                while done < total:
                    while begun < total and len(waiting) < 2 * len(slots):
                        share = max(1, (total - begun) // (SHARES * len(slots)))
                        count = min(chunk_of(min(most, share), self.at_a_plate), total - begun)
                        waiting.add(pool.submit(work, begun, count))
                        begun += count
                    ended, waiting = wait(waiting, return_when=FIRST_COMPLETED)
                    for shots, seconds in (future.result() for future in ended):
                        done += shots
                        most = min(CPU_CHUNK, max(1, int(CPU_LAUNCH * shots / max(seconds, 1e-9))))
                    progress(done)
            finally:
                for future in waiting:
                    future.cancel()


def _after(finished: int, progress: Progress1) -> Progress1:
    """Progress of what comes after the shots already finished."""
    return lambda done: progress(finished + done)


def _host(array: Any) -> Array:
    values: Array = array.numpy().astype(np.float64)
    return values
