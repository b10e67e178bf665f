"""Random campaigns that are signalled, killed, starved of disk and damaged, until each result is there: are its bits
those of an undisturbed run?

A round draws a campaign, computes it undisturbed, and then disturbs and resumes it until it is complete. Half of the
rounds compute on Dask workers of this machine. The figures add up: a run goes on where the file of figures ended.
python tests/benchmarks/soak.py --minutes 60
"""

import argparse
import json
import platform
import random
import signal
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import netCDF4
import psutil

TOP = Path(__file__).parents[2]
FIGURES = Path(__file__).parent / "results" / "soak.json"
SCENE = (TOP / "campaigns" / "slotted_plate.toml").read_text(encoding="utf-8")
COMMAND = """
import resource, signal, sys
from warpimpact.campaign import parts
parts.FEWEST = 256
signal.signal(signal.SIGINT, signal.default_int_handler)
if int(sys.argv[1]):
    signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
    resource.setrlimit(resource.RLIMIT_FSIZE, (int(sys.argv[1]),) * 2)
from warpimpact.cli import command
sys.argv[1:] = sys.argv[2:]
command()
"""
"""The command with small shards and, if the first argument is not 0, with a limit of the size of files."""
FAULTS = ("sigint", "sigterm", "sigkill", "disk", "bit flips", "worker")
LONGEST = 300.0
"""Seconds after which a run counts as hanging."""
ALLOWED = {0, 2, 130, -signal.SIGTERM, -signal.SIGINT, -signal.SIGKILL}
"""How a disturbed run may end; before it listens to signals, the system ends it."""


def campaign(draw: random.Random) -> str:
    """A campaign of some seconds."""
    return (
        SCENE.replace('"standard"', '"draft"')
        .replace("count = 4096", f"count = {draw.choice([1000, 2000, 5000])}")
        .replace("seed = 1", f"seed = {draw.randrange(10**6)}")
        .replace('"825 m/s"', f'"{draw.randint(300, 900)} m/s"')
    )


def start(folder: Path, output: str, *options: str, limit: int = 0) -> subprocess.Popen[str]:
    """A run of the campaign in a folder."""
    command = [sys.executable, "-c", COMMAND, str(limit), "run", "campaign.toml", "-o", output, "--device", "cpu"]
    return subprocess.Popen(
        [*command, *options], cwd=folder, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True
    )


def disturb(process: subprocess.Popen[str], fault: str, draw: random.Random) -> None:
    """Let a fault befall a run at a random moment."""
    try:
        process.wait(draw.uniform(0.1, 1.0) if draw.random() < 0.3 else draw.uniform(1.0, 12.0))
        return
    except subprocess.TimeoutExpired:
        pass
    if fault.startswith("sig"):
        process.send_signal(getattr(signal, fault.upper()))
    if fault == "worker":
        children = psutil.Process(process.pid).children(recursive=True)
        workers = [child for child in children if "spawn_main" in str(child.cmdline())]
        if workers:
            draw.choice(workers).kill()


def flip(folder: Path, draw: random.Random) -> int:
    """Flip a bit of some files that an interrupted run has left; returns of how many."""
    files = [path for path in sorted((folder / "a.nc.parts").glob("*")) if path.is_file() and path.stat().st_size]
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


def ended(process: subprocess.Popen[str]) -> tuple[int | str, str]:
    """Exit code and last words of a run; "hang" if it does not end."""
    try:
        said = process.communicate(timeout=LONGEST)[1]
    except subprocess.TimeoutExpired:
        process.kill()
        return "hang", process.communicate()[1]
    return process.returncode, said


def one_round(folder: Path, draw: random.Random, counts: Counter[str]) -> list[str]:
    """Disturb a campaign until its result is there; returns what went wrong."""
    (folder / "campaign.toml").write_text(campaign(draw), encoding="utf-8")
    code, said = ended(start(folder, "straight.nc"))
    if code != 0:
        return [f"undisturbed run: {code}, {said[-500:]}"]
    wrong, size = [], (folder / "straight.nc").stat().st_size
    spread = ["--workers", "2"] if draw.random() < 0.3 else []
    for attempt in range(40):
        fault = draw.choice(FAULTS if spread else FAULTS[:5]) if attempt < 8 else "none"
        limit = draw.randint(100, size) if fault == "disk" else 0
        process = start(folder, "a.nc", "--resume", *spread, limit=limit)
        if fault != "none":
            disturb(process, fault, draw)
        code, said = ended(process)
        counts[fault] += 1
        counts[f"exit {code}"] += 1
        if code not in ALLOWED or "Traceback" in said:
            wrong.append(f"{fault}: {code}, {said[-500:]}")
        if (folder / "a.nc").exists() and code == 0:
            break
        if fault == "bit flips":
            counts["flipped bits"] += flip(folder, draw)
    if not (folder / "a.nc").exists():
        wrong.append("no result after 40 runs")
    elif not same_bits(folder / "a.nc", folder / "straight.nc"):
        counts["wrong bits"] += 1
        wrong.append("wrong bits")
    return wrong


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=60.0, help="how long to go on")
    parser.add_argument("--figures", type=Path, default=FIGURES, help="file that is read and written")
    arguments = parser.parse_args()
    figures: dict[str, Any] = {"seed": 1, "rounds": 0, "seconds": 0.0, "counts": {"wrong bits": 0}, "wrong": []}
    if arguments.figures.exists():
        figures = json.loads(arguments.figures.read_text())
    begin, before = time.monotonic(), figures["seconds"]
    while time.monotonic() - begin < 60.0 * arguments.minutes:
        counts = Counter(figures["counts"])
        draw = random.Random(f"{figures['seed']} {figures['rounds']}")
        with tempfile.TemporaryDirectory() as folder:
            figures["wrong"] += [f"round {figures['rounds']}: {text}" for text in one_round(Path(folder), draw, counts)]
        figures["rounds"] += 1
        figures["counts"] = dict(sorted(counts.items()))
        figures["seconds"] = round(before + time.monotonic() - begin, 1)
        arguments.figures.write_text(json.dumps(figures | {"machine": platform.machine()}, indent=1) + "\n")
        print(figures["rounds"], figures["seconds"], figures["counts"], figures["wrong"][-1:], flush=True)
    sys.exit(1 if figures["wrong"] else 0)


if __name__ == "__main__":
    main()
