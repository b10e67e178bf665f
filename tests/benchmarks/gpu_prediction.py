"""What the block layout should reach on a CUDA device that nobody has: its instructions and bytes per hit, counted.

    python tests/benchmarks/gpu_prediction.py      # writes results/gpu_prediction.json; needs no CUDA device

Steps and patches are those of shots of the slotted plate on the CPU. Instructions are those in the loops of the block
layout's kernel (Variant(window=2048)) in the machine code of sm_90, as ptxas 13.5 makes it and nvdisasm shows it; a
lane is taken to execute each of them once per round of its loop. The limits are those of an H100 SXM by its data sheet.
No figure here is a measurement.
"""

import math
import sys
from typing import Any

import numpy as np
import warp as wp
from bench import CAMPAIGN, machine, shots_of, store
from floor import work_of
from numpy.typing import NDArray

from warpimpact import Campaign, Shots
from warpimpact.kernels import core_surface, footprint, plate_grid
from warpimpact.kernels.lanes import BLOCKS, LANES
from warpimpact.kernels.variant import Variant
from warpimpact.scene import Numerics
from warpimpact.solver.arrays import arrays_of
from warpimpact.solver.blocks import first_window
from warpimpact.solver.history import History
from warpimpact.solver.inputs import Put, surface_of
from warpimpact.solver.simulate import trace

HITS = 64
# Instructions of a lane, per round.
SERIAL = 2950  # of a step: pose, statuses, butterflies, kick, drift; every lane does all of it
FOOTPRINT = 126  # per ring
FIND, MEET, EXPOSE, SUM = 333, 20, 35, 190  # per patch of the list: first pass; material; exposure; second pass
COARSEST = 4  # per ring of the list
NODE = 5 + 9 + 10 + 7 + 6  # whole numbers to exposure; filter, two directions; half of it added; settled
SETUP = 6000  # of a shot: conditions, foremost point, clearing the window
# 4-byte words of shared memory per node and patch; of global memory per patch: the four loops, in the same order.
NODE_WORDS, GATHER_WORDS, SCATTER_WORDS = 2 + 3 + 4 + 5, 4, 8
WORDS = (11 + 8) + (5 + 3) + 4 + 14
STREAMS = 2 * 8 + 12
"""Words that the simple layout moves per patch: touches written and read, nodes read and written."""

REGISTERS, SHARED = 168, 2 * 4 * 2048 + 128
"""Of a lane and of a block, as ptxas reports them for 12 blocks per multiprocessor."""
MULTIPROCESSORS, CLOCK, SCHEDULERS = 132, 1.755e9, 4
REGISTER_FILE, SHARED_MEMORY, RESERVED = 65536, 228 * 1024, 1024
FP32, SHARED_RATE, L2_RATE, MEMORY_RATE = 67e12, MULTIPROCESSORS * 128 * CLOCK, 5.5e12, 3.35e12
SECTOR = 32
"""Bytes that an access moves that shares no sector with its neighbours."""
CYCLES = (3.0, 5.0, 8.0)
"""Cycles from one instruction of a warp to its next, on average: arithmetic waits 4 for a result, shared memory about
30, L2 about 250, and about half of the instructions wait for the one before. The truth is taken to lie between the
outer ones."""


def main() -> int:
    """Count, print, store."""
    campaign, numerics = Campaign.from_toml(CAMPAIGN), Numerics(layout="block")
    shots = shots_of(campaign, HITS)
    arrays, work = arrays_of(campaign.scene, numerics, shots), work_of(campaign, shots, numerics)
    values = predicted(work, listed(campaign, shots, numerics, arrays), arrays, first_window(arrays, shots))
    for name, value in values.items():
        print(f"{name.replace('_', ' '):45s} {value if isinstance(value, str) else format(value, '.3g')}")
    store("gpu_prediction", {"measured": False, "machine": machine(), **values})
    return 0


def listed(campaign: Campaign, shots: Shots, numerics: Numerics, arrays: Any) -> NDArray[np.int_]:
    """Rings in the list that the lanes share out, at every step of all shots: what `footprint_of` finds in the single
    precision of the simple layout."""
    variant, put = Variant(), Put("cpu", wp.float32)
    surfaces, grid, prints = (part.build(variant) for part in (core_surface, plate_grid, footprint))
    Surface, Plate, Window = surfaces.Surface, grid.Plate, grid.Window

    def count(
        surface: Surface,
        plate: Plate,
        window: Window,
        dt: wp.float32,
        position: wp.array(dtype=wp.vec3),
        attitude: wp.array(dtype=wp.quat),
        velocity: wp.array(dtype=wp.vec3),
        omega: wp.array(dtype=wp.vec3),
        rings: wp.array(dtype=wp.int32),
    ) -> None:
        i = wp.tid()
        pose = surfaces.pose_of(surface, position[i], attitude[i], velocity[i], omega[i])
        found = prints.footprint_of(surface, plate, window, pose, dt)
        rings[i] = wp.max(0, found.last_closing - found.first_closing + 1)

    kernel, window = variant.kernel(count), Window()
    surface = surface_of(Surface, arrays.core, arrays.rings, arrays.azimuths, put)
    window.thickness, window.per_cell = campaign.plate.thickness, 1.0 / arrays.grid.spacing
    counts = []
    for rows in trace(campaign.scene, shots, numerics=numerics):
        history = History.from_trace(rows[:-1], campaign.core.mass_properties)  # the last row is the end
        moved = (history.velocity, history.angular_velocity)
        pose = [put(history.position, wp.vec3), put(history.attitude, wp.quat), *(put(one, wp.vec3) for one in moved)]
        rings = wp.empty(len(history.time), dtype=wp.int32, device="cpu")
        dt = float(history.time[1] - history.time[0])
        wp.launch(kernel, len(rings), inputs=[surface, Plate(), window, dt, *pose], outputs=[rings], device="cpu")
        counts.append(rings.numpy())
    return np.concatenate(counts)


def predicted(work: Any, rings_listed: NDArray[np.int_], arrays: Any, side: int) -> dict[str, float]:
    """Counts per hit, and the hits per second that each limit of the device allows.

    Args:
        rings_listed: at every step of all HITS.
        side: of the window [nodes].
    """
    around, rings = arrays.resolution.patches_around, len(arrays.rings.station)
    listed_patches = around * float(rings_listed.sum()) / HITS
    rounds = float(np.ceil(around * rings_listed / LANES).sum()) / HITS  # of a lane over the patches
    rows = 2.0 * arrays.core.max_radius / arrays.grid.spacing + 4.0 + 2.0 * arrays.grid.reach
    nodes = rows * side
    per_step = SERIAL + FOOTPRINT * math.ceil(rings / LANES) + NODE * nodes / LANES
    repeated = SETUP + work.steps * SERIAL + COARSEST * listed_patches / around
    instructions = SETUP + work.steps * per_step + COARSEST * listed_patches / around
    instructions += rounds * (FIND + MEET + EXPOSE + SUM)
    shared = work.steps * nodes * NODE_WORDS + listed_patches * GATHER_WORDS + work.patches_in_contact * SCATTER_WORDS
    shared, touches = 4.0 * shared, 4.0 * listed_patches * WORDS
    scattered = SECTOR * (listed_patches * STREAMS)
    blocks = min(BLOCKS, REGISTER_FILE // (REGISTERS * LANES), SHARED_MEMORY // (SHARED + RESERVED))
    rates = {
        f"hits_per_second_at_{cycles:g}_cycles": MULTIPROCESSORS
        * CLOCK
        * min(SCHEDULERS, blocks / cycles)
        / instructions
        for cycles in CYCLES
    }
    return {
        "steps": work.steps,
        "patches_listed": listed_patches / work.steps,
        "rounds": rounds / work.steps,
        "share_of_lanes_used": listed_patches / (LANES * rounds),
        "warp_instructions": instructions,
        "share_that_every_lane_repeats": repeated / instructions,
        "share_of_the_filter": work.steps * NODE * nodes / LANES / instructions,
        "shared_memory_bytes": shared,
        "coalesced_bytes": touches,
        "bytes_of_the_simple_layout_uncoalesced": scattered,
        "blocks_per_multiprocessor": blocks,
        **rates,
        "limit_of_instructions": MULTIPROCESSORS * SCHEDULERS * CLOCK / instructions,
        "limit_of_arithmetic": FP32 / work.operations,
        "limit_of_shared_memory": SHARED_RATE / shared,
        "limit_of_L2": L2_RATE / touches,
        "limit_of_the_simple_layout_by_memory": MEMORY_RATE / scattered,
        "steps_in_a_row_seconds_per_hit": instructions * CYCLES[1] / CLOCK,
    }


if __name__ == "__main__":
    sys.exit(main())
