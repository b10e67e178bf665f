"""Who computes the shards of a campaign: the devices of this machine, or the workers of a Dask cluster."""

from __future__ import annotations

import logging
import math
import signal
import threading
import time
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError, Future, ThreadPoolExecutor, wait
from contextlib import ExitStack, contextmanager
from dataclasses import asdict, dataclass
from queue import SimpleQueue
from typing import Any, NamedTuple
from uuid import uuid4

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.compute import HitMap, made_by
from warpimpact.results import attributes as attr
from warpimpact.results.interrupts import stop_if_asked
from warpimpact.results.table import Table
from warpimpact.scene import Shots
from warpimpact.solver.device import DeviceError, cores, find_device
from warpimpact.solver.refinement import Refining

CUDA_SHOTS = 2**17
"""Shots per task on a GPU, which fewer would not fill."""
CPU_SHOTS, CPU_SECONDS = 2**14, 0.5
"""Most shots of a task on the CPU of this machine, and the time that it is to take: its set-up, on one core, is lost in
that. It is one shard at least, and one shard on the worker of a cluster."""
_HIT_MAP = HitMap()


LONELY = 120.0
"""Seconds for which a scheduler may be without workers."""
_PATIENCE = 1.0
"""Seconds for which a team waits for computations that nobody wants any more: what a thread of this machine computes
can be broken off between two launches of a kernel only."""


_LISTEN_EVERY, _TELL_EVERY = 0.2, 1.0
"""Seconds between two looks for a signal while a worker prepares, and between two words of a task on its levels."""


class ClusterError(RuntimeError):
    """A cluster that cannot be used; the message is for a person."""


@dataclass(frozen=True)
class Team:
    """Computes shots in the background.

    Attributes:
        job: what is computed of every hit.
        pilot: finds the promise of the campaign in the background, None if it fixes the resolution itself.
        submit: hands over the promise, shots, and those of them that the solid reference takes, too; their Table
            comes in the future.
        width: tells how many tasks to keep under way: as many as compute, and as many that wait.
        task: shots per task, for a rate of shots per second; 0 where that is not known yet.
        made_by: versions, kind of device and the job's content, which decide the bits.
        underway: how many shots of unfinished tasks are done.
        refining: the task that has the longest way to its tolerance, None if there is none or it is not known.
    """

    job: HitMap
    pilot: Callable[[], Future[Any]]
    submit: Callable[[Any, Shots, Shots | None], Future[Table]]
    width: Callable[[], int]
    task: Callable[[float], int]
    made_by: dict[str, str]
    underway: Callable[[], int]
    refining: Callable[[], Refining | None]


class _How(NamedTuple):
    """How the workers of a cluster compute.

    Attributes:
        device, threads: as in `simulate`.
        kind: what all of them must be, as `made_by` says.
        topic: of what they tell of their levels; empty where hits have no tolerance.
    """

    device: str
    threads: int | None
    kind: dict[str, str]
    topic: str = ""


def awaited(future: Future[Any], every: float, tick: Callable[[], object]) -> Any:
    """The result of a future. Meanwhile `tick` is called every so many seconds, and a signal that came stops it all."""
    while not wait([future], timeout=every).done:
        stop_if_asked()
        tick()
    return future.result()


@contextmanager
def local_team(campaign: Campaign, device: str, job: HitMap = _HIT_MAP) -> Iterator[Team]:
    """The devices of this machine, each computing one task at a time.

    Args:
        device: "auto" (every CUDA device if there is one, else the CPU), or names with commas between them.
        job: what to compute of every hit.

    Raises:
        DeviceError: a device is absent, or they are of different kinds, which compute different bits.
    """
    devices = _devices(device)
    idle, done, stopping = SimpleQueue[str](), dict[int, int](), threading.Event()
    levels, begun = dict[int, Refining](), list[Future[Any]]()
    for chosen in devices:
        idle.put(str(chosen))

    def progress(finished: int, total: int) -> None:
        if stopping.is_set():
            raise InterruptedError
        done[threading.get_ident()] = finished

    def work(promise: Any, shots: Shots, solid: Shots | None) -> Table:
        name = idle.get()
        try:
            return job.compute(
                campaign,
                shots,
                promise=promise,
                solid=solid,
                device=name,
                progress=progress,
                refining=lambda found: levels.update({threading.get_ident(): found}),
            )
        finally:
            done[threading.get_ident()] = 0
            levels.pop(threading.get_ident(), None)
            idle.put(name)

    def begin(task: Callable[..., Any], *arguments: Any) -> Future[Any]:
        begun[:] = [future for future in begun if not future.done()]
        begun.append(pool.submit(task, *arguments))
        return begun[-1]

    pool, kind = ThreadPoolExecutor(len(devices)), made_by(str(devices[0]))
    try:
        yield Team(
            job=job,
            pilot=lambda: begin(job.promise_of, campaign, str(devices[0]), progress),
            submit=lambda *shots: begin(work, *shots),
            width=lambda: 2 * len(devices),
            task=lambda rate: _task_size(kind) or min(CPU_SHOTS, int(CPU_SECONDS * rate)),
            made_by=kind | dict(job.content),
            underway=lambda: sum(done.copy().values()),
            refining=lambda: _longest(levels),
        )
    finally:
        stopping.set()
        pool.shutdown(wait=False, cancel_futures=True)
        wait([future for future in begun if not future.cancelled()], timeout=_PATIENCE)


def _task_size(kind: dict[str, str]) -> int:
    """Shots per task; 0 where the rate decides."""
    return 0 if kind[attr.DEVICE] == "cpu" else CUDA_SHOTS


@contextmanager
def cluster_team(
    campaign: Campaign,
    *,
    address: str | None = None,
    workers: int | None = None,
    device: str = "auto",
    job: HitMap = _HIT_MAP,
) -> Iterator[Team]:
    """The workers of a Dask cluster; what one that dies was computing goes to another.

    Args:
        address: of a scheduler.
        workers: processes to start on this machine, where there is no address.
        device: that every worker computes on.
        job: what to compute of every hit.

    Raises:
        ClusterError: dask is not installed, the scheduler cannot be reached or is lost, or shots kill one worker after
            another.
        DeviceError: the workers lack the device, or compute other bits than the first one asked.
    """
    try:
        from distributed import Client, KilledWorker, LocalCluster, WorkerPlugin
        from distributed.comm import CommClosedError
        from distributed.utils import silence_logging_cmgr
    except ImportError:
        raise ClusterError("a cluster needs Dask: pip install 'warpimpact[cluster]'") from None
    with ExitStack() as stack:
        stack.enter_context(silence_logging_cmgr(logging.CRITICAL))  # a lost scheduler gets our sentence, no traceback
        threads = None
        if address is None:
            assert workers is not None
            threads = max(1, cores() // workers)
            cluster = LocalCluster(
                n_workers=workers, threads_per_worker=1, dashboard_address="127.0.0.1:0", silence_logs=logging.CRITICAL
            )
            address = stack.enter_context(cluster).scheduler_address
        try:
            # Not the default of its process, of which xarray takes the locks of the files that are written here.
            client = stack.enter_context(Client(address, timeout="20s", set_as_default=False))
        except (OSError, ValueError) as error:
            raise ClusterError(f'scheduler: got "{address}", which cannot be reached ({error})') from None
        if threads is not None:
            client.register_plugin(_ignoring_interrupts(WorkerPlugin))
        executor, levels = client.get_executor(pure=False), dict[str, Refining]()
        reached = _Reached(client, address)
        asked = reached.asked
        try:
            kind = awaited(asked(executor.submit, made_by, device), _LISTEN_EVERY, reached.threads)
            campaign = awaited(asked(executor.submit, _looked_at, campaign), _LISTEN_EVERY, reached.threads)
            how = _How(device, threads, kind, f"warpimpact-{uuid4().hex}" if campaign.numerics.tolerance else "")
            if how.topic:
                asked(client.subscribe_topic, how.topic, lambda event: _hear(levels, event[1]))
            yield Team(
                job=job,
                pilot=lambda: asked(executor.submit, job.promise_of, campaign, device),
                submit=lambda *shots: asked(executor.submit, _compute_alike, job, campaign, *shots, how),
                width=lambda: 2 * max(1, reached.threads()),
                task=lambda rate: _task_size(kind),
                made_by=kind | dict(job.content),
                underway=lambda: 0,
                refining=lambda: _longest(levels),
            )
        except (CommClosedError, CancelledError) as error:  # without its scheduler a client cancels what it waits for
            raise _lost(address, error) from None
        except KilledWorker as error:
            raise ClusterError(f"some shots ended one worker after another, perhaps out of memory: {error}") from None


class _Reached:
    """A scheduler that may be lost, or all of its workers.

    Raises:
        ClusterError: the scheduler is lost, or has had no worker for LONELY seconds.
    """

    def __init__(self, client: Any, address: str) -> None:
        self._client, self._address, self._seen = client, address, time.monotonic()

    def asked(self, request: Callable[..., Any], *arguments: Any) -> Any:
        """What a request to the scheduler returns."""
        from distributed.client import ClosedClientError

        try:
            return request(*arguments)
        except (OSError, ClosedClientError) as error:  # of the client: here no file is written
            raise _lost(self._address, error) from None

    def threads(self) -> int:
        """Of all workers."""
        count: int = sum(self.asked(self._client.nthreads).values())
        now = time.monotonic()
        if count:
            self._seen = now
        elif now - self._seen > LONELY:
            raise ClusterError(
                f"scheduler: {self._address} has had no worker for {LONELY:g} s; start some; what is computed is "
                "saved, continue with --resume"
            )
        return count


def _lost(address: str, error: BaseException) -> ClusterError:
    return ClusterError(
        f"scheduler: {address} was lost, perhaps killed ({type(error).__name__}); what is computed is saved, "
        "continue with --resume"
    )


def _ignoring_interrupts(plugin: Any) -> Any:
    """Plugin of workers on this machine, which Ctrl-C reaches, too: this process is the one that ends them."""

    def setup(self: Any, worker: Any) -> None:
        signal.signal(signal.SIGINT, signal.SIG_IGN)

    return type("Ignoring", (plugin,), {"setup": setup})()


def _compute_alike(
    job: HitMap,
    campaign: Campaign,
    promise: Any,
    shots: Shots,
    solid: Shots | None,
    how: _How,
) -> Table:
    """Compute shots on a worker that gives the same bits as the others."""
    own, kind = made_by(how.device), how.kind
    if own != kind:
        name = next(name for name in kind if own[name] != kind[name])
        raise DeviceError(
            f'the workers differ: {name} is "{kind[name]}" on one and "{own[name]}" on another; a run needs one kind'
        )
    with _telling(how.topic) as refining:
        given: dict[str, Any] = {"promise": promise, "solid": solid, "device": how.device, "threads": how.threads}
        return job.compute(campaign, shots, **given, refining=refining)


def _looked_at(campaign: Campaign) -> Campaign:
    """The campaign, which carries the ligament of its plate from then on: that of a mask takes seconds, and every shard
    tells it."""
    _ = campaign.plate.ligament
    return campaign


@contextmanager
def _telling(topic: str) -> Iterator[Callable[[Refining], None]]:
    """What tells those who listen to the topic how far the hits of a task of this worker are on their way to a
    tolerance; no topic, no word."""
    if not topic:
        yield lambda found: None
        return
    from distributed import get_worker

    worker, who, last = get_worker(), uuid4().hex, -math.inf

    def tell(found: Refining) -> None:
        nonlocal last
        if (now := time.monotonic()) - last >= _TELL_EVERY:
            last = now
            worker.log_event(topic, {"who": who, "refining": asdict(found)})

    try:
        yield tell
    finally:
        worker.log_event(topic, {"who": who, "refining": None})


def _hear(levels: dict[str, Refining], told: dict[str, Any]) -> None:
    """Take in what a worker has told."""
    if told["refining"] is None:
        levels.pop(told["who"], None)
    else:
        levels[told["who"]] = Refining(**told["refining"])


def _longest(levels: dict[Any, Refining]) -> Refining | None:
    """The one that has the longest way to go."""
    return max(levels.copy().values(), key=lambda one: one.seconds_left or 0.0, default=None)


def _devices(names: str) -> list[Any]:
    """The devices of some names with commas between them."""
    first = find_device(names.split(",")[0].strip())
    if names == "auto":
        import warp

        return [first] if first.is_cpu else list(warp.get_cuda_devices())
    devices = [first, *(find_device(name.strip()) for name in names.split(",")[1:])]
    if len({kind for chosen in devices if (kind := made_by(str(chosen))[attr.DEVICE])}) > 1:
        raise DeviceError(f'device: got "{names}", but these are of different kinds, which compute different bits')
    return devices
