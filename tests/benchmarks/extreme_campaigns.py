"""Legal but extreme campaigns of `run`, `limit` and `test`, each a process of its own: how it ends within a minute of a
core and 4 GB.

A campaign is a function of seed and index. It has ended, has been refused (exit code 2, a sentence), or has announced
what it takes; all else fails: a bug report, a signal, too much memory, and a minute of a core without a word of what is
to come. Run it as a script, from the top of the checkout: python tests/benchmarks/extreme_campaigns.py --tries 145
"""

import argparse
import json
import math
import os
import re
import subprocess
import sys
import tempfile
import time
from collections import Counter
from pathlib import Path
from typing import Any

import numpy as np
import psutil

FIGURES = Path(__file__).parent / "results" / "extreme_campaigns.json"
SECONDS, BYTES = 60.0, 4e9
"""What a try may take: processor time, and resident memory of all of its processes."""
COMMANDS = ("run", "limit", "test")
PLAN = """\
title = "extreme"
tests = 20
[target]
campaign = "a.toml"
count = 8
[procedure]
name = "langlie"
lowest = "10 m/s"
highest = "3000 m/s"
shots = 12
"""
ANNOUNCED = re.compile(r"takes? about|s left|holes of the plates take")
"""A line of the progress that says how long it takes."""
ENDINGS = {0: "ended", 2: "refused", 3: "ended"}
"""By exit code; 3 is a result with too many failures, which says so."""


def between(low: float, high: float, share: float) -> float:
    """A number with as many below it in every decade."""
    return float(f"{low * (high / low) ** share:.4g}")


def plate(command: str, draw: np.random.Generator) -> dict[str, Any]:
    """A plate from 1 um to 1 m, with or without holes; of limits, one that stops a core."""
    thickness = between(1e-6, 1.0, draw.random())
    made: dict[str, Any] = {
        "thickness": thickness,
        "resistance": between(1e6, 2e10, draw.random()),
        "degradation": round(draw.random(), 3) if draw.random() < 0.7 else 1.0,
        "degradation_length": between(2e-5, 5e-3, draw.random()),
        **({} if command == "run" else {"degradation_distance": between(1e-4, 0.01, draw.random())}),
        "degradation_depth": between(max(1e-4, thickness / 90), max(2e-4, thickness), draw.random()),
    }
    if draw.random() < 0.7:
        diameter = between(1e-4, 0.1, draw.random())
        pitch = diameter * between(1.05, 10.0, draw.random())
        made["pattern"] = {"shape": "circle", "diameter": diameter, "spacing": [pitch, pitch * (1 + draw.random())]}
    return made


def campaign(command: str, index: int, seed: int) -> dict[str, Any]:
    """The tables of a campaign."""
    draw = np.random.default_rng([seed, index])
    length = between(2e-3, 0.2, draw.random())
    core = {"shape": "cone", "length": length, "diameter": length / between(1.0, 15.0, draw.random())}
    made: dict[str, Any] = {
        "title": f"extreme {index}",
        "core": core | {"density": between(1e3, 2e4, draw.random())},
        "plate": plate(command, draw),
        "impact": {
            "velocity": between(1.0, 5000.0, draw.random()),
            "obliquity": round(89.0 * math.sqrt(draw.random()), 2) if draw.random() < 0.7 else 0,
        },
        "hits": {"count": 8, "seed": index},
        "output": {"standoffs": [40.0]},
    }
    layers = int(draw.integers(1, 8)) if draw.random() < 0.4 else 0
    if layers:
        made["layer"] = [{"gap": between(1e-4, 1.0, draw.random()), **plate(command, draw)} for _ in range(layers)]
    elif command == "run" and draw.random() < 0.4:
        made["burst"] = {"count": int(draw.integers(2, 51)), "spacing": between(1e-3, 0.1, draw.random())}
    if draw.random() < 0.2:
        made["numerics"] = {"level": int(draw.integers(0, 10))}
    return made


def toml(tables: dict[str, Any]) -> str:
    """Tables of plain values as TOML, whose inline tables are JSON with other marks."""

    def value(of: Any) -> str:
        if isinstance(of, dict):
            return "{ " + ", ".join(f"{key} = {value(one)}" for key, one in of.items()) + " }"
        return "[" + ", ".join(map(value, of)) + "]" if isinstance(of, list) else json.dumps(of)

    return "".join(f"{key} = {value(of)}\n" for key, of in tables.items())


def taken(process: psutil.Process) -> tuple[float, int]:
    """Processor time and resident memory of a process and of those that it has started."""
    seconds, resident = 0.0, 0
    for one in [process, *process.children(recursive=True)]:
        try:
            times = one.cpu_times()
            seconds, resident = seconds + times.user + times.system, resident + one.memory_info().rss
        except psutil.NoSuchProcess:
            pass
    return seconds, resident


def tried(command: str, index: int, seed: int, folder: Path) -> dict[str, Any]:
    """How a campaign ends; who has announced what it takes is not waited for."""
    (folder / "a.toml").write_text(toml(campaign(command, index, seed)))
    (folder / "plan.toml").write_text(PLAN)
    arguments = {"run": ["a.toml"], "limit": ["a.toml"], "test": ["plan.toml"]}[command]
    said, most, seconds, began = folder / "said.txt", 0, 0.0, time.monotonic()
    with said.open("w") as log:
        started = subprocess.Popen(
            [sys.executable, "-m", "warpimpact", command, *arguments], cwd=folder, stdout=log, stderr=log
        )
    try:
        process, ending = psutil.Process(started.pid), None
        while started.poll() is None and ending is None:
            time.sleep(0.05)
            try:
                now, resident = taken(process)
            except psutil.NoSuchProcess:
                break
            seconds, most = max(seconds, now), max(most, resident)
            if most > BYTES:
                ending = "too much memory"
            elif ANNOUNCED.search(said.read_text(errors="replace")):
                ending = "announced"
            elif seconds > SECONDS:
                ending = "too long"
    finally:
        if started.poll() is None:
            started.kill()
        code = started.wait()
    last = said.read_text(errors="replace").strip().splitlines()[-1:]
    ending = ending or ENDINGS.get(code, f"exit code {code}")
    if code == 2 and "error: " not in "".join(last):
        ending = "refused without a sentence"
    figures = {"seconds": round(seconds, 1), "gigabytes": round(most / 1e9, 2), "wall": round(time.monotonic() - began)}
    return {"command": command, "index": index, "ending": ending, **figures, "last": "".join(last)[:300]}


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--tries", type=int, default=145)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--only", type=int, nargs="*", help="these alone, printed with their files kept")
    parser.add_argument("--figures", type=Path, default=FIGURES, help="file that is written; it is continued")
    arguments = parser.parse_args()
    os.nice(10)
    rows = json.loads(arguments.figures.read_text())["tries"] if arguments.figures.exists() else []
    rows = [row for row in rows if arguments.only is None or row["index"] not in arguments.only]
    for index in arguments.only if arguments.only is not None else range(len(rows), arguments.tries):
        with tempfile.TemporaryDirectory() as folder:
            rows.append(tried(COMMANDS[index % len(COMMANDS)], index, arguments.seed, Path(folder)))
        print(rows[-1], flush=True)
        table = Counter(f"{row['command']}: {row['ending']}" for row in rows)
        figures = {"seed": arguments.seed, "table": dict(sorted(table.items())), "tries": sorted(rows, key=of_index)}
        arguments.figures.write_text(json.dumps(figures, indent=1) + "\n")
    print(json.dumps(figures["table"], indent=1))


def of_index(row: dict[str, Any]) -> int:
    """The number of a try."""
    return int(row["index"])


if __name__ == "__main__":
    main()
