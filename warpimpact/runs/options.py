"""How something is computed: by what, how its progress is followed, and what ends it. No option changes a number."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace

import warp

from warpimpact.errors import DeviceError
from warpimpact.measures.measure import Measure
from warpimpact.records import attributes as attr
from warpimpact.runs.computer import Computer, dask_computer, made_by
from warpimpact.solver.device import NEVER, Cancel, find_device
from warpimpact.statistics.intervals import Estimate


@dataclass(frozen=True)
class RunProgress:
    """The progress of a computation.

    Attributes:
        done, total: numbers of shots, or of what else is counted; `total` is the most that a stop rule allows.
        saved: shots of whole chunks, which no interrupt loses; `done` also counts those of unfinished chunks.
        resumed: shots that an earlier run had computed.
        failed: shots whose computation failed.
        estimates: estimate of the quantity of a stop rule, when it looked last.
        piloting: whether the pilot is still running. No shot is done then.
        level: level that the pilot computes; None where unknown.
        point: name of what is computed, of several one after another, such as a point of a sweep.
        text: words on what is computed, or on how good it is so far.
    """

    done: int
    total: int
    saved: int = 0
    resumed: int = 0
    failed: int = 0
    estimates: dict[Measure, Estimate] = field(default_factory=dict)
    piloting: bool = False
    level: int | None = None
    point: str = ""
    text: str = ""


@dataclass(frozen=True)
class RunOptions:
    """By what a computation is computed, who follows it, and what ends it.

    Attributes:
        device: "auto" (every CUDA device if there is one, else the CPU), "cpu", "cuda:0", "cuda:0,cuda:1", …; or an
            open computer (`opened`).
        workers: number of processes of this machine, which share its cores. They need a main module that does nothing
            when it is imported.
        scheduler: address of a Dask scheduler whose workers compute.
        progress: called several times a second.
        cancel: ends the computation from another thread, with Cancelled.
        warn: called with a sentence, such as on damaged chunks, which are computed again.
    """

    device: str | Computer = "auto"
    workers: int | None = None
    scheduler: str | None = None
    progress: Callable[[RunProgress], object] = lambda now: None
    cancel: Cancel = NEVER
    warn: Callable[[str], object] = warnings.warn

    @contextmanager
    def computer(self) -> Iterator[Computer]:
        """Open what computes: the devices of this machine, or Dask. An open computer stays open.

        Raises:
            DeviceError: a device is absent, or devices are of different kinds, which compute different bits.
            ClusterError: Dask is not installed, or the scheduler cannot be reached or is lost.
        """
        if isinstance(self.device, Computer):
            yield self.device
        elif self.workers is not None or self.scheduler is not None:
            with dask_computer(self.device, self.workers, self.scheduler, self.warn) as cluster:
                yield cluster
        else:
            yield Computer(_devices(self.device), self.cancel)

    @contextmanager
    def opened(self) -> Iterator[RunOptions]:
        """The options with an open computer, for several computations one after another.

        Raises:
            DeviceError, ClusterError: as in `computer`.
        """
        with self.computer() as computer:
            yield replace(self, device=computer)

    def at(self, point: str) -> RunOptions:
        """The options for one of several computations, whose progress has its name."""
        return replace(self, progress=lambda now: self.progress(replace(now, point=point)))


def _devices(device: str) -> list[str]:
    """The devices of this machine that an option names."""
    devices = [str(find_device(name.strip())) for name in device.split(",")]
    if device == "auto" and devices != ["cpu"]:
        return [str(one) for one in warp.get_cuda_devices()]
    if len({made_by(name)[attr.DEVICE] for name in devices}) > 1:
        raise DeviceError(f'device: got "{device}", but these are of different kinds, which compute different bits')
    return devices
