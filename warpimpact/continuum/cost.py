"""What hits by finite elements will take, before anything is meshed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from warpimpact.continuum.meshing import SLOWEST, Encounter, encounters_of
from warpimpact.continuum.one_hit import CONTACT_BYTES, CONTACT_NODE_BYTES, NODE_NUMBERS, Start, start_of
from warpimpact.continuum.pictures import FRAME_BYTES, MOST_FRAMES
from warpimpact.errors import TooLong
from warpimpact.kernels.continuum import choices
from warpimpact.scene import Scene, Shots
from warpimpact.scene.bullet import Bullet
from warpimpact.scene.flow import Flow
from warpimpact.scene.model import Array
from warpimpact.scene.units import count_text, duration_text
from warpimpact.solver.device import free_memory
from warpimpact.solver.memory import MEMORY_SHARE
from warpimpact.solver.prepare import Cost

STEP, PER_ELEMENT, HOST_BYTES = 0.13, 3.0e-8, 150
"""Usual step, in times of a wave across a fine element at rest; time of a core per element and step [s]; and memory of
a node while its mesh is made, beside the arrays of the march [bytes]. Measured on elements of 0.5 to 1.2 mm."""
CONTACT = 1.0, 1.5, 2.1
"""Time of a hit over that of its elements alone, by how many bodies of elements fly: jacket and filler, and a core."""
STOPPED_SPEED_SHARE, TUMBLE_SECONDS, DEPTHS = 0.1, 1e-4, 600
"""Share of its speed at which a core counts as stopped, for how long it then tumbles in holes or between layers [s],
and depths at which its way is followed. In 48 of 51 runs elements × steps were foreseen within a factor of two."""
MOST_SECONDS = 7200.0
"""Most time of a core that a hit may take on a CPU [s]."""
ANNOUNCED_SECONDS, ANNOUNCED_BYTES = 20.0, 2**28
"""Time and memory of a hit from which they are announced."""


@dataclass(frozen=True)
class MeshCost(Cost):
    """What some hits take: time of a core of the mean one [s], memory of the largest one [bytes].

    Attributes:
        elements: of the largest one.
        work: elements × steps of the mean one.
        spacing: of the smallest elements [m].
    """

    elements: int
    work: float
    spacing: float

    def check(self, threads: int) -> str:
        """The cost in words; empty if it is little.

        Args:
            threads: number of hits at a time.

        Raises:
            TooLong: a hit takes more than MOST_SECONDS.
            MemoryError: so many at a time take too much memory.
        """
        gigabyte = 2.0**30
        needed, allowed = threads * self.bytes / gigabyte, MEMORY_SHARE * free_memory() / gigabyte
        elements = f"a hit takes up to {self.elements:.2g} elements of {1e3 * self.spacing:.2g} mm"
        time = f"about {duration_text(self.seconds)} of one CPU core"
        if self.seconds > MOST_SECONDS:
            most = duration_text(MOST_SECONDS)
            raise TooLong(f"{elements} and {time}, but at most {most} are allowed; give larger elements (--element)")
        if needed > allowed:
            at_a_time = f"{count_text(threads, 'hit')} at a time take" if threads > 1 else "it takes"
            raise MemoryError(
                f"{elements}; {at_a_time} {needed:.2g} GiB, but {allowed:.2g} GiB are free for it; "
                "give larger elements (--element)"
            )
        if self.seconds < ANNOUNCED_SECONDS and self.bytes < ANNOUNCED_BYTES:
            return ""
        size = f"{self.bytes / gigabyte:.2g} GiB"
        return f"{elements}, {size} and {time}, several times as long if the bullet core tumbles"


def estimate_cost(
    scene: Scene,
    shots: Shots,
    spacings: Sequence[float],
    flows: Sequence[Flow],
    double: bool,
    bullet: Bullet | None,
    flying: Mapping[int, int],
) -> MeshCost:
    """The cost of some shots.

    Args:
        spacings, flows: size of the elements [m] and material of each layer.
        bullet: what is about the core.
        flying: nodes of its bodies, by PART_OF_BULLET and CORE.
    """
    nodes, work = [], []
    for number in range(len(shots)):
        start = start_of(scene, shots, number, 0.0, {}, bullet)
        encounters = encounters_of(scene, shots, number, spacings)
        own = np.array([one.nodes(*start.arriving) for one in encounters])
        step = min(STEP * one.spacing / flow.wave_speed for one, flow in zip(encounters, flows, strict=True))
        times = times_of(encounters, start)
        nodes.append(int(own.sum()) + sum(flying.values()))
        work.append(float(own @ times + sum(flying.values()) * times.max()) / step)
    host, mean = HOST_BYTES + (MOST_FRAMES + 1) * FRAME_BYTES, float(np.mean(work))
    size, most, bodies = (8 if double else 4) * NODE_NUMBERS + host, max(nodes), len(spacings) + len(flying)
    memory = most * (size + (bodies > 1) * CONTACT_NODE_BYTES) + (bodies > 1) * bodies * CONTACT_BYTES
    return MeshCost(PER_ELEMENT * CONTACT[len(flying)] * mean, memory, most, mean, min(spacings))


def times_of(encounters: list[Encounter], start: Start) -> Array:
    """For how long each layer will be marched [s]. A core goes straight on, and what it pushes aside resists by the
    layer's strength, as far as there is material where it crosses the layer."""
    core, behind, speed = encounters[0].core, choices.FREE_WAY.value, max(float(np.linalg.norm(start.velocity)), 1e-3)
    station = np.linspace(0.0, core.length, DEPTHS)
    section = np.pi * np.maximum.accumulate(np.asarray(core.radius(station))) ** 2
    disc = np.stack(np.meshgrid(*[np.linspace(-1.0, 1.0, 9)] * 2)).reshape(2, -1)
    disc = core.max_radius * disc[:, np.hypot(*disc) <= 1.0]
    depth, force = np.linspace(0.0, encounters[-1].rear + core.length + behind, DEPTHS), np.zeros(DEPTHS)
    for one in encounters:
        y, z = (one.place[k] + extent.middle + disc[k] for k, extent in enumerate(one.extents(*start.arriving)))
        front, rear = (np.interp(depth - face, station, section, left=0.0) for face in (one.front, one.rear))
        force += one.plate.resistance * np.mean(one.plate.is_solid(y, z)) * (front - rear)
    way = depth[1] * speed / max(float(start.velocity[0]), SLOWEST * speed)
    square, slow = speed**2 - 2.0 * way * np.cumsum(force) / start.body.mass, (STOPPED_SPEED_SHARE * speed) ** 2
    moving = ~np.logical_or.accumulate(square < slow)
    spent = np.where(moving, way / np.sqrt(np.maximum(square, slow)), 0.0)
    near = [(depth > one.front - behind) & (depth < one.rear + core.length + behind) for one in encounters]
    times = np.array(near) @ spent
    if not moving[-1] and (len(encounters) > 1 or encounters[0].plate.open_area > 0.0):
        times[max(k for k, one in enumerate(encounters) if one.front - behind <= depth[moving.sum()])] += TUMBLE_SECONDS
    return np.asarray(times)
