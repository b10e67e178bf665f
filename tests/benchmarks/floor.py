"""The floor: the operations of the consistent law per patch and step, and their number per hit (docs/model.md §4).

Operations are counted from the formulas, for the patches of rings that reach into the slab. Each of these patches is
examined; those that advance into the slab also act. An addition, product, comparison, root, quotient or exponential
counts as one. The count leaves out the motion (once per step), the filter of the exposure, the setup of the window,
addresses and rings outside the slab. So a march can only be slower.
"""

from __future__ import annotations

import time
from collections.abc import Iterator
from dataclasses import dataclass
from functools import cache

import numpy as np
import warp as wp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from warpimpact import Numerics, Scene, Shots
from warpimpact.kernels.variant import Variant
from warpimpact.solver.prepare import prepare
from warpimpact.solver.replay import History, trace

LOOK = 30
# Closing speed from what its ring and its azimuth share, 5; depth, 2; extents along the meridian, around and by motion,
# and their combination, 12; share in the slab at two faces, 8; share of full contact, 3.
ACT = 118
# Place and weights in the grid, 10; material and exposure read, 2 × 9; exposure shared out over four cells, 12; what is
# left of the resistance, 2; normal and sliding velocity, 27; its size, 6; traction, 13; force and moment, sums, 30.
LOOK_BYTES, ACT_BYTES = 8, 64
# Cosine and sine; four nodes of material and of exposure read, and four of exposure gained read and written. A hit
# needs a window of about 10 kB and a tile of about 30 kB, which stay in the fastest caches. Only its inputs and
# outcomes, about 200 bytes, come from memory.


@dataclass(frozen=True)
class Work:
    """Work of one hit, averaged over several hits; patches are summed over the steps."""

    steps: float
    patches_in_slab: float
    patches_in_contact: float
    operations: float
    bytes: float


def work_of(scene: Scene, shots: Shots, numerics: Numerics) -> Work:
    """Work of the law at one resolution, from the histories of the shots on the CPU."""
    around = prepare(scene, shots, numerics).resolution.patches_around
    steps, in_slab, in_contact = 0, 0, 0
    for slabs in contacts(scene, shots, numerics):
        steps += 1
        for near, acting in slabs:
            in_slab += around * int(near.any(axis=1).sum())
            in_contact += int(acting.sum())
    hits = len(shots)
    operations = (LOOK * in_slab + ACT * in_contact) / hits
    moved = (LOOK_BYTES * in_slab + ACT_BYTES * in_contact) / hits
    return Work(steps / hits, in_slab / hits, in_contact / hits, operations, moved)


def contacts(
    scene: Scene, shots: Shots, numerics: Numerics
) -> Iterator[list[tuple[NDArray[np.bool_], NDArray[np.bool_]]]]:
    """For every step of the shots, and every layer: the patches that reach into the slab, and those of them that
    advance, each of shape [rings, around]."""
    prepared = prepare(scene, shots, numerics)
    resolution, rings = prepared.resolution, prepared.surfaces[0].rings
    azimuth = (np.arange(resolution.patches_around) + 0.5) * (2.0 * np.pi / resolution.patches_around)
    circle = np.stack([np.zeros_like(azimuth), np.cos(azimuth), np.sin(azimuth)], axis=1)
    area = np.hypot(rings.area_axial, rings.area_radial)
    outward = rings.area_radial / area
    arm = rings.radius[:, None, None] * circle
    arm[..., 0] += rings.station[:, None]
    normal = outward[:, None, None] * circle
    normal[..., 0] += (rings.area_axial / area)[:, None]
    slack = np.hypot(rings.half_axial, rings.half_radial)[:, None]
    slabs = [(float(one.front[0]), float(one.front[0] + one.thickness[0])) for one in prepared.materials]
    for rows in trace(scene, shots, numerics=numerics):
        history = History.from_trace(rows[:-1], scene.core.mass_properties)  # the last row is the end
        for position, attitude, velocity, omega in zip(
            history.position, history.attitude, history.velocity, history.angular_velocity, strict=True
        ):
            turn = Rotation.from_quat(attitude).as_matrix()
            depth = position[0] + arm @ turn[0]
            advances = ((velocity @ turn + np.cross(omega @ turn, arm)) * normal).sum(axis=-1) > 0.0
            reached = [(depth > front - slack) & (depth < rear + slack) for front, rear in slabs]
            yield [(near, near & advances) for near in reached]


_LOOP = """
    typedef float lanes __attribute__((vector_size(64)));  // as many registers as the processor needs for it
    lanes sums[12];
    for (int k = 0; k < 12; ++k) sums[k] = (lanes){} + 0.01f * k;
    // The square keeps a compiler from joining two turns into one; the sums stay between -0.5 and 0.5.
    for (int turn = 0; turn < turns; ++turn)
        for (int k = 0; k < 12; ++k) sums[k] = sums[k] * sums[k] - 0.4f;
    float total = 0.0f;
    for (int k = 0; k < 12; ++k) for (int lane = 0; lane < 16; ++lane) total += sums[k][lane];
    return total;
"""
_TURNS, _PER_TURN, _RUNS = 4_000_000, 12 * 16 * 2, 5


@cache
def measured_peak() -> float:
    """float32 operations per second of one core, measured: independent multiply-adds in registers, each of which
    counts as two operations, by the compiler of the kernels. The best of some runs of processor time counts."""

    @wp.func_native(_LOOP)
    def chains(turns: wp.int32) -> wp.float32: ...

    def loop(turns: wp.int32, total: wp.array(dtype=wp.float32)):
        total[wp.tid()] = chains(turns)

    kernel, total = Variant().kernel(loop), wp.empty(1, dtype=wp.float32, device="cpu")

    def seconds(turns: int) -> float:
        begin = time.process_time()
        wp.launch(kernel, dim=1, inputs=[turns, total], device="cpu")
        return time.process_time() - begin

    seconds(1)  # compiles it
    return _TURNS * _PER_TURN / min(seconds(_TURNS) for _ in range(_RUNS))
