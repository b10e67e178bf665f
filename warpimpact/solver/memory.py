"""A prepared scene in the memory of one device: inputs of the kernels, scratch of the shots in progress, and
results."""

from __future__ import annotations

import time
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from types import ModuleType
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.kernels import free_flight, lanes, march
from warpimpact.kernels.trace import WIDTH
from warpimpact.kernels.variant import Variant
from warpimpact.records.outcomes import Outcomes, Returned, columns_of
from warpimpact.solver.device import NEVER, SMALL_MEMORY, Cancel, building, free_memory, load
from warpimpact.solver.prepare import Prepared
from warpimpact.solver.structs import ToDevice, empty, filled, inputs_of

Array = NDArray[np.float64]

CUDA_CHUNK = 65536
FEWEST_CELLS = 16
"""Fewest cells along a side of the plate's window. A smaller window would hold no core."""
MEMORY_SHARE = 0.5
"""Largest share of the free memory for scratch."""


class Memory:
    """A prepared scene on one device, with all that a launch of the march needs (kernels/march.py).

    Attributes:
        prepared: the prepared scene.
        device: the device.
        stage, flight: builds of the march and of the free flight that the scene needs.
        put: puts values on the device.
        inputs: what a launch of the march reads.
        rings, patches: numbers of the surface; no patches in the nodal scheme, which keeps none.
        bending, passage, history: what the march fills beside the outcomes.
    """

    def __init__(self, prepared: Prepared, device: Any, cancel: Cancel = NEVER) -> None:
        """Build the tiles of the plates, unless `cancel` ends it, and copy everything to the device."""
        for tile in prepared.tiles:
            tile.build(cancel.check)
        variant, scene, count = prepared.variant, prepared.scene, len(prepared.shots)
        self.prepared, self.device, self.variant = prepared, device, variant
        self.stage, self.flight = built(march, variant), built(free_flight, variant)
        self.put = ToDevice(device.alias, variant.real)
        self.inputs, self._kept = inputs_of(self.stage, prepared, self.put)
        self.rings = len(prepared.surface.rings.station)
        self.patches = 0 if variant.nodal else self.rings * prepared.surface.around
        self.bending = wp.empty(count if variant.bends else 0, dtype=self.stage.Bending, device=device)
        self.history = wp.empty((count * prepared.rows, WIDTH), dtype=variant.real, device=device)
        recorded = count if variant.layered else 0
        self.passage = empty(self.stage.Passage, device, (recorded,), (recorded, len(scene.target.layers)))

    def build(self) -> float:
        """Compile the kernels, once per version and machine, and load them; returns the time [s]."""
        begin = time.perf_counter()
        for kernel in (self.stage.kernel, self.flight.kernel):
            load(kernel, self.device)
        return time.perf_counter() - begin

    def give_up_after(self, way: float) -> None:
        """Give up the last shot after this way [m] at impact velocity."""
        longest_way = self.inputs.shots.longest_way.numpy()
        ways = np.resize(longest_way, max(len(longest_way), len(self.prepared.shots)))
        ways[-1] = way
        self.inputs.shots.longest_way = self.put(ways, wp.float64)

    def with_windows(self, cells: int) -> Memory:
        """A memory for windows of these cells, by the simple layout if they do not fit a block."""
        if not 0 < self.variant.window < cells**2:
            return self
        wider = Memory(replace(self.prepared, variant=replace(self.variant, window=0)), self.device)
        wider.passage, wider.history = self.passage, self.history  # these hold the finished shots
        return wider

    def outcomes(self) -> Any:
        """Empty arrays for the outcomes of all shots."""
        return empty(self.stage.Outcomes, self.device, (len(self.prepared.shots),))

    @property
    def fields(self) -> list[str]:
        """Names of the fields that a slot needs."""
        if not (self.variant.nodal or self.variant.degrades):
            return []
        if self.variant.window and self.device.is_cuda and not self.variant.layered:  # the others are in shared memory
            return ["filtered"]
        return ["share", "touched"] if self.variant.nodal else ["exposure", "gain", "filtered"]

    def slots(self, cells: int, threads: int) -> int:
        """Slots of scratch that the free memory of the device and 32-bit indices allow; on a CPU at most one per
        thread."""
        nodes = self.prepared.nodes(cells)
        wanted = threads if self.device.is_cpu else min(CUDA_CHUNK, len(self.prepared.shots))
        bytes_of_one = self.slot_bytes(cells)
        fitting = wanted if wanted * bytes_of_one <= SMALL_MEMORY else int(MEMORY_SHARE * self._free / bytes_of_one)
        return min(wanted, fitting, (2**31 - 1) // max(nodes, 1))

    def first_cells(self, threads: int) -> int:
        """Cells of the first window, fewer if memory does not allow them.

        Raises:
            MemoryError: no window that holds a core fits; the message is for the user.
        """
        wanted = cells = self.prepared.cells
        while self.slots(cells, threads) == 0:  # a shot that leaves a smaller window ends as LEFT_WINDOW
            cells //= 2
            if cells < FEWEST_CELLS:
                raise MemoryError(
                    f"a shot needs {self.slot_bytes(wanted) / 2**30:.3g} GiB in {self.prepared.nodes(wanted):.3g} "
                    f"nodes about its way through the target, but {MEMORY_SHARE * self._free / 2**30:.3g} GiB and "
                    "2.15e+09 nodes are allowed; give a lower level or a longer degradation_length"
                )
        return cells

    @property
    def _free(self) -> int:
        """Free memory of the device [bytes]."""
        return free_memory() if self.device.is_cpu else int(self.device.free_memory)

    def slot_bytes(self, cells: int) -> int:
        """Memory of a slot of scratch [bytes]."""
        nodes = self.prepared.nodes(cells)
        size = 8 if self.variant.double else 4
        per_ring: int = size + (wp.types.type_size_in_bytes(self.stage.Sums) if self.variant.bends else 0)
        patches = self.patches * (8 * size + 3 * 4)
        return int(len(self.fields) * nodes * size + patches + self.rings * per_ring)

    def scratch(self, slots: int, cells: int) -> Any:
        """The Scratch of some slots."""
        stage, put, windows = self.stage, self.put, self.prepared.windows(cells)
        room = partial(wp.empty, dtype=self.variant.real, device=self.device)
        fields, touches = stage.Fields(), stage.Touches()
        fields.nodes, fields.first = int((windows**2).sum()), put(np.cumsum([0, *windows[:-1] ** 2]), wp.int32)
        fields.cells_y = fields.cells_z = put(windows, wp.int32)
        for name in self.fields:
            setattr(fields, name, room(slots * fields.nodes))
        patches, rings = slots * self.patches, slots * self.rings
        members = ["area", "slope", "shift", "gain", "y", "z"]
        free = self.variant.free_surface
        members += [f"cover_{name}" * free for name in ("y", "z", "turn", "decay")]
        for name in filter(None, members):
            setattr(touches, name, room(patches))
        for name in filter(None, ["tile", "cell", "cover" * free]):
            setattr(touches, name, wp.empty(patches, dtype=wp.int32, device=self.device))
        touches.ring_area = room(rings)
        if self.variant.bends:
            touches.sums = wp.empty(rings, dtype=stage.Sums, device=self.device)
            touches.total_area = room(rings)
        stack = empty(stage.Stack, self.device, (slots * len(windows) if self.variant.layered else 0,), (0, 0))
        if self.variant.layered:
            stack.first_cells = put(self.prepared.windows_behind(self.prepared.first_cells), wp.int32)
        return filled(stage.Scratch, fields=fields, touches=touches, stack=stack)

    def scratches(self, cells: int, threads: int) -> tuple[int, list[Any]]:
        """Scratch for all threads: the slots of each, and one for each thread of a CPU, or one for a GPU.

        There are fewer slots where the free memory, which is only an estimate, does not suffice.

        Raises:
            MemoryError: there is no memory for one slot.
        """
        slots = self.slots(cells, threads)
        while True:
            each, count = (1, slots) if self.device.is_cpu else (slots, 1)
            try:
                return each, [self.scratch(each, cells) for _ in range(count)]
            except (RuntimeError, MemoryError) as error:
                if not (isinstance(error, MemoryError) or "allocate" in str(error)):  # Warp has no error of its own
                    raise
                if slots == 1:
                    raise MemoryError(str(error)) from error
            slots //= 2

    def launch(self, order: Any, outcomes: Any, scratch: Any, slots: int, batches: Iterable[tuple[int, int]]) -> None:
        """March batches of shots, each given by its first place in `order` and its number of shots."""
        results = filled(
            self.stage.Results, outcomes=outcomes, passage=self.passage, bending=self.bending, trace=self.history
        )
        launch = partial(wp.launch, block_dim=lanes.THREADS if self.device.is_cuda else 1)
        if self.variant.window:
            launch = partial(wp.launch_tiled, block_dim=lanes.LANES)
        for first, count in batches:
            inputs = [first, slots, order, self.inputs, scratch]
            launch(self.stage.kernel, dim=[count], inputs=inputs, outputs=[results], device=self.device)
            wp.synchronize_device(self.device)

    def report(self, contact: Any) -> Outcomes:
        """Compute the free flight to the stand-offs of shots that have marched; returns all that the scene records."""
        scene, count = self.prepared.scene, len(self.prepared.shots)
        flight, standoffs = self.flight, np.array(scene.record.standoffs, dtype=np.float64)
        report = empty(self.stage.Report, self.device, (count,), (count, len(standoffs)))
        load(flight.kernel, self.device)
        ahead = scene.record.ahead(scene.core)
        inputs = [self.inputs.shots, self.inputs.target, contact, self.put(standoffs, wp.float64), ahead]
        wp.launch(flight.kernel, count, inputs=inputs, outputs=[report], device=self.device)
        status = contact.status.numpy().astype(np.int8)
        returned = Returned(status, contact, report, self.bending.numpy(), self.passage)
        return Outcomes(**columns_of(scene, self.prepared.shots, returned))


def built(module: ModuleType, variant: Variant) -> Any:
    """The build of a module for a variant: one, whichever threads ask for it."""
    with building():
        return module.build(variant)
