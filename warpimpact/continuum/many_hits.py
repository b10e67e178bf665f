"""Many hits that march together on a device, by a thread for each node and each element of all.

The kernels are those of kernels/continuum/march_many.py.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.continuum.one_hit import STEPS, HitResult, OneHit
from warpimpact.kernels.continuum import march_many
from warpimpact.kernels.continuum.fields import PARTS, PIECE
from warpimpact.kernels.continuum.stages import Load, Motion
from warpimpact.kernels.status import RUNNING, WAITING
from warpimpact.solver.device import NEVER, Cancel, block_size, load
from warpimpact.solver.memory import MEMORY_SHARE, built
from warpimpact.solver.structs import filled

MOST = 256
"""Hits that march together at most: drafts of the slotted plate have 2.4 million elements then, some ten times as many
as a large GPU has threads at a time."""

CONTACT = ("bound", "expose", "enter", "choose", "touch", "react", "gather")
"""Stages of a step that hits with several bodies need."""


class ManyHits:
    """Hits of one device and one precision. Those that have ended stay as they are.

    The steps of `advance` are one graph on CUDA, which is captured again when a larger hit comes.
    """

    def __init__(self, hits: Sequence[OneHit]) -> None:
        self.device, self.struct = hits[0].device, hits[0].struct
        self.kernels = built(march_many, hits[0].variant)
        for kernel in self.kernels.values():
            load(kernel, self.device)
        count, room = len(hits), partial(wp.zeros, device=self.device)
        self._places: list[Any] = [None] * count  # with all arrays whose addresses the device has
        self._hits = room(count, dtype=self.struct.Hit)
        self._loads = room((count, PARTS), dtype=Load)
        self._motions = room((count, PARTS), dtype=Motion)
        self._crossings = room((count, PARTS), dtype=wp.float64)
        self._cylinders = room(count, dtype=self.struct.Cylinder)
        self._seen = room((count, 2), dtype=wp.int32)
        self._most = 0, 0, 0  # nodes, elements and bodies of a hit
        self._step: list[Any] = []
        self._graphs: dict[int, Any] = {}
        for place, hit in enumerate(hits):
            self.put(place, hit)

    def put(self, place: int, hit: OneHit) -> None:
        """Have a hit march at a place: that of one that has ended, whose arrays it lets go."""
        put, runs = partial(wp.array, device=self.device), (hit.mesh.node_runs, hit.mesh.runs)
        nodes, elements = (pieces_of(values.numpy().reshape(-1, 3)) for values in runs)
        own = filled(
            self.struct.Hit,
            node_pieces=put(nodes.ravel(), dtype=wp.int32),
            pieces=put(elements.ravel(), dtype=wp.int32),
            **{name: getattr(hit, name) for name in ("core", "limits", "mesh", "flights", "left")},
        )
        self._hits[place : place + 1].assign(put([own], dtype=self.struct.Hit))
        self._places[place] = own
        own_most = PIECE * len(nodes), PIECE * len(elements), len(hit.meshes)
        most = tuple(map(max, self._most, own_most))
        if most != self._most:
            self._most = most
            self._step, self._graphs = self._launches(), {}

    def _launches(self) -> list[Any]:
        """Those of a step, recorded."""
        count, hits, (nodes, elements, bodies) = len(self._places), self._hits, self._most
        parts = count, PARTS
        step: dict[str, tuple[Any, list[Any]]] = {
            "press": (parts, [hits, self._loads]),
            "bound": ((count, bodies), [hits]),
            "expose": ((count, elements), [hits]),
            "enter": (parts, [hits]),
            "choose": ((count, nodes), [hits]),
            "touch": (parts, [hits]),
            "react": (parts, [hits]),
            "push": (count, [hits, self._loads, self._cylinders]),
            "move": ((count, nodes), [hits, self._cylinders]),
            "gather": (parts, [hits, self._motions]),
            "deform": ((count, elements), [hits]),
            "cross": (parts, [hits, self._crossings]),
            "step": (count, [hits, self._motions, self._crossings]),
        }
        if bodies < 2:
            step = {name: launch for name, launch in step.items() if name not in CONTACT}
        return [self._launch(name, *launch, record_cmd=True) for name, launch in step.items()]

    def _launch(self, name: str, dim: Any, inputs: list[Any], **how: Any) -> Any:
        kernel = self.kernels[name]
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
        self._launch("look", (len(self._places), PARTS), [self._hits, self._seen])
        return np.array(self._seen.numpy())


def pieces_of(runs: NDArray[np.int32]) -> NDArray[np.int32]:
    """First number and block of each piece of some runs, shape [pieces, 2]; the runs as in the kernels' Mesh, shape
    [runs, 3]."""
    counts = (runs[:, 1] - runs[:, 0]) // PIECE
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.stack([np.repeat(runs[:, 0], counts) + PIECE * within, np.repeat(runs[:, 2], counts)], axis=1)


def together(
    hits: Iterable[OneHit], cancel: Cancel = NEVER, follow: Callable[[int, OneHit], object] = lambda number, hit: None
) -> Iterator[tuple[int, HitResult]]:
    """What became of hits that march together on their device, with their numbers, as they end.

    Args:
        hits: of one device and one precision; as many march at a time as fit half of the free memory of a GPU, but at
            most MOST. The next one takes the place of one that has ended.
        follow: called with the number of a hit, and the hit, before it marches and after each launch.
    """
    coming, first = enumerate(hits), list[tuple[int, OneHit]]()
    for number, hit in coming:
        first.append((number, hit))
        follow(number, hit)
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
        for number, hit in running.values():
            hit.part()
            follow(number, hit)
        for place, (status, at_edge) in enumerate(many.look()):
            if place in running and status == WAITING and not at_edge:
                many.put(place, running[place][1].extend())
            elif place in running and (status != RUNNING or at_edge):
                number, hit = running.pop(place)
                yield number, hit.result(bool(at_edge))
                if one := next(coming, None):
                    follow(*one)
                    running[place] = one
                    many.put(place, one[1])
