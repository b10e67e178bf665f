"""Random campaigns that are signalled, killed, starved of disk, bereft of workers or scheduler and damaged, until each
result is there: are its bits those of an undisturbed run?

A round draws a campaign, computes it undisturbed, and then disturbs and resumes it until it is complete. Half of the
rounds compute on Dask workers: of the run itself, or of a scheduler of their own. A fault is counted if it befell a run
that was going on, a flipped bit if it is in a shard that a run left behind. The figures add up: a run goes on where the
file of figures ended. python tests/benchmarks/soak.py --minutes 60
"""

import argparse
import json
import os
import platform
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import netCDF4
import psutil

TOP = Path(__file__).parents[2]
FIGURES = Path(__file__).parent / "results" / "soak.json"
SCENE = (TOP / "campaigns" / "slotted_plate.toml").read_text(encoding="utf-8")
COMMAND = """
import resource, signal, sys
from warpimpact.runs import shards
shards.FEWEST = 256
shards.HELD = 0.1
signal.signal(signal.SIGINT, signal.default_int_handler)
if int(sys.argv[1]):
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
from warpimpact.cli import command
sys.argv[1:] = sys.argv[2:]
command()
"""
"""The command with small shards and, if the first argument is not 0, with a limit of the size of files."""
SIGNALS = ("SIGINT", "SIGTERM", "SIGKILL")
FAULTS = {
    "threads": (*SIGNALS, "disk limit"),
    "workers": (*SIGNALS, "worker killed", "worker killed", "disk limit"),
    "scheduler": ("scheduler killed", "scheduler killed", "worker killed", "SIGTERM"),
}
"""What befalls the runs of a round, by who computes."""
MOST_FAULTS = 8
"""Per round; the runs after that are left alone."""
LONGEST = 300.0
"""Seconds after which a run counts as hanging; those in which it waits for a core of the machine do not count."""
ENDS = {
    "none": {0},
    "SIGINT": {0, 130, -signal.SIGINT},
    "SIGTERM": {0, 130, -signal.SIGTERM},
    "SIGKILL": {0, -signal.SIGKILL},
    "disk limit": {0, 2},
    "worker killed": {0, 2},  # 2 if Dask starts no other one
    "scheduler killed": {0, 2},
}
"""Exit codes that a run may end with; before it listens to signals, the system ends it, and it may be done already."""


class Run(NamedTuple):
    """A run under way, and the file that takes what it says."""

    process: subprocess.Popen[bytes]
    folder: Path

    @property
    def said(self) -> str:
        return (self.folder / "said.txt").read_text(errors="replace")


def campaign(draw: random.Random) -> str:
    """A campaign of some seconds."""
    return (
        SCENE.replace('"standard"', '"draft"')
        .replace("count = 4096", f"count = {draw.choice([1000, 2000, 5000])}")
        .replace("seed = 1", f"seed = {draw.randrange(10**6)}")
        .replace('"825 m/s"', f'"{draw.randint(300, 900)} m/s"')
    )


def start(folder: Path, output: str, *options: str, limit: int = 0) -> Run:
    """A run of the campaign in a folder."""
    command = [sys.executable, "-c", COMMAND, str(limit), "run", "campaign.toml", "-o", output, "--device", "cpu"]
    with (folder / "said.txt").open("wb") as said:
        return Run(subprocess.Popen([*command, *options], cwd=folder, stdout=subprocess.DEVNULL, stderr=said), folder)


@contextmanager
def cluster(folder: Path) -> Iterator[subprocess.Popen[bytes]]:
    """A scheduler with two workers, in processes of their own."""
    file, module = folder / "scheduler.json", [sys.executable, "-m", "distributed.cli"]
    file.unlink(missing_ok=True)
    quiet: dict[str, Any] = {"stdout": subprocess.DEVNULL, "stderr": subprocess.DEVNULL, "cwd": folder}
    place = ["--host", "127.0.0.1", "--no-dashboard", "--scheduler-file", str(file)]
    module[-1] += ".dask_scheduler"
    scheduler = subprocess.Popen([*module, *place, "--port", "0"], **quiet)
    module[-1] = "distributed.cli.dask_worker"
    work = ["--nworkers", "2", "--nthreads", "1", "--death-timeout", "20"]
    workers = None
    try:
        wait_for(file.exists)
        workers = subprocess.Popen([*module, *place, *work], **quiet)
        yield scheduler
    finally:
        for process in filter(None, (workers, scheduler)):
            end(process)


def wait_for(happened: Any, longest: float = 60.0) -> bool:
    """Wait until something has happened; returns whether it has."""
    until = time.monotonic() + longest
    while not happened() and time.monotonic() < until:
        time.sleep(0.02)
    return bool(happened())


def end(process: subprocess.Popen[bytes]) -> None:
    """End a process and those that it started."""
    children = offspring(process.pid)
    for one in (*children, process):
        with suppress(psutil.NoSuchProcess):
            one.kill()
    process.wait()
    psutil.wait_procs(children)


def offspring(pid: int) -> list[psutil.Process]:
    try:
        return psutil.Process(pid).children(recursive=True)
    except psutil.NoSuchProcess:
        return []


def shards(folder: Path) -> list[Path]:
    """What a run has saved so far."""
    return sorted((folder / "a.nc.parts").glob("hits_*.nc"))


def strike(run: Run, fault: str, scheduler: subprocess.Popen[bytes] | None, draw: random.Random) -> bool:
    """Let a fault befall a run: early, or after it has saved some more shards; returns whether the run was still on."""
    before, more, pause = len(shards(run.folder)), draw.randint(1, 6), draw.uniform(0.0, 0.5)
    if draw.random() < 0.25:
        time.sleep(draw.uniform(0.1, 4.0))
    else:
        wait_for(lambda: run.process.poll() is not None or len(shards(run.folder)) >= before + more, LONGEST)
        time.sleep(pause)
    if run.process.poll() is not None:
        return False
    if fault in SIGNALS:
        run.process.send_signal(getattr(signal, fault))
    elif fault == "scheduler killed":
        assert scheduler is not None
        scheduler.kill()
    elif fault == "worker killed":
        workers = [child for child in offspring(os.getpid()) if is_worker(child)]
        if not workers:
            return False
        draw.choice(workers).kill()
    return True


def is_worker(process: psutil.Process) -> bool:
    """Whether it computes for a nanny of Dask."""
    try:
        return "spawn_main" in str(process.cmdline())
    except psutil.Error:
        return False


def flip(folder: Path, draw: random.Random) -> int:
    """Flip a bit of some shards that an interrupted run has left; returns of how many."""
    files = shards(folder)
    chosen = draw.sample(files, min(len(files), draw.randint(1, 3)))
    for path in chosen:
        data = bytearray(path.read_bytes())
        data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
        path.write_bytes(data)
    return len(chosen)


def same_bits(one: Path, other: Path) -> bool:
    """Whether two results hold the same bits in every variable."""
    with netCDF4.Dataset(one) as a, netCDF4.Dataset(other) as b:
        for file in (a, b):
            file.set_auto_maskandscale(False)
        return list(a.variables) == list(b.variables) and all(
            a[name][...].tobytes() == b[name][...].tobytes() for name in a.variables
        )


def ended(run: Run) -> int | str:
    """Exit code of a run; "hang" if it does not end, or leaves processes behind that do not."""
    begin, children = time.monotonic(), offspring(run.process.pid)
    while run.process.poll() is None:
        if time.monotonic() - begin > LONGEST + starved(run.process.pid):
            end(run.process)
            return "hang"
        time.sleep(0.02)
    left = psutil.wait_procs(children, timeout=LONGEST)[1]
    for child in left:
        child.kill()
    return "processes left behind" if left else run.process.returncode


def starved(pid: int) -> float:
    """Seconds that a thread of a process, or of those that it started, has waited for a core at most."""
    waits = [0.0]
    for process in (pid, *(child.pid for child in offspring(pid))):
        for thread in Path(f"/proc/{process}/task").glob("*/schedstat"):
            with suppress(OSError):
                waits.append(1e-9 * int(thread.read_text().split()[1]))
    return max(waits)


def one_round(folder: Path, draw: random.Random, counts: Counter[str]) -> list[str]:
    """Disturb a campaign until its result is there; returns what went wrong."""
    (folder / "campaign.toml").write_text(campaign(draw), encoding="utf-8")
    straight = start(folder, "straight.nc")
    if (code := ended(straight)) != 0:
        return [f"undisturbed run: {code}, {straight.said[-500:]}"]
    who = draw.choice(["threads", "threads", "workers", "scheduler"])
    counts[f"rounds on {who}"] += 1
    wrong, flipped, told = [], 0, False
    for attempt in range(MOST_FAULTS + 2):
        fault = draw.choice(FAULTS[who]) if attempt < MOST_FAULTS else "none"
        code, said = one_run(folder, who, fault, draw, counts)
        told = told or "computed again" in said
        if code not in ENDS[fault] or "Traceback" in said or (code == 2 and not promises(folder, said)):
            wrong.append(f"{who}, {fault}: {code}, {said[-500:]}")
        if code == 0:
            break
        if draw.random() < 0.5:
            flipped += (number := flip(folder, draw))
            counts["flipped bits in shards"] += number
    if flipped:
        counts["rounds with flipped bits"] += 1
        counts["of which told of damage"] += told
    if not (folder / "a.nc").exists():
        wrong.append(f"no result after {MOST_FAULTS + 2} runs")
    elif not same_bits(folder / "a.nc", folder / "straight.nc"):
        counts["wrong bits"] += 1
        wrong.append("wrong bits")
    return wrong


def promises(folder: Path, said: str) -> bool:
    """Whether a run that broke off tells how to go on, if there is anything to go on with and it had begun."""
    return "--resume" in said or "cannot be reached" in said or not shards(folder)


def one_run(folder: Path, who: str, fault: str, draw: random.Random, counts: Counter[str]) -> tuple[int | str, str]:
    """Resume the campaign and let a fault befall it; returns exit code and words."""
    limit = draw.randint(100, (folder / "straight.nc").stat().st_size) if fault == "disk limit" else 0
    if who == "scheduler":
        with cluster(folder) as scheduler:
            address = json.loads((folder / "scheduler.json").read_text())["address"]
            run = start(folder, "a.nc", "--resume", "--scheduler", address)
            struck = fault != "none" and strike(run, fault, scheduler, draw)
            code = ended(run)
    else:
        run = start(folder, "a.nc", "--resume", *(["--workers", "2"] if who == "workers" else []), limit=limit)
        struck = fault not in ("none", "disk limit") and strike(run, fault, None, draw)
        code = ended(run)
        struck = struck or (fault == "disk limit" and code == 2)
    counts[fault] += fault != "none" and struck
    counts[f"exit {code}"] += 1
    counts["runs"] += 1
    return code, run.said


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0, help="how long to go on")
    parser.add_argument("--seed", type=int, default=1, help="of new figures")
    parser.add_argument("--figures", type=Path, default=FIGURES, help="file that is read and written")
    arguments = parser.parse_args()
    zero = {"seed": arguments.seed, "rounds": 0, "seconds": 0.0, "counts": {"wrong bits": 0}, "wrong": []}
    figures: dict[str, Any] = json.loads(arguments.figures.read_text()) if arguments.figures.exists() else zero
    begin, before = time.monotonic(), figures["seconds"]
    while time.monotonic() - begin < 60.0 * arguments.minutes:
        counts = Counter(figures["counts"])
        draw = random.Random(f"{figures['seed']} {figures['rounds']}")
        with tempfile.TemporaryDirectory() as folder:
            figures["wrong"] += [f"round {figures['rounds']}: {text}" for text in one_round(Path(folder), draw, counts)]
        figures["rounds"] += 1
        figures["counts"] = dict(sorted(counts.items()))
        figures["seconds"] = round(before + time.monotonic() - begin, 1)
        machine = f"{platform.machine()}, {os.cpu_count()} cores, shared"
        arguments.figures.write_text(json.dumps(figures | {"machine": machine}, indent=1) + "\n")
        print(figures["rounds"], figures["seconds"], figures["counts"], figures["wrong"][-1:], flush=True)
    sys.exit(1 if figures["wrong"] else 0)


if __name__ == "__main__":
    main()
