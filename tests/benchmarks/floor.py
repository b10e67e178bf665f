"""The floor: what the consistent law asks for per patch and step, and how many of these a hit has (docs/model.md §4).

Counted from the formulas on the patches of rings that reach into the slab: each of them is looked at, those that
advance into the slab also act. An addition, product, comparison, root, quotient or exponential counts as one. Nothing
is counted for the motion (once per step), for the filter of the exposure, for laying the window, for addresses, nor
for rings outside the slab: a march can only be slower.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from warpimpact import Campaign, Numerics, Shots
from warpimpact.solver.history import History
from warpimpact.solver.resolution import resolve
from warpimpact.solver.rings import rings_of
from warpimpact.solver.simulate import trace

LOOK = 30
# Closing speed from what its ring and its azimuth share, 5; depth, 2; extents along the meridian, around and by motion,
# and their combination, 12; share in the slab at two faces, 8; share of full contact, 3.
ACT = 118
# Place and weights in the grid, 10; material and exposure read, 2 × 9; exposure shared out over four cells, 12; what is
# left of the resistance, 2; normal and sliding velocity, 27; its size, 6; traction, 13; force and moment, sums, 30.
LOOK_BYTES, ACT_BYTES = 8, 64
# Cosine and sine; four nodes of material and of exposure read, and four of exposure gained read and written. What a hit
# needs of them, a window of some 10 kB and a tile of some 30 kB, lies in the fastest caches all along: from memory come
# its inputs and outcomes alone, some 200 bytes.


@dataclass(frozen=True)
class Work:
    """Of one hit, averaged over several; patches summed over the steps."""

    steps: float
    patches_in_slab: float
    patches_in_contact: float
    operations: float
    bytes: float


def work_of(campaign: Campaign, shots: Shots, numerics: Numerics) -> Work:
    """What the law asks for at one resolution, from the histories of the shots on the CPU."""
    core, plate = campaign.core, campaign.plate
    resolution = resolve(numerics, campaign.scene)
    rings = rings_of(core, resolution.patches_axial, resolution.patches_around, resolution.patch_width)
    azimuth = (np.arange(resolution.patches_around) + 0.5) * (2.0 * np.pi / resolution.patches_around)
    circle = np.stack([np.zeros_like(azimuth), np.cos(azimuth), np.sin(azimuth)], axis=1)
    area = np.hypot(rings.area_axial, rings.area_radial)
    outward = rings.area_radial / area
    arm = rings.radius[:, None, None] * circle
    arm[..., 0] += rings.station[:, None]
    normal = outward[:, None, None] * circle
    normal[..., 0] += (rings.area_axial / area)[:, None]
    slack = np.hypot(rings.half_axial, rings.half_radial)[:, None]

    steps, in_slab, in_contact = 0, 0, 0
    for rows in trace(campaign.scene, shots, numerics=numerics):
        history = History.from_trace(rows[:-1], core.mass_properties)  # the last row is the end
        steps += len(history.time)
        for position, attitude, velocity, omega in zip(
            history.position, history.attitude, history.velocity, history.angular_velocity, strict=True
        ):
            turn = Rotation.from_quat(attitude).as_matrix()
            depth = position[0] + arm @ turn[0]
            near = (depth > -slack) & (depth < plate.thickness + slack)
            speed = (velocity @ turn + np.cross(omega @ turn, arm)) * normal
            in_slab += resolution.patches_around * int(near.any(axis=1).sum())
            in_contact += int((near & (speed.sum(axis=-1) > 0.0)).sum())
    hits = len(shots)
    operations = (LOOK * in_slab + ACT * in_contact) / hits
    moved = (LOOK_BYTES * in_slab + ACT_BYTES * in_contact) / hits
    return Work(steps / hits, in_slab / hits, in_contact / hits, operations, moved)


def cpu_peak(cores: int) -> float:
    """float32 operations per second of some cores, if each has two 256-bit units for fused multiply-adds."""
    path = Path("/proc/cpuinfo")
    lines = path.read_text().splitlines() if path.exists() else []
    clocks = [float(line.split(":")[1]) * 1e6 for line in lines if line.startswith("cpu MHz")]
    return cores * 2 * 8 * 2 * max(clocks, default=float("nan"))
