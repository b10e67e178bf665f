"""Arrays of shots in, arrays of outcomes out: device, windows, memory and threads."""

from __future__ import annotations

import math
import os
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, fields
from functools import partial
from queue import SimpleQueue
from typing import Any, TypeVar

import numpy as np
import psutil
import warp as wp
from numpy.typing import NDArray

from warpimpact import discretisation
from warpimpact.discretisation import Fidelity
from warpimpact.history import History
from warpimpact.kernels import free_flight, march
from warpimpact.kernels.status import Status
from warpimpact.kernels.variant import Variant
from warpimpact.scene import Core, Interaction, Numerics, Plate, Shots

Array = NDArray[np.float64]
Progress = Callable[[int, int], None]
Progress1 = Callable[[int], None]
Scratch = TypeVar("Scratch")

CPU_CHUNK = 32
"""Shots per launch on the CPU: few enough for a smooth progress bar and even threads."""
CUDA_CHUNK = 65536
WINDOW_SLACK = 1.2
"""Half the width of a first window in radii of the core, for a straight shot."""
MAX_DOUBLINGS = 6
"""How often a shot that leaves its window is computed again in one twice as wide."""
STEP_ALLOWANCE = 200
"""How many times the way of an unhindered passage a shot may take, at impact velocity, before it is given up."""
MEMORY_SHARE = 0.5
"""Share of the free memory that scratch may take."""


class DeviceError(RuntimeError):
    """The device asked for is not there; the message is for a person."""


class UnsupportedError(ValueError):
    """What the kernels cannot compute yet; the message is for a person."""


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
        tilt: angle between core axis and line of fire [rad], shape [shots, stand-offs]; likewise
        pitch, yaw: projected angles of the axis [rad], and
        total_yaw: angle between core axis and residual velocity [rad].
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


@dataclass(frozen=True)
class Replay:
    """One shot with all that happened on the way: SI, float64.

    Attributes:
        outcomes: how it ended, each of shape [1] or [1, …].
        history: the core at every step, and at the end.
        plate_time: instants at which the plate is shown [s], shape [snapshots]; 0 is the first touch.
        resistance_share: resistance left, as a share of Y, in the cells that the core may reach: 0 in holes,
            shape [snapshots, cells_y, cells_z].
        cell_y, cell_z: centres of those cells in the plate [m], shapes [cells_y] and [cells_z].
    """

    outcomes: Outcomes
    history: History
    plate_time: Array
    resistance_share: Array
    cell_y: Array
    cell_z: Array


def simulate(
    core: Core,
    plate: Plate,
    shots: Shots,
    *,
    interaction: Interaction | None = None,
    numerics: Numerics | Fidelity | None = None,
    standoffs: Sequence[float] = (),
    standoff_point: str = "centre_of_mass",
    device: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
) -> Outcomes:
    """Compute every shot on its own copy of the plate (MODEL.md §§1–5).

    Args:
        standoffs: distances behind the rear face [m], shape [stand-offs]; at least the core's bounding radius.
        standoff_point: which point has to pass them: "centre_of_mass" or "nose".
        device: "auto" (CUDA if there is one, else CPU), "cpu", "cuda:0", …
        threads: of a CPU; None is one for every core that this process may use.
        progress: called with (shots done, shots) as they come; what it raises ends the computation.

    Raises:
        DeviceError: the device is absent.
        UnsupportedError: a quantity differs from shot to shot that the kernels take as one number.
    """
    task = _Task(core, plate, interaction or Interaction(), numerics or Numerics(), shots, find_device(device))
    task.threads = threads or cores()
    contact = task.march(progress or _unseen)
    return task.report(contact, np.asarray(standoffs, dtype=float), standoff_point)


def trace(
    core: Core,
    plate: Plate,
    shots: Shots,
    *,
    interaction: Interaction | None = None,
    numerics: Numerics | Fidelity | None = None,
) -> list[Array]:
    """Histories of shots on the CPU: one array [steps + 1, TRACE_COLUMNS] per shot (kernels/march.py)."""
    task = _traced_task(core, plate, shots, interaction, numerics)
    return task.traces(task.march(_unseen))


def replay(
    core: Core,
    plate: Plate,
    shot: Shots,
    *,
    interaction: Interaction | None = None,
    numerics: Numerics | Fidelity | None = None,
    standoffs: Sequence[float] = (),
    standoff_point: str = "centre_of_mass",
    snapshots: int = 6,
) -> Replay:
    """One shot again on the CPU, with its history; it ends with the bits of `simulate` on the same CPU.

    Args:
        shot: shots of length 1; the others as in `simulate`.
        snapshots: how often the plate is shown, evenly from the first touch to the end.
    """
    task = _traced_task(core, plate, shot, interaction, numerics)
    contact = task.march(_unseen)
    (trace,) = task.traces(contact)
    time_step = 2.0 * trace[0, 0]
    steps = np.unique(np.linspace(0, len(trace) - 1, snapshots).round().astype(int))
    cell_y, cell_z = task.nodes()
    return Replay(
        outcomes=task.report(contact, np.asarray(standoffs, dtype=float), standoff_point),
        history=History.from_trace(trace, core),
        plate_time=steps * time_step,
        resistance_share=np.stack([task.plate_after(count, time_step) for count in steps]),
        cell_y=cell_y,
        cell_z=cell_z,
    )


def _traced_task(
    core: Core, plate: Plate, shots: Shots, interaction: Interaction | None, numerics: Numerics | Fidelity | None
) -> _Task:
    device = find_device("cpu")
    return _Task(core, plate, interaction or Interaction(), numerics or Numerics(), shots, device, traced=True)


def find_device(name: str) -> Any:
    """The Warp device of a name; "auto" takes CUDA where there is one."""
    _start_warp()
    if name == "auto":
        return wp.get_device("cuda:0" if wp.is_cuda_available() else "cpu")
    try:
        return wp.get_device(name)
    except (ValueError, RuntimeError):
        present = ", ".join(str(d) for d in wp.get_devices())
        raise DeviceError(f'device: got "{name}", which this machine lacks; allowed: auto, {present}') from None


def _start_warp() -> None:
    """Start Warp, quietly and fit for launches from several threads.

    Warp writes its word that there is no CUDA driver straight to file descriptor 2, where it is no concern of who
    asked for no GPU; everything else written there is passed on. Tile storage on the stack, which no kernel here
    uses, goes through one unguarded static and crashes threads in debug mode.
    """
    wp.config.log_level = max(wp.config.log_level, wp.LOG_WARNING)
    wp.config.enable_tiles_in_stack_memory = False
    kept = os.dup(2)
    with tempfile.TemporaryFile() as aside:
        os.dup2(aside.fileno(), 2)
        try:
            wp.init()
        finally:
            os.dup2(kept, 2)
            os.close(kept)
            aside.seek(0)
            for line in aside:
                if b"find or load the NVIDIA CUDA driver" not in line:
                    os.write(2, line)


class _Task:
    """One scene on one device, ready to march."""

    def __init__(
        self,
        core: Core,
        plate: Plate,
        interaction: Interaction,
        numerics: Numerics | Fidelity,
        shots: Shots,
        device: Any,
        *,
        traced: bool = False,
    ) -> None:
        _refuse_unsupported(shots)
        self.core, self.plate, self.shots, self.device, self.threads = core, plate, shots, device, cores()
        self.resolution = discretisation.resolve(numerics, core, plate)
        a0, a1, a2 = interaction.coefficients(plate)
        self.variant = Variant(
            double=self.resolution.double,
            nodal=self.resolution.nodal,
            degrades=plate.degradation < 1.0,
            rubs=plate.shear_coefficient > 0.0,
            rate_dependent=a1 > 0.0 or a2 > 0.0,
            rimmed=plate.size is not None,
        )
        self.traced = traced
        self.stage = march.build(self.variant)
        self.real = np.float64 if self.resolution.double else np.float32
        self.spacing = self.resolution.grid_spacing
        self.surface = self._surface()
        self.body = self._body()
        self.device_plate = self._plate()
        self.law = self._law(a0, a1, a2)
        self.device_shots = self._shots()
        self.pace = self._pace()
        rows = len(shots) * self.pace.rows if traced else 0
        self.history = wp.empty((rows, march.TRACE_COLUMNS), dtype=self.variant.real, device=device)
        self.cells = self._window_cells()

    def _array(self, values: NDArray[Any], dtype: Any = None) -> Any:
        return wp.array(np.ascontiguousarray(values), dtype=dtype or self.variant.real, device=self.device)

    def _surface(self) -> Any:
        r = self.resolution
        rings = discretisation.rings_of(self.core, r.patches_axial, r.patches_around, r.patch_width, discs=not r.nodal)
        azimuths = discretisation.azimuths_of(r.patches_around)
        surface = self.stage.Surface()
        for name in ("station", "radius", "half_axial", "half_radial", "turn_axial", "turn_radial"):
            setattr(surface, name, self._array(getattr(rings, name)))
        area = np.hypot(rings.area_axial, rings.area_radial)
        surface.area = self._array(area)
        surface.normal_axial = self._array(rings.area_axial / area)
        surface.normal_radial = self._array(rings.area_radial / area)
        surface.cosine, surface.sine = self._array(np.cos(azimuths)), self._array(np.sin(azimuths))
        surface.rings, surface.around = len(rings.station), r.patches_around
        surface.max_radius = self.core.max_radius
        surface.bounding_radius = self.core.bounding_radius
        return surface

    def _body(self) -> Any:
        properties, body = self.core.mass_properties, self.stage.Body()
        body.mass = properties.mass
        body.inertia_axial = properties.inertia_axial
        body.inertia_transverse = properties.inertia_transverse
        return body

    def _plate(self) -> Any:
        nodal = self.resolution.nodal
        finer = 1 if nodal else discretisation.FINER
        tile = discretisation.tile_of(self.plate, self.spacing / finer, sharp=nodal)
        plate = self.stage.Plate()
        plate.tile = self._array(np.pad(tile.material, (0, 1), mode="wrap").reshape(-1))
        plate.clear = self._array(tile.clearance.reshape(-1))
        plate.tile_y, plate.tile_z = tile.material.shape
        plate.period_y, plate.period_z = self.plate.pattern.period
        if nodal:  # nodes are the tile's cells, which fit the period
            self.spacing = min(tile.dy, tile.dz)
        plate.spacing = self.spacing
        size = self.plate.size or (math.inf, math.inf)
        plate.half_y, plate.half_z = 0.5 * size[0], 0.5 * size[1]
        plate.thickness = self.plate.thickness
        taps = discretisation.tent_taps(0.0 if nodal else self.plate.degradation_length, self.spacing)
        plate.reach = len(taps) // 2
        plate.taps = self._array(np.append(taps[plate.reach :], 0.0))
        return plate

    def _law(self, a0: float, a1: float, a2: float) -> Any:
        law, plate = self.stage.Law(), self.plate
        law.a0, law.a1, law.a2 = a0, a1, a2
        law.friction = plate.shear_coefficient
        law.onset_jump = discretisation.onset_jump(self.core, plate, a0)
        law.onset_limit = discretisation.LARGEST_ONSET
        if self.resolution.nodal:
            law.decay_rate = plate.degradation
        else:
            law.decay_rate = -discretisation.decay_rate(plate)
        return law

    def _shots(self) -> Any:
        shots = self.stage.Shots()
        for name, values in self.shots.columns.items():
            setattr(shots, name, self._array(values, dtype=wp.float64))
        return shots

    def _pace(self) -> Any:
        pace, passage = self.stage.Pace(), self.plate.thickness + 2.0 * self.core.bounding_radius
        pace.time_step = self.resolution.time_step or 0.0
        pace.way, pace.way_along = self.resolution.way, self.resolution.way_along
        pace.longest_time = self.resolution.longest_time
        pace.longest_step = self.resolution.longest_step
        pace.longest_way = STEP_ALLOWANCE * passage
        if self.traced:
            pairs = zip(self.shots.velocity, self.shots.obliquity, strict=True)
            shortest = min(self.resolution.step_at(v, obliquity) * v for v, obliquity in pairs)
            pace.rows = math.ceil(pace.longest_way / shortest) + 2  # the end, and a step that rounding may add
        return pace

    def march(self, progress: Progress) -> Any:
        """March all shots; those that leave their window again in wider ones."""
        count = len(self.shots)
        outcomes = self._empty(self.stage.Outcomes, (count,))
        pending = np.arange(count)
        for _ in range(MAX_DOUBLINGS):
            self._march_some(pending, outcomes, _after(count - len(pending), count, progress))
            pending = np.flatnonzero(outcomes.status.numpy() == Status.LEFT_WINDOW)
            if not len(pending) or not self._fits(2 * self.cells[0], 2 * self.cells[1]):
                break
            self.cells = (2 * self.cells[0], 2 * self.cells[1])
        progress(count, count)
        return outcomes

    def traces(self, contact: Any) -> list[Array]:
        """What every shot of a traced march wrote, the state at its end included."""
        rows = self.history.numpy().reshape(len(self.shots), self.pace.rows, march.TRACE_COLUMNS)
        return [row[: steps + 1].astype(np.float64) for row, steps in zip(rows, contact.steps.numpy(), strict=True)]

    def plate_after(self, steps: int, time_step: float) -> Array:
        """Share of the resistance left for the first shot after some steps on the CPU, in its window once marched."""
        scratch = self._scratch(1, *self.cells)
        pace = self._pace()
        pace.longest_way = (steps - 0.5) * time_step * self.shots.velocity[0]
        stopped = self._empty(self.stage.Outcomes, (1,))
        self._launch(self._array(np.zeros(1), dtype=wp.int32), stopped, pace, scratch, 1, 0, 1)
        if self.resolution.nodal:
            return _host(scratch[0].exposure).reshape(self.cells)
        share = self._material()
        if self.variant.degrades:
            share *= np.exp(self.law.decay_rate * _host(scratch[0].exposure).reshape(self.cells))
        return share

    def nodes(self) -> tuple[Array, Array]:
        """Where the nodes of the first shot's window are in the plate [m], along y and z."""
        hit = self.shots.hit_y[0], self.shots.hit_z[0]
        y, z = (at + (np.arange(count) - count // 2) * self.spacing for at, count in zip(hit, self.cells, strict=True))
        return y, z

    def _material(self) -> Array:
        """Share of material about every node of the first shot's window."""
        samples = 16
        fine = (np.arange(samples) + 0.5) / samples - 0.5
        y, z = ((nodes[:, None] + self.spacing * fine).reshape(-1) for nodes in self.nodes())
        solid = self.plate.is_solid(y[:, None], z[None, :])
        shape = (self.cells[0], samples, self.cells[1], samples)
        return np.asarray(solid.reshape(shape).mean(axis=(1, 3)))

    def report(self, contact: Any, standoffs: Array, standoff_point: str) -> Outcomes:
        """Free flight to the stand-offs, and everything back on the host."""
        count = len(self.shots)
        flight = free_flight.build(self.variant)
        report = self._empty(flight.Report, (count,), (count, len(standoffs)))
        ahead = self.core.mass_properties.centre_of_mass if standoff_point == "nose" else 0.0
        planes = self._array(self.plate.thickness + standoffs)
        wp.launch(
            flight.kernel,
            count,
            inputs=[self.body, self.device_shots, contact, planes, ahead],
            outputs=[report],
            device=self.device,
        )
        values = {f.name: _host(getattr(report, f.name)) for f in fields(Outcomes) if f.name != "status"}
        return Outcomes(status=contact.status.numpy().astype(np.int8), **values)

    def _empty(self, struct: Any, *shapes: tuple[int, ...]) -> Any:
        """A struct of arrays, each of the shape that has its number of dimensions."""
        filled = struct()
        for name, variable in struct.vars.items():
            array = variable.type
            shape = shapes[array.ndim - 1]
            setattr(filled, name, wp.empty(shape, dtype=array.dtype, device=self.device))
        return filled

    def _window_cells(self) -> tuple[int, int]:
        """Cells of a window that holds the footprint of a core that keeps its attitude through the plate."""
        shots, plate = self.shots, self.plate
        steepest = float(shots.obliquity.max())
        turned = min(1.0, float(np.sin(np.hypot(shots.pitch, shots.yaw)).max()))
        half = (
            WINDOW_SLACK * self.core.max_radius / math.cos(steepest)
            + plate.thickness * math.tan(steepest)
            + self.core.bounding_radius * turned
        )
        cells_y = cells_z = 2 * (math.ceil(half / self.spacing) + 2 * self.device_plate.reach + 3)
        while not self._fits(cells_y, cells_z):  # what leaves a smaller window gets its named status
            cells_y, cells_z = cells_y // 2, cells_z // 2
        return cells_y, cells_z

    def _slot_bytes(self, cells_y: int, cells_z: int) -> int:
        size = np.dtype(self.real).itemsize
        return self._field_count() * cells_y * cells_z * size + self._patches() * (6 * size + 2 * 4)

    def _field_count(self) -> int:
        return 2 if self.resolution.nodal else 3 if self.variant.degrades else 0

    def _patches(self) -> int:
        """Patches of a slot's touches."""
        return 0 if self.resolution.nodal else self.surface.rings * self.surface.around

    def _slots(self, cells_y: int, cells_z: int) -> int:
        """Slots of scratch that the device's free memory and 32-bit indices allow."""
        free = psutil.virtual_memory().available if self.device.is_cpu else self.device.free_memory
        wanted = self.threads if self.device.is_cpu else min(CUDA_CHUNK, len(self.shots))
        affordable = int(MEMORY_SHARE * free / self._slot_bytes(cells_y, cells_z))
        return min(wanted, affordable, (2**31 - 1) // (cells_y * cells_z))

    def _fits(self, cells_y: int, cells_z: int) -> bool:
        return self._slots(cells_y, cells_z) > 0

    def _scratch(self, slots: int, cells_y: int, cells_z: int) -> tuple[Any, Any]:
        """Fields and touches of some slots."""
        empty = partial(wp.empty, dtype=self.variant.real, device=self.device)
        scratch, touches = self.stage.Fields(), self.stage.Touches()
        scratch.cells_y, scratch.cells_z = cells_y, cells_z
        for name in ("exposure", "gain", "filtered")[: self._field_count()]:
            setattr(scratch, name, empty(slots * cells_y * cells_z))
        patches = slots * self._patches()
        for name in ("area", "gain", "tile_y", "tile_z", "y", "z"):
            setattr(touches, name, empty(patches))
        for name in ("tile", "cell"):
            setattr(touches, name, wp.empty(patches, dtype=wp.int32, device=self.device))
        touches.ring_area = empty(slots * self.surface.rings)
        return scratch, touches

    def _launch(self, order: Any, outcomes: Any, pace: Any, scratch: Any, slots: int, first: int, count: int) -> int:
        """March `count` shots from order[first] on; returns `count`."""
        wp.launch(
            self.stage.kernel,
            count,
            inputs=[
                first,
                slots,
                order,
                self.surface,
                self.body,
                self.device_plate,
                self.law,
                self.device_shots,
                pace,
                *scratch,
            ],
            outputs=[outcomes, self.history],
            device=self.device,
        )
        return count

    def _march_some(self, which: NDArray[np.int64], outcomes: Any, progress: Progress1) -> None:
        """March the shots of the given indices in windows of one size."""
        self.stage.kernel.module.load(self.device)
        launch = partial(self._launch, self._array(which, dtype=wp.int32), outcomes, self.pace)
        if self.device.is_cpu:
            self._on_threads(launch, self._cpu_scratch(), len(which), progress)
        else:
            slots, scratch = _halving(self._slots(*self.cells), lambda slots: self._scratch(slots, *self.cells))
            for first, count in _chunks(len(which), slots):
                launch(scratch, slots, first, count)
                wp.synchronize_device(self.device)
                progress(first + count)

    def _cpu_scratch(self) -> list[Any]:
        """Scratch of one slot for every thread."""
        slots = self._slots(*self.cells)
        return _halving(slots, lambda slots: [self._scratch(1, *self.cells) for _ in range(slots)])[1]

    def _on_threads(self, launch: Callable[..., int], slots: list[Any], total: int, progress: Progress1) -> None:
        """Share chunks out over threads, each with one slot: a CPU launch runs its shots one after another on
        the calling thread, without the interpreter lock."""
        idle = SimpleQueue[Any]()
        for scratch in slots:
            idle.put(scratch)

        def work(chunk: tuple[int, int]) -> int:
            scratch = idle.get()
            try:
                return launch(scratch, 1, *chunk)
            finally:
                idle.put(scratch)

        done = 0
        with ThreadPoolExecutor(len(slots)) as pool:
            for count in pool.map(work, _chunks(total, CPU_CHUNK)):
                done += count
                progress(done)


def _unseen(done: int, total: int) -> None:
    """Progress that nobody follows."""


def _after(finished: int, total: int, progress: Progress) -> Progress1:
    """Progress of what comes after the shots already finished."""
    return lambda done: progress(finished + done, total)


def _chunks(total: int, size: int) -> Iterator[tuple[int, int]]:
    """(first, count) of consecutive chunks."""
    return ((first, min(size, total - first)) for first in range(0, total, size))


def _halving(slots: int, allocate: Callable[[int], Scratch]) -> tuple[int, Scratch]:
    """Slots and their scratch: half as many while there is no memory for more, which free memory only estimates."""
    while True:
        try:
            return slots, allocate(slots)
        except (RuntimeError, MemoryError) as error:
            if slots == 1 or not (isinstance(error, MemoryError) or "allocate" in str(error)):
                raise
        slots //= 2


def _refuse_unsupported(shots: Shots) -> None:
    """The one place that knows which columns of the shots the kernels take as one number of the scene."""
    per_shot = [
        name
        for name in ("resistance", "shear_coefficient", "degradation", "thickness", "mass")
        if name in shots.columns
    ]
    if per_shot:
        raise UnsupportedError(
            f"{per_shot[0]}: got values that differ from shot to shot, which is not supported yet; give one number"
        )


def cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


def _host(array: Any) -> Array:
    values: Array = array.numpy().astype(np.float64)
    return values
