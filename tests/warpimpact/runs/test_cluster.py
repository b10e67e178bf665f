"""Runs on a cluster of worker processes: the bits of a local run, even if a worker is killed during the run."""

import os
import signal
from collections.abc import Callable, Iterator
from concurrent.futures import CancelledError
from pathlib import Path

import pytest

from warpimpact import Campaign
from warpimpact.cli import main
from warpimpact.errors import ClusterError, DeviceError
from warpimpact.runs.computer import _on_worker
from warpimpact.runs.options import RunOptions
from warpimpact.runs.run import RunProgress, run_to_file

from ...options import CPU
from ..slotted import slotted, slotted_text

distributed = pytest.importorskip("distributed")

SCATTER = (
    ('"825 m/s"  ', '{ distribution = "normal", mean = "825 m/s", std = "10 m/s" }  '),
    ('thickness = "4 mm"', 'thickness = { distribution = "uniform", low = "3.8 mm", high = "4.2 mm" }'),
    ('"4 g"  ', '{ distribution = "normal", mean = "4 g", std = "50 mg" }  '),
)
pytestmark = pytest.mark.usefixtures("small_chunks")


@pytest.fixture(scope="module")
def cluster() -> Iterator[object]:
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=None, silence_logs=50
    ) as running:
        yield running


@pytest.fixture(scope="module")
def campaign() -> Campaign:
    return slotted(*SCATTER, count=2000)


def test_a_killed_worker_costs_nothing(
    campaign: Campaign, cluster: object, tmp_path: Path, assert_same_bits: Callable[[Path, Path], None]
) -> None:
    with distributed.Client(cluster) as client:
        workers = client.run(os.getpid)
    assert len(set(workers.values())) == 2
    victim = next(iter(workers.values()))
    killed_at = []

    def kill_one(standing: RunProgress) -> None:
        if standing.saved >= 512 and not killed_at:
            os.kill(victim, signal.SIGKILL)
            killed_at.append(standing.done)

    output, local = tmp_path / "a.nc", tmp_path / "local.nc"
    run_to_file(campaign, output, options=RunOptions("cpu", scheduler=cluster.scheduler_address, progress=kill_one))
    assert killed_at
    assert killed_at[0] < 1500  # in mid-run
    with distributed.Client(cluster) as client:
        client.wait_for_workers(2, timeout=600)
        assert victim not in client.run(os.getpid).values()
    run_to_file(campaign, local, options=CPU)
    assert_same_bits(output, local)


def test_a_mistake_on_a_worker_is_reported_and_leaves_nothing(
    cluster: object, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    path = tmp_path / "campaign.toml"
    path.write_text(slotted_text(("count = 4096", "count = 300")), encoding="utf-8")
    command = ["run", str(path), "-o", str(tmp_path / "a.nc"), "--scheduler"]
    assert main([*command, cluster.scheduler_address, "--device", "cuda:99"]) == 2
    assert 'device: got "cuda:99", but this machine has no such device' in capsys.readouterr().err
    assert main([*command, "nonsense://nowhere"]) == 2
    assert 'scheduler: got "nonsense://nowhere", which cannot be reached' in capsys.readouterr().err
    assert [file.name for file in tmp_path.iterdir()] == ["campaign.toml"]


def test_workers_that_would_compute_other_bits_are_refused() -> None:
    kind = {"warpimpact_version": "0.0.0", "warp_version": "1", "device": "cpu"}
    with pytest.raises(DeviceError, match=r'the workers differ: warpimpact_version is "0.0.0" on one and'):
        _on_worker(print, "cpu", None, kind)


@pytest.mark.parametrize("request_", ["nthreads", None])
def test_a_lost_scheduler_is_reported_with_the_way_to_resume(
    request_: str | None, campaign: Campaign, cluster: object, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A client cancels what it waits for, and raises an error of connecting where it asks for anything."""

    def unreachable(*_: object, **__: object) -> None:
        raise OSError("Timed out trying to connect to tcp://127.0.0.1:1 after 20 s")

    def lose_it(_: RunProgress) -> None:
        if request_ is None:
            raise CancelledError
        monkeypatch.setattr(distributed.Client, request_, unreachable)

    output = tmp_path / "a.nc"
    with pytest.raises(ClusterError, match=r"was lost, perhaps killed; .* continue with --resume"):
        run_to_file(campaign, output, options=RunOptions("cpu", scheduler=cluster.scheduler_address, progress=lose_it))


def test_a_scheduler_without_workers_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("warpimpact.runs.computer.NO_WORKER_SECONDS", 0.1)

    def interrupt(sentence: str) -> None:
        assert "has no worker yet" in sentence
        raise KeyboardInterrupt

    with (
        distributed.LocalCluster(n_workers=0, dashboard_address="127.0.0.1:0") as empty,
        pytest.raises(KeyboardInterrupt),
        RunOptions("cpu", scheduler=empty.scheduler_address, warn=interrupt).computer(),
    ):
        pass
