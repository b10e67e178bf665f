"""Many hits that march together on one device, by a thread for each node and each element of all
(kernels/continuum/abreast.py)."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import partial
from typing import Any, TypeVar

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.continuum.one_hit import STEPS, OneHit, built
from warpimpact.kernels.continuum import abreast
from warpimpact.kernels.continuum.fields import PIECE
from warpimpact.kernels.status import RUNNING, WAITING
from warpimpact.solver.device import block_size, load
from warpimpact.solver.memory import MEMORY_SHARE
from warpimpact.solver.worker import NEVER, Cancel

MOST = 256
"""Hits that march together at most: drafts of the slotted plate have 2.4 million elements then, some ten times as many
as a large GPU has threads at a time."""
Key = TypeVar("Key")


class ManyHits:
    """Hits of one device and one precision. Those that have ended stay as they are.

    The steps of `advance` are one graph on CUDA, which is captured again when a larger hit comes.
    """

    def __init__(self, hits: Sequence[OneHit]) -> None:
        self.device, variant = hits[0].device, hits[0].variant
        self.stage = built(abreast, variant)
        for kernel in vars(self.stage.kernels).values():
            load(kernel, self.device)
        count, room = len(hits), partial(wp.zeros, device=self.device)
        self._places: list[Any] = [None] * count  # with all arrays whose addresses the device has
        self._hits = room(count, dtype=self.stage.struct.Hit)
        self._loads = room((count, abreast.PARTS), dtype=self.stage.Load)
        self._crossings = room((count, abreast.PARTS), dtype=variant.real)
        self._cylinders = room(count, dtype=self.stage.struct.Cylinder)
        self._seen = room((count, 2), dtype=wp.int32)
        self._most = 0, 0  # nodes and elements of a hit
        self._step: list[Any] = []
        self._graphs: dict[int, Any] = {}
        for place, hit in enumerate(hits):
            self.put(place, hit)

    def put(self, place: int, hit: OneHit) -> None:
        """Have a hit march at a place: that of one that has ended, whose arrays it lets go."""
        filled, mesh = self.stage.struct.Hit(), hit.mesh
        filled.core, filled.limits, filled.mesh = hit.core, hit.limits, mesh
        filled.flights, filled.left = hit.flights, hit.left
        put = partial(wp.array, device=self.device)
        nodes, elements = (pieces_of(runs.numpy().reshape(-1, 3)) for runs in (mesh.node_runs, mesh.runs))
        filled.node_pieces, filled.pieces = (put(pieces.ravel(), dtype=wp.int32) for pieces in (nodes, elements))
        self._hits[place : place + 1].assign(put([filled], dtype=self.stage.struct.Hit))
        self._places[place] = filled
        most = max(self._most[0], PIECE * len(nodes)), max(self._most[1], PIECE * len(elements))
        if most != self._most:
            self._most = most
            self._step, self._graphs = self._launches(), {}

    def _launches(self) -> list[Any]:
        """Those of a step, recorded."""
        count, hits, (nodes, elements) = len(self._places), self._hits, self._most
        parts = count, abreast.PARTS
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
        self._launch("look", (len(self._places), abreast.PARTS), [self._hits, self._seen])
        return np.array(self._seen.numpy())


def pieces_of(runs: NDArray[np.int32]) -> NDArray[np.int32]:
    """First number and sheet of each piece of some runs, shape [pieces, 2]; the runs as in the kernels' Mesh, shape
    [runs, 3]."""
    counts = (runs[:, 1] - runs[:, 0]) // PIECE
    within = np.arange(counts.sum()) - np.repeat(np.cumsum(counts) - counts, counts)
    return np.stack([np.repeat(runs[:, 0], counts) + PIECE * within, np.repeat(runs[:, 2], counts)], axis=1)


def ended(
    coming: Iterable[tuple[Key, OneHit]], extended: Callable[[Key], OneHit], cancel: Cancel = NEVER
) -> Iterator[tuple[Key, bool]]:
    """The key of each hit when it has ended, and whether its core had come near the outer edge of a mesh. The next hit
    takes its place.

    Args:
        coming: hits of one device and one precision, with their keys; as many march at a time as fit half of the free
            memory of a GPU, but at most MOST.
        extended: gives the next layer of a hit its mesh.
    """
    keyed, running, hits = iter(coming), dict[int, Key](), list[OneHit]()
    while len(hits) < MOST and _has_room(hits) and (one := next(keyed, None)) is not None:
        running[len(hits)] = one[0]
        hits.append(one[1])
    if not hits:
        return
    many = ManyHits(hits)
    del hits  # ended hits make room
    while running:
        cancel.check()
        many.advance()
        for place, (status, at_edge) in enumerate(many.look()):
            if place in running and status == WAITING and not at_edge:
                many.put(place, extended(running[place]))
            elif place in running and (status != RUNNING or at_edge):
                yield running.pop(place), bool(at_edge)
                if (one := next(keyed, None)) is not None:
                    running[place] = one[0]
                    many.put(place, one[1])


def _has_room(hits: list[OneHit]) -> bool:
    """Whether one more hit like the largest of some fits beside them: on CUDA, in a share of what is free without
    them."""
    if not hits or hits[0].device.is_cpu:
        return True
    sizes = [hit.bytes for hit in hits]
    return sum(sizes) + max(sizes) <= MEMORY_SHARE * (int(hits[0].device.free_memory) + sum(sizes))
