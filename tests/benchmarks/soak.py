"""Random computations that are signalled, killed, starved of disk, bereft of workers or scheduler and damaged, until
each result is there: are its bits those of an undisturbed one?

A round draws a command and its file, computes it undisturbed, and then disturbs and resumes it until it is complete:
runs, searches and limits by threads, by Dask workers of their own or by those of a scheduler; fits by threads and
processes; sweeps and reports by threads. A fault is counted if it befell a computation that was going on, a flipped bit
if it is in a part that was left behind. The figures add up: a call goes on where the file of figures ended.
python tests/benchmarks/soak.py --minutes 60
"""

import argparse
import json
import os
import platform
import random
import re
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any, NamedTuple

import netCDF4
import psutil

TOP = Path(__file__).parents[2]
FIGURES = Path(__file__).parent / "results" / "soak_commands.json"
CAMPAIGNS = TOP / "campaigns"
SCENE = (CAMPAIGNS / "slotted_plate.toml").read_text(encoding="utf-8")
COMMAND = """
import resource, signal, sys
from warpimpact.cli import command
from warpimpact.runs import shards
def small_parts():
    shards.FEWEST = 256
    shards.HELD = 0.1
    if "identify" in sys.argv:
        from warpimpact.cli import identify as command_of_fits
        from warpimpact.identification import identify
        command_of_fits.WORTHWHILE, identify.BATCH = 0.2, 4
if __name__ == "__main__":  # not in a process of a fit
    small_parts()
    signal.signal(signal.SIGINT, signal.default_int_handler)
    if int(sys.argv[1]):
        signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
        resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
    sys.argv[1:] = sys.argv[2:]
    command()
"""
"""The command with small parts and, if the first argument is not 0, with a limit of the size of files."""
SIGNALS = ("SIGINT", "SIGTERM", "SIGKILL")
FAULTS = {
    "threads": (*SIGNALS, "disk limit"),
    "processes": (*SIGNALS, "worker killed", "disk limit"),
    "workers": (*SIGNALS, "worker killed", "worker killed", "disk limit"),
    "scheduler": ("scheduler killed", "scheduler killed", "worker killed", "SIGTERM"),
}
"""What befalls the computations of a round, by who computes."""
TIMES = ("cost", "compute_time", "hits_per_second")
"""Variables that differ from run to run."""
MADE = re.compile(r"Report made .* by warpimpact")
"""The line of a report that has its time."""
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


class Kind(NamedTuple):
    """A command whose result is disturbed.

    Attributes:
        command: its name.
        text: draws its file.
        who: may compute it.
        ending: of the result.
        resumes: whether it takes --resume; else it begins again with --overwrite.
    """

    command: str
    text: Callable[[random.Random], str]
    who: tuple[str, ...] = ("threads",)
    ending: str = ".nc"
    resumes: bool = True


class Run(NamedTuple):
    """A command under way, and the file that takes what it says."""

    process: subprocess.Popen[bytes]
    folder: Path

    @property
    def said(self) -> str:
        return (self.folder / "said.txt").read_text(errors="replace")


def campaign(draw: random.Random, *counts: int) -> str:
    """A campaign of some seconds."""
    return (
        SCENE.replace('"standard"', '"draft"')
        .replace("count = 4096", f"count = {draw.choice(counts or (1000, 2000, 5000))}")
        .replace("seed = 1", f"seed = {draw.randrange(10**6)}")
        .replace('"825 m/s"', f'"{draw.randint(300, 900)} m/s"')
    )


def limits(draw: random.Random) -> str:
    """A campaign of limits."""
    return campaign(draw, 512, 1024).replace("degradation = 0.8", "degradation = 1.0")


def sweep(draw: random.Random) -> str:
    return (
        campaign(draw, 256, 512)
        + '\n[sweep]\nobliquity = ["0 deg", "10 deg", "20 deg"]\nvelocity = ["600 m/s", "825 m/s"]\n'
    )


def search(draw: random.Random) -> str:
    """A search of some seconds."""
    text = (CAMPAIGNS / "designs" / "lightest_plate.toml").read_text(encoding="utf-8").partition("[search]")[0]
    plan = (
        f"seed = {draw.randrange(10**6)}\ndesigns = {draw.choice((40, 80))}\npopulation = 20\nhits = 16\nmost_hits = 64"
    )
    return f"{text}[search]\nallow_untested = true\n{plan}\nconfirmed = 6\nconfirm_hits = 64\n"


def fit(draw: random.Random) -> str:
    """A fit of some seconds."""
    text = (TOP / "tests" / "validation" / "calibration.toml").read_text(encoding="utf-8")
    plan = f"seed = {draw.randrange(10**6)}\nsets = 512\ndraws = 100\neffective = 400\nhits = 64"
    return text.replace("hits = 64\nseed = 3", plan)


KINDS = (
    *(Kind("run", campaign, ("threads", "workers", "scheduler")),) * 2,
    Kind("optimise", search, ("threads", "workers", "scheduler")),
    Kind("identify", fit, ("processes",)),
    Kind("limit", limits, ("threads", "workers")),
    Kind("sweep", sweep),
    Kind("report", campaign, ending=".html", resumes=False),
)


def start(kind: Kind, folder: Path, stem: str, *options: str, limit: int = 0) -> Run:
    """A command under way in a folder; a report is that of the undisturbed result."""
    given = "map.nc" if kind.command == "report" else "file.toml"
    where = [] if kind.command == "report" else ["--device", "cpu"]
    command = [sys.executable, "program.py", str(limit), kind.command, given, "-o", stem + kind.ending, *where]
    (folder / "program.py").write_text(COMMAND)
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


def parts(folder: Path) -> list[Path]:
    """What a computation has saved so far, the complete points of a sweep included."""
    patterns = ("a.nc.parts/hits_*.nc", "a.nc.parts/batch_*.npz", "a_points/*.nc", "a_points/*.parts/hits_*.nc")
    return sorted(path for pattern in patterns for path in folder.glob(pattern))


def strike(kind: Kind, run: Run, fault: str, scheduler: subprocess.Popen[bytes] | None, draw: random.Random) -> bool:
    """Let a fault befall a run: early, or after it has saved some more shards; returns whether the run was still on."""
    before, more, pause = len(parts(run.folder)), draw.randint(1, 6), draw.uniform(0.0, 0.5)
    if draw.random() < 0.25 or not kind.resumes:
        time.sleep(draw.uniform(0.1, 4.0))
    else:
        wait_for(lambda: run.process.poll() is not None or len(parts(run.folder)) >= before + more, LONGEST)
        time.sleep(pause)
    if run.process.poll() is not None:
        return False
    if fault in SIGNALS:
        run.process.send_signal(getattr(signal, fault))
    elif fault == "scheduler killed":
        assert scheduler is not None
        scheduler.kill()
    elif fault == "worker killed":
        workers = [child for child in offspring(os.getpid() if scheduler else run.process.pid) if is_worker(child)]
        if not workers:
            return False
        draw.choice(workers).kill()
    return True


def is_worker(process: psutil.Process) -> bool:
    """Whether it computes for a nanny of Dask, or for a fit."""
    try:
        return "spawn_main" in str(process.cmdline())
    except psutil.Error:
        return False


def flip(folder: Path, draw: random.Random) -> int:
    """Flip a bit of some shards that an interrupted run has left; returns of how many."""
    files = [path for path in parts(folder) if path.parent.suffix == ".parts"]
    chosen = draw.sample(files, min(len(files), draw.randint(1, 3)))
    for path in chosen:
        data = bytearray(path.read_bytes())
        data[draw.randrange(len(data))] ^= 1 << draw.randrange(8)
        path.write_bytes(data)
    return len(chosen)


def same_bits(kind: Kind, folder: Path) -> bool:
    """Whether two results hold the same bits in every variable, and the same campaigns beside them."""
    if kind.ending != ".nc":
        pages = [(folder / f"{stem}{kind.ending}").read_text(encoding="utf-8") for stem in ("a", "straight")]
        return len({MADE.sub("", page) for page in pages}) == 1
    designs = [sorted((folder / f"{stem}_designs").glob("*")) for stem in ("a", "straight")]
    texts = [[path.read_text() for path in paths] for paths in designs]
    with netCDF4.Dataset(folder / "a.nc") as a, netCDF4.Dataset(folder / "straight.nc") as b:
        return texts[0] == texts[1] and bits(a) == bits(b)


def bits(file: netCDF4.Dataset) -> dict[str, Any]:
    """The values of all variables, those of groups included."""
    file.set_auto_maskandscale(False)
    values = {name: variable[...] for name, variable in file.variables.items() if name not in TIMES}
    own = {name: array.tobytes() if array.dtype != object else array.tolist() for name, array in values.items()}
    return own | {name: bits(group) for name, group in file.groups.items()}


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
        with suppress(OSError):  # it has ended meanwhile
            for thread in Path(f"/proc/{process}/task").glob("*/schedstat"):
                waits.append(1e-9 * int(thread.read_text().split()[1]))
    return max(waits)


def one_round(folder: Path, draw: random.Random, counts: Counter[str], only: str | None) -> list[str]:
    """Disturb a computation until its result is there; returns what went wrong."""
    kind = draw.choice([kind for kind in KINDS if only in (None, kind.command)])
    (folder / "file.toml").write_text(kind.text(draw), encoding="utf-8")
    if kind.command == "report" and (code := ended(of_map := start(KINDS[0], folder, "map"))) != 0:
        return [f"map of a report: {code}, {of_map.said[-500:]}"]
    straight = start(kind, folder, "straight")
    if (code := ended(straight)) != 0:
        return [f"undisturbed {kind.command}: {code}, {straight.said[-500:]}"]
    who = draw.choice(kind.who)
    counts[f"{kind.command} on {who}"] += 1
    wrong, flipped, told = [], 0, False
    for attempt in range(MOST_FAULTS + 2):
        fault = draw.choice(FAULTS[who]) if attempt < MOST_FAULTS else "none"
        code, said = one_run(kind, folder, who, fault, draw, counts)
        told = told or "computed again" in said
        if code not in ENDS[fault] or "Traceback" in said or (code == 2 and not promises(kind, folder, said)):
            wrong.append(f"{kind.command} on {who}, {fault}: {code}, {said[-500:]}")
        if code == 0:
            break
        if draw.random() < 0.5:
            flipped += (number := flip(folder, draw))
            counts["flipped bits in parts"] += number
    if flipped:
        counts["rounds with flipped bits"] += 1
        counts["of which told of damage"] += told
    if not (folder / f"a{kind.ending}").exists():
        wrong.append(f"{kind.command}: no result after {MOST_FAULTS + 2} tries")
    elif not same_bits(kind, folder):
        counts["wrong bits"] += 1
        wrong.append(f"{kind.command} on {who}: wrong bits")
    return wrong


def promises(kind: Kind, folder: Path, said: str) -> bool:
    """Whether a command that broke off tells how to go on, if there is anything to go on with and it had begun."""
    return not kind.resumes or "--resume" in said or "cannot be reached" in said or not parts(folder)


def one_run(
    kind: Kind, folder: Path, who: str, fault: str, draw: random.Random, counts: Counter[str]
) -> tuple[int | str, str]:
    """Resume the computation and let a fault befall it; returns exit code and words."""
    again = "--resume" if kind.resumes else "--overwrite"
    largest = (folder / f"straight{kind.ending}").stat().st_size
    limit = draw.randint(100, largest) if fault == "disk limit" else 0
    if who == "scheduler":
        with cluster(folder) as scheduler:
            address = json.loads((folder / "scheduler.json").read_text())["address"]
            run = start(kind, folder, "a", again, "--scheduler", address)
            struck = fault != "none" and strike(kind, run, fault, scheduler, draw)
            code = ended(run)
    else:
        run = start(kind, folder, "a", again, *(["--workers", "2"] if who == "workers" else []), limit=limit)
        struck = fault not in ("none", "disk limit") and strike(kind, run, fault, None, draw)
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
    parser.add_argument("--only", choices=sorted({kind.command for kind in KINDS}), help="command to disturb")
    arguments = parser.parse_args()
    zero = {"seed": arguments.seed, "rounds": 0, "seconds": 0.0, "counts": {"wrong bits": 0}, "wrong": []}
    figures: dict[str, Any] = json.loads(arguments.figures.read_text()) if arguments.figures.exists() else zero
    begin, before = time.monotonic(), figures["seconds"]
    while time.monotonic() - begin < 60.0 * arguments.minutes:
        counts = Counter(figures["counts"])
        draw = random.Random(f"{figures['seed']} {figures['rounds']}")
        with tempfile.TemporaryDirectory() as folder:
            found = one_round(Path(folder), draw, counts, arguments.only)
            figures["wrong"] += [f"round {figures['rounds']}: {text}" for text in found]
        figures["rounds"] += 1
        figures["counts"] = dict(sorted(counts.items()))
        figures["seconds"] = round(before + time.monotonic() - begin, 1)
        machine = f"{platform.machine()}, {os.cpu_count()} cores, shared"
        arguments.figures.write_text(json.dumps(figures | {"machine": machine}, indent=1) + "\n")
        print(figures["rounds"], figures["seconds"], figures["counts"], figures["wrong"][-1:], flush=True)
    sys.exit(1 if figures["wrong"] else 0)


if __name__ == "__main__":
    main()
