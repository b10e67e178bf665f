"""What the block layout should reach on a CUDA device that nobody has: its instructions and bytes per hit, counted.

    python tests/benchmarks/gpu_prediction.py      # writes results/gpu_prediction.json; needs no CUDA device

Steps, rings and patches are those of shots of the slotted plate on the CPU (floor.py). Instructions are those in the
loops of the block layout's kernel (Variant(window=2048)) in the machine code of sm_90, as ptxas 13.5 makes it and
nvdisasm shows it; a lane is taken to execute each of them once per round of its loop. The limits are those of an
H100 SXM by its data sheet. No figure here is a measurement.
"""

from __future__ import annotations

import math
import sys
from typing import Any

from bench import CAMPAIGN, machine, shots_of, store
from floor import contacts, work_of

from warpimpact import Campaign
from warpimpact.kernels.lanes import BLOCKS, LANES
from warpimpact.scene import Numerics
from warpimpact.solver.arrays import arrays_of
from warpimpact.solver.blocks import first_window

HITS = 64
# Instructions of a lane, per round.
SERIAL = 2950  # of a step: pose, statuses, butterflies, kick, drift; every lane does all of it
FOOTPRINT = 105  # per ring
FIND_RING, FIND_PATCH = 158 + 20, 305  # first pass: per ring, per patch
EXPOSE = 50  # per patch
SUM_RING, SUM_PATCH = 100, 147  # second pass
NODE = 5 + 9 + 10 + 7 + 6  # whole numbers to exposure; filter, two directions; half of it added; settled
SETUP = 6000  # of a shot: conditions, foremost point, clearing the window
# 4-byte words of shared memory per node and patch; of global memory per patch.
NODE_WORDS, GATHER_WORDS, SCATTER_WORDS = 2 + 3 + 4 + 5, 4, 8
TOUCH_WORDS, READ_WORDS = 8, 7
STREAMS = 2 * TOUCH_WORDS + 12
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
    arrays = arrays_of(campaign.scene, numerics, shots)
    work = work_of(campaign, shots, numerics)
    acting = sum(int(touching.any(axis=1).sum()) for _, touching in contacts(campaign, shots, numerics)) / HITS
    values = predicted(work, acting, arrays, first_window(arrays, shots))
    for name, value in values.items():
        print(f"{name.replace('_', ' '):45s} {value if isinstance(value, str) else format(value, '.3g')}")
    store("gpu_prediction", {"measured": False, "machine": machine(), **values})
    return 0


def predicted(work: Any, rings_in_contact: float, arrays: Any, side: int) -> dict[str, float]:
    """Counts per hit, and the hits per second that each limit of the device allows.

    Args:
        rings_in_contact: of a hit, summed over its steps.
        side: of the window [nodes].
    """
    around, rings = arrays.resolution.patches_around, len(arrays.rings.station)
    rounds = math.ceil(around / LANES)  # of a lane over the patches of a ring
    rings_in_slab = work.patches_in_slab / around
    rows = 2.0 * arrays.core.max_radius / arrays.grid.spacing + 4.0 + 2.0 * arrays.grid.reach
    nodes = rows * side
    per_step = SERIAL + FOOTPRINT * math.ceil(rings / LANES) + NODE * nodes / LANES
    instructions = (
        SETUP
        + work.steps * per_step
        + rings_in_slab * (FIND_RING + rounds * FIND_PATCH)
        + rings_in_contact * (SUM_RING + rounds * (EXPOSE + SUM_PATCH))
    )
    shared = 4.0 * (work.steps * nodes * NODE_WORDS + work.patches_in_contact * (GATHER_WORDS + SCATTER_WORDS))
    touches = 4.0 * (work.patches_in_slab * TOUCH_WORDS + work.patches_in_contact * READ_WORDS)
    scattered = SECTOR * (work.patches_in_slab * STREAMS)
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
        "rings_in_slab": rings_in_slab / work.steps,
        "rings_in_contact": rings_in_contact / work.steps,
        "warp_instructions": instructions,
        "share_that_every_lane_repeats": (work.steps * SERIAL + SETUP) / instructions,
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
