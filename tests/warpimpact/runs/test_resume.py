"""Runs that are killed, stopped or run out of disk lose nothing: a resumed command ends with the bits of an undisturbed
one.
"""

import multiprocessing
import os
import random
import re
import shutil
import signal
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from warpimpact import Campaign, FastLaw
from warpimpact.campaign.inputs import first_difference
from warpimpact.cli import main
from warpimpact.errors import Interrupted, OutputError
from warpimpact.results import files
from warpimpact.runs import compute, store
from warpimpact.runs.compute import CHUNK_SECONDS, block_size, chunk_size, manifest
from warpimpact.runs.options import RunOptions, RunProgress
from warpimpact.runs.run import run, run_to_file
from warpimpact.runs.store import Chunks, Store
from warpimpact.solver.limit import PASSAGES
from warpimpact.solver.prepare import prepare

from ...options import CPU
from ..slotted import slotted_text

SameBits = Callable[[Path, Path], None]
COARSE = slotted_text(('fidelity = "draft"', "level = 0"))  # the first shot is computed at once
COUNT = 2000  # eight chunks, the last one short
KILLS = 2
LONG = "count = 1000000"  # minutes of computing, of which a test sees the first chunk
PATIENCE = 600.0
"""Until what must come is missing, however busy the machine [s]."""
HERE = Path(__file__).parents[1]
pytestmark = pytest.mark.usefixtures("small_chunks")
WARPIMPACT = (sys.executable, "-c", "import small_chunks; from warpimpact.cli import command; command()")


@pytest.fixture(scope="module")
def campaign_file(tmp_path_factory: pytest.TempPathFactory, small_chunks: None) -> Path:
    path = tmp_path_factory.mktemp("campaign") / "campaign.toml"
    path.write_text(COARSE.replace("count = 4096", f"count = {COUNT}"), encoding="utf-8")
    return path


@pytest.fixture(scope="module")
def campaign(campaign_file: Path) -> Campaign:
    return Campaign.from_toml(campaign_file)


@pytest.fixture(scope="module")
def undisturbed(campaign: Campaign, tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("undisturbed") / "a.nc"
    run_to_file(campaign, path, options=CPU)
    return path


@pytest.fixture
def finished(campaign: Campaign, undisturbed: Path, assert_same_bits: SameBits) -> Callable[..., None]:
    """A function that resumes a run in a file to its end, which has the bits of an undisturbed run."""

    def finished(output: Path, **how: object) -> None:
        run_to_file(campaign, Store(output, resume=True), options=RunOptions("cpu", **how))
        assert_same_bits(output, undisturbed)

    return finished


def wait_for_a_chunk(process: subprocess.Popen, output: Path) -> None:
    limit = time.monotonic() + PATIENCE
    while not _chunks(output):
        assert process.poll() is None
        assert time.monotonic() < limit
        time.sleep(0.05)


def test_runs_killed_at_any_moment_end_with_the_same_bits(
    campaign_file: Path, undisturbed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, assert_same_bits: SameBits
) -> None:
    # A server that has imported everything forks real processes; each saves the second of the imports.
    def command(path: Path) -> list[str]:
        return ["run", str(campaign_file), "-o", str(path), "--device", "cpu", "--resume"]

    monkeypatch.syspath_prepend(HERE)
    processes = multiprocessing.get_context("forkserver")
    processes.set_forkserver_preload(["small_chunks", "warpimpact.runs.run"])
    moments, output, kills, completed = random.Random(1), tmp_path / "a.nc", 0, 0

    def saved() -> int:
        with suppress(FileNotFoundError):  # a run that ends takes the folder away meanwhile
            return sum(path.match("chunk_*.nc") for path in map(Path, os.listdir(Store(output).folder)))
        return 0

    # The last kill, too, may come when the result is there and its chunks are not yet gone.
    while kills < KILLS or not output.exists() or Store(output).folder.exists():
        # Progress on the disk says when, whatever the speed: up to five chunks on, and a moment after.
        wanted, later = saved() + moments.randint(0, 5), moments.uniform(0.0, 0.05)
        program = f"import small_chunks; from warpimpact.cli import main; main({command(output)!r})"
        run_process = processes.Process(target=exec, args=(program,))
        run_process.start()
        while run_process.is_alive() and (kills >= KILLS or saved() < wanted):
            run_process.join(0.005)
        run_process.join(later)
        if run_process.is_alive():
            run_process.kill()
            run_process.join()
            kills += 1
        else:
            assert run_process.exitcode == 0
        if output.exists() and not (tmp_path / "a.nc.parts").exists():
            assert_same_bits(output, undisturbed)
            completed += 1
            if kills < KILLS:
                output.unlink()
    assert completed >= 1
    assert [path.name for path in tmp_path.iterdir()] == ["a.nc"]


def test_a_second_run_on_the_same_result_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    path, output = tmp_path / "long.toml", tmp_path / "a.nc"
    path.write_text(COARSE.replace("count = 4096", LONG), encoding="utf-8")
    command = ["run", str(path), "-o", str(output), "--device", "cpu"]
    with subprocess.Popen(
        [*WARPIMPACT, *command], env=os.environ | {"PYTHONPATH": str(HERE)}, stderr=subprocess.DEVNULL
    ) as first:
        try:
            wait_for_a_chunk(first, output)
            for manner in ("--resume", "--overwrite"):
                assert main([*command, manner]) == 2
                sentence = f"warpimpact: error: {output}: another run is writing it; wait for its end or name"
                assert capsys.readouterr().err.startswith(sentence)
            assert first.poll() is None
        finally:
            first.kill()
    assert (tmp_path / "a.nc.parts" / "lock").exists()  # a killed process cleans nothing up, but holds nothing
    assert main(["run", str(path), "-o", str(output), "--device", "cpu", "--count", "300", "--overwrite"]) == 0
    assert sorted(file.name for file in tmp_path.iterdir()) == ["a.nc", "long.toml"]


def test_a_kill_between_any_two_steps_on_the_disk_is_survived(
    campaign: Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, assert_same_bits: SameBits
) -> None:
    """The run is killed in turn before each call that changes a name on the disk."""
    output, steps = tmp_path / "a.nc", 0
    small = campaign.model_copy(update={"hits": campaign.hits.model_copy(update={"count": 300})})
    straight = tmp_path / "straight.nc"
    run_to_file(small, straight, options=CPU)

    class Killed(BaseException):
        pass

    while not (output.exists() and not (tmp_path / "a.nc.parts").exists()):
        left = steps

        def dying(original):
            def call(*arguments, **options):
                nonlocal left
                if left == 0:
                    raise Killed
                left -= 1
                return original(*arguments, **options)

            return call

        with monkeypatch.context() as patched:
            for name in ("replace", "rmdir", "unlink"):
                patched.setattr(os, name, dying(getattr(os, name)))
            patched.setattr(Chunks, "keep", lambda _: "")  # a killed process cleans nothing up
            try:
                run_to_file(small, Store(output, resume=True), options=CPU)
            except Killed:
                steps += 1
    assert steps >= 5
    assert_same_bits(output, straight)


def test_a_result_in_memory_has_the_same_bits(campaign: Campaign, undisturbed: Path) -> None:
    dataset, stored = run(campaign, options=CPU), files.read(undisturbed)
    assert dataset.sizes == stored.sizes
    for name in stored.variables:
        assert np.array_equal(dataset[name], stored[name], equal_nan=dataset[name].dtype.kind == "f")


def stopped_after(chunks: int, error: BaseException) -> object:
    """A progress function that interrupts the run."""

    def follow(standing: RunProgress) -> None:
        if standing.saved >= 256 * chunks:
            raise error

    return follow


@pytest.fixture
def broken_off(campaign: Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A result file whose run was interrupted, and once more while its chunks were saved."""
    output, keep, flush = tmp_path / "a.nc", Chunks.keep, Chunks._flush

    def interrupted(chunks: Chunks) -> None:
        os.kill(os.getpid(), signal.SIGINT)
        flush(chunks)

    def keeping(chunks: Chunks) -> str:
        patched.setattr(Chunks, "_flush", interrupted)
        return keep(chunks)

    with monkeypatch.context() as patched:
        patched.setattr(Chunks, "keep", keeping)
        with pytest.raises(Interrupted, match=r"^interrupted; what is computed is saved in .*a.nc.parts; continue"):
            run_to_file(campaign, output, options=RunOptions("cpu", progress=stopped_after(2, KeyboardInterrupt())))
    assert not output.exists()
    return output


def test_an_interrupted_run_is_neither_lost_nor_overwritten_by_accident(
    broken_off: Path, campaign: Campaign, finished: Callable[..., None]
) -> None:
    with pytest.raises(OutputError, match=r"contains an unfinished .* --resume or begin anew with --overwrite"):
        run_to_file(campaign, broken_off, options=CPU)
    standings: list[RunProgress] = []
    finished(broken_off, progress=standings.append)
    assert standings[0].resumed >= 256
    assert standings[-1].done == standings[-1].total == COUNT
    before = broken_off.stat()
    run_to_file(campaign, Store(broken_off, resume=True), options=CPU)  # a batch system that restarts what is complete
    assert broken_off.stat() == before
    more = Campaign.from_text(campaign.text, name="a", folder=Path(), count=2 * COUNT)
    with pytest.raises(OutputError, match="exists already, and --resume adds no hits to what is complete; name"):
        run_to_file(more, Store(broken_off, resume=True), options=CPU)


@pytest.mark.parametrize("level", [0, 3, 7])
@pytest.mark.parametrize("limited", [False, True])
def test_a_chunk_takes_a_second_of_a_core_whatever_the_count(campaign: Campaign, level: int, limited: bool) -> None:
    """It is a power of two that divides the hits between two looks of a stop rule."""
    numerics, passages = FastLaw(level=level), PASSAGES if limited else 1
    for count in (300, 60_000, 2**22):
        many = campaign.model_copy(update={"hits": campaign.hits.model_copy(update={"count": count})})
        size = chunk_size(many, numerics, "cpu", limited=limited)
        seconds = prepare(many.scene, many.sampler().shots(0, size), numerics).cost.seconds * passages
        assert size * seconds <= 2.0  # what an interrupt may lose
        assert block_size(many) % size == 0
        assert size == block_size(many) or 2 * size * seconds > CHUNK_SECONDS


def test_hits_do_not_depend_on_the_chunks(
    campaign: Campaign, undisturbed: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, assert_same_bits: SameBits
) -> None:
    monkeypatch.setattr(compute, "CHUNK_SECONDS", 1e-3)
    assert chunk_size(campaign, campaign.numerics, "cpu") < 64
    run_to_file(campaign, tmp_path / "a.nc", options=CPU)
    assert_same_bits(tmp_path / "a.nc", undisturbed)


def test_an_interrupt_before_the_first_hit_says_so(
    campaign: Campaign, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    output, piloted = tmp_path / "a.nc", campaign.model_copy(update={"numerics": FastLaw(fidelity="draft")})
    shots_of, hits = compute.shots_of, []

    def interrupted(*arguments: Any) -> Any:
        hits.append(arguments)
        raise KeyboardInterrupt

    monkeypatch.setattr(compute, "shots_of", interrupted)
    with pytest.raises(Interrupted, match=r"^interrupted; nothing is saved$"):
        run_to_file(campaign, output, options=CPU)
    words = r"^interrupted; no hit is saved yet, but their resolution is saved in .*a.nc.parts; continue with --resume$"
    with pytest.raises(Interrupted, match=words):
        run_to_file(piloted, output, options=CPU)
    assert len(hits) == 2
    monkeypatch.setattr(compute, "shots_of", shots_of)
    run_to_file(piloted, Store(output, resume=True), options=CPU)
    assert [path.name for path in tmp_path.iterdir()] == ["a.nc"]


def test_an_old_result_stays_until_the_new_one_is_complete(
    campaign: Campaign, tmp_path: Path, finished: Callable[..., None]
) -> None:
    output = tmp_path / "a.nc"
    output.write_text("old")
    with pytest.raises(Interrupted):
        run_to_file(
            campaign,
            Store(output, overwrite=True),
            options=RunOptions("cpu", progress=stopped_after(1, KeyboardInterrupt())),
        )
    assert output.read_text() == "old"
    finished(output)  # may replace it: the run that began was allowed to


@pytest.mark.parametrize(
    ("change", "difference"),
    [
        (("degradation = 0.8 ", "degradation = 0.7 "), "plate.degradation was 0.8 and is 0.7"),
        (('"825 m/s"', '{ distribution = "uniform", low = 824, high = 826 }'), "scatter.velocity was not given"),
    ],
)
def test_another_campaign_is_refused_with_the_difference(
    change: tuple[str, str], difference: str, broken_off: Path, campaign_file: Path, tmp_path: Path
) -> None:
    other = tmp_path / "other.toml"
    text = campaign_file.read_text(encoding="utf-8")
    assert change[0] in text
    other.write_text(text.replace(*change), encoding="utf-8")
    with pytest.raises(OutputError, match=rf"cannot be resumed: .*{difference}"):
        run_to_file(Campaign.from_toml(other), Store(broken_off, resume=True), options=CPU)
    assert list(tmp_path.glob("a.nc.parts/chunk_*.nc"))


def test_a_file_that_the_campaign_names_counts_by_its_contents(tmp_path: Path) -> None:
    head, tail = COARSE.split("[hits]")
    text = f'{head}[hits]\nsampling = "list"\nfile = "hits.csv"\n\n[numerics]{tail.split("[numerics]")[1]}'
    for folder, row in (("a", "0.001,0.002"), ("b", "0.001,0.002"), ("c", "0.001,0.003")):
        (tmp_path / folder).mkdir()
        (tmp_path / folder / "campaign.toml").write_text(text, encoding="utf-8")
        (tmp_path / folder / "hits.csv").write_text(f"hit_y,hit_z\n{row}\n", encoding="utf-8")
    a, b, c = (manifest(Campaign.from_toml(tmp_path / f / "campaign.toml")) for f in "abc")
    assert first_difference(a, b) is None
    assert first_difference(a, c)[0] == "hits.file"
    assert first_difference(a, a | {"device": "cpu"}) == ("device", "not given", '"cpu"')


def _chunks(output: Path) -> list[Path]:
    return sorted(Store(output).folder.glob("chunk_*.nc"))


@pytest.mark.filterwarnings("error")
def test_damaged_chunks_are_computed_again(campaign: Campaign, tmp_path: Path, finished: Callable[..., None]) -> None:
    """Two with the bytes of another, one with a flipped bit, and a truncated one."""
    output = tmp_path / "a.nc"
    with pytest.raises(Interrupted):
        run_to_file(campaign, output, options=RunOptions("cpu", progress=stopped_after(5, KeyboardInterrupt())))
    saved = _chunks(output)
    first, second, third, fourth = (path.read_bytes() for path in saved[:4])
    damaged = second, first, third[:5000] + bytes([third[5000] ^ 1]) + third[5001:], fourth[:1000]
    for path, content in zip(saved, damaged, strict=False):
        path.write_bytes(content)
    warnings: list[str] = []
    standings: list[RunProgress] = []
    finished(output, warn=warnings.append, progress=standings.append)
    assert len(warnings) == 4
    assert all(sentence.endswith("damaged; computed again") for sentence in warnings)
    assert standings[0].resumed == min(256 * len(saved), COUNT) - 256 * 4
    assert not Store(output).folder.exists()


def _with_files_up_to(size: int, *command: str) -> subprocess.CompletedProcess[str]:
    """Run warpimpact where no file may grow beyond `size`: the system refuses to write, as on a full disk."""

    limit = (
        f"signal.signal(signal.SIGXFSZ, signal.SIG_IGN); resource.setrlimit(resource.RLIMIT_FSIZE, ({size}, {size}))"
    )
    return subprocess.run(
        [*_after(limit), *WARPIMPACT, *command],
        env=os.environ | {"PYTHONPATH": str(HERE), "PYTHONDONTWRITEBYTECODE": "1"},  # it would be cut, and kept
        capture_output=True,
        text=True,
        check=False,
    )


def _after(setting: str) -> list[str]:
    """A command that first changes a setting of its process. A preexec_fn sometimes hangs if there are threads."""
    return [sys.executable, "-c", f"import os, resource, signal, sys; {setting}; os.execv(sys.argv[1], sys.argv[1:])"]


def test_a_disk_that_is_full_at_the_end_loses_nothing(
    campaign_file: Path, undisturbed: Path, tmp_path: Path, assert_same_bits: SameBits
) -> None:
    output = tmp_path / "a.nc"
    command = ("run", str(campaign_file), "-o", str(output), "--device", "cpu")
    # The kernels of this campaign are in Warp's cache: chunks fit, the whole file does not.
    done = _with_files_up_to(undisturbed.stat().st_size - 4096, *command)
    assert done.returncode == 2, done.stderr
    assert "a.nc: cannot be written" in done.stderr
    assert f"what is computed is saved in {output}.parts; continue with --resume" in done.stderr
    assert "Traceback" not in done.stderr
    assert not output.exists()
    assert main([*command, "--resume"]) == 0
    assert_same_bits(output, undisturbed)


@pytest.mark.parametrize(("size", "saved"), [(20_000, "; nothing is saved"), (100, "manifest.json: cannot be written")])
def test_a_disk_that_is_full_at_once_leaves_nothing(size: int, saved: str, campaign_file: Path, tmp_path: Path) -> None:
    output = tmp_path / "a.nc"
    done = _with_files_up_to(size, "run", str(campaign_file), "-o", str(output), "--device", "cpu")
    assert done.returncode == 2, done.stderr
    assert "cannot be written" in done.stderr
    assert saved in done.stderr
    assert "Traceback" not in done.stderr
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(("by", "where"), [(signal.SIGINT, ["--workers", "1"]), (signal.SIGTERM, [])])
def test_ctrl_c_stops_cleanly_and_says_how_to_resume(by: signal.Signals, where: list[str], tmp_path: Path) -> None:
    """A terminal sends Ctrl-C to all processes of the group; a batch system ends the first one."""
    path, output = tmp_path / "long.toml", tmp_path / "a.nc"
    path.write_text(COARSE.replace("count = 4096", LONG), encoding="utf-8")
    # A shell's background job ignores Ctrl-C.
    listen = _after("signal.signal(signal.SIGINT, signal.SIG_DFL)")
    command = [*listen, *WARPIMPACT, "run", str(path), "-o", str(output), "--device", "cpu", *where]
    with subprocess.Popen(
        command, env=os.environ | {"PYTHONPATH": str(HERE)}, stderr=subprocess.PIPE, text=True, start_new_session=True
    ) as process:
        wait_for_a_chunk(process, output)
        if by == signal.SIGINT:
            os.killpg(process.pid, by)
        else:
            process.send_signal(by)
        _, shown = process.communicate(timeout=PATIENCE)
    assert process.returncode == 130
    assert not output.exists()
    assert "Traceback" not in shown
    last = [line for line in shown.splitlines() if line.startswith("warpimpact: ")][-1]
    assert last.startswith("warpimpact: interrupted; ")
    assert last.endswith(f"saved in {output}.parts; continue with --resume")
    shutil.rmtree(f"{output}.parts")


FREED = """
import os, signal, time
from warpimpact import cli

class Freed:
    def __del__(self):
        os.kill(os.getpid(), signal.SIGTERM)
        time.sleep(0.01)

def while_it_runs(verbose):
    Freed()
    time.sleep(60)

cli.show_log = while_it_runs
cli.command()
"""


def test_an_interrupt_counts_while_an_object_is_freed() -> None:
    """Python drops exceptions there, and a run frees many arrays."""
    done = subprocess.run([sys.executable, "-c", FREED, "inspect", "a.nc"], capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "warpimpact: interrupted\n")


TARGET = """
title = "small"
core = { shape = "ogive", diameter = "6 mm", crh = 3.0, length = "27 mm", mass = "4 g" }
[impact]
velocity = "825 m/s"
[numerics]
level = 0
[output]
standoffs = ["130 mm"]
"""
HOLED = 'pattern = { shape = "circle", diameter = "5 mm", spacing = ["8 mm", "8 mm"] }\n'
PLATE = '[plate]\nthickness = "4 mm"\nresistance = "2.6 GPa"\n'
HITS = '[hits]\nsampling = "sobol"\ncount = {}\n'
CAMPAIGN = TARGET + PLATE + HOLED + HITS.format(160)
OF_THE_CALL = re.compile("history|time|second|cost")


def content(path: Path) -> dict[str, Any]:
    """All that a result holds, but for when and how fast it was computed."""
    actual: dict[str, Any] = {}
    for place, dataset in xarray.open_groups(path, engine="netcdf4").items():  # a reference has hits of its own
        values = {name: of.values.tolist() for name, of in dataset.load().variables.items()} | dataset.attrs
        dataset.close()
        actual |= {f"{place}/{name}": str(value) for name, value in values.items() if not OF_THE_CALL.search(name)}
    return actual


def test_resumed_limits_equal_undisturbed_ones(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C comes once two chunks are on the disk."""
    monkeypatch.setattr(compute, "FEWEST", 64)
    monkeypatch.setattr(store, "HELD_SECONDS", 0.0)
    file, straight, output = (tmp_path / part for part in ("limit.toml", "straight.nc", "resumed.nc"))
    file.write_text(CAMPAIGN, encoding="utf-8")

    def called(path: Path, *options: str) -> int:
        return main(["limit", str(file), "-o", str(path), "--device", "cpu", "-q", "--tolerance", "60 m/s", *options])

    assert called(straight) == 0
    left, original = 2, Chunks.save

    def save(self: Chunks, *arguments: Any) -> None:
        nonlocal left
        original(self, *arguments)
        left -= 1
        if left == 0:
            raise KeyboardInterrupt

    monkeypatch.setattr(Chunks, "save", save)
    assert called(output) == 130
    assert not output.exists()
    assert called(output, "--resume") == 0
    assert content(output) == content(straight)
