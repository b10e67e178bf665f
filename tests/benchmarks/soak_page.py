"""The page of `warpimpact design` under callers that change their minds, hang up, stay silent or send no request.

A round starts the page and disturbs it for some minutes. Between the disturbances the page has to answer one design
with the same bits as at first, within the memory that is allowed; a signal has to end it. The figures add up.
python tests/benchmarks/soak_page.py --minutes 20
"""

import argparse
import hashlib
import http.client
import json
import random
import signal
import socket
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any, NamedTuple
from urllib.parse import urlsplit

import psutil

TOP = Path(__file__).parents[2]
FIGURES = Path(__file__).parent / "results" / "soak_page.json"
MOST_MEMORY = 3 * 2**30
"""Bytes that the page may take: a tile has 2 GiB at most."""
TIMES = ("html", "seconds")
"""Parts of an answer that tell how long it took."""
LONGEST = 300.0
"""Seconds after which an answer counts as hanging."""


class Page(NamedTuple):
    """A page that is served by a process."""

    process: subprocess.Popen[str]
    address: str

    def send(self, path: str, body: Any) -> http.client.HTTPConnection:
        place = urlsplit(self.address)
        connection = http.client.HTTPConnection(str(place.hostname), place.port, timeout=LONGEST)
        text = body if isinstance(body, bytes) else json.dumps(body).encode()
        connection.request("POST", f"{place.path}{path}", text, {"Origin": f"http://{place.netloc}"})
        return connection

    def answer(self, path: str, body: Any) -> bytes:
        connection = self.send(path, body)
        try:
            return connection.getresponse().read()
        finally:
            connection.close()


Tables = dict[str, Any]


def changed(tables: Tables, draw: random.Random) -> Tables:
    """A design that a slider may reach, or that nobody has."""
    other: Tables = json.loads(json.dumps(tables))
    spacing = draw.choice(
        [[f"{draw.uniform(6, 12):.2f} mm", f"{draw.uniform(13, 20):.2f} mm"], ["1 m", "1 m"], ["0 m", 3]]
    )
    other["plate"]["pattern"]["spacing"] = spacing
    other["plate"]["thickness"] = draw.choice(["1 mm", "4 mm", "12 mm", "6 m", -1, "x"])
    other["impact"]["obliquity"] = f"{draw.choice([0, 10, 30, 60, 89])} deg"
    return other


def whole(page: Page, tables: Tables, draw: random.Random) -> None:
    page.answer("compute", {"design": changed(tables, draw)})


def hung_up(page: Page, tables: Tables, draw: random.Random) -> None:
    connection = page.send("compute", {"design": changed(tables, draw)})
    time.sleep(draw.uniform(0.0, 3.0))
    connection.close()


def junk(page: Page, tables: Tables, draw: random.Random) -> None:
    path = draw.choice(["compute", "change", "open", "trajectory", "figure", "report"])
    nested = b"[" * 100_000
    body = draw.choice([b"", b"{", nested, draw.randbytes(1000), json.dumps({"design": [], "level": "a"}).encode()])
    page.answer(path, body)


def silent(page: Page, tables: Tables, draw: random.Random) -> None:
    """A connection that is left open."""
    place = urlsplit(page.address)
    connection = socket.create_connection((str(place.hostname), place.port or 0))
    connection.send(draw.choice([b"", b"GET / HT", b"POST /compute HTTP/1.1\r\nContent-Length: 9\r\n\r\n{"]))
    LEFT_OPEN.append(connection)
    del LEFT_OPEN[:-50]


LEFT_OPEN: list[socket.socket] = []


def followed(page: Page, tables: Tables, draw: random.Random) -> None:
    """A hit, its figure or a report."""
    hit = {"design": tables, "stage": "first", "hit": draw.randrange(100), "level": 0}
    page.answer(draw.choice(["trajectory", "figure", "report"]), hit | {"figure": draw.choice(["passage", "none"])})


CALLERS: tuple[Callable[[Page, Tables, random.Random], None], ...] = (whole, hung_up, hung_up, junk, silent, followed)


def bits(page: Page, tables: Tables) -> str:
    """What the page says of a design, without times."""
    lines = [json.loads(line) for line in page.answer("compute", {"design": tables}).splitlines()]
    kept = [{name: part for name, part in line.items() if name not in TIMES} for line in lines]
    return hashlib.sha256(json.dumps(kept).encode()).hexdigest()


def started(folder: Path) -> Page:
    text = (TOP / "campaigns" / "slotted_plate.toml").read_text(encoding="utf-8").replace("4096", "500")
    (folder / "small.toml").write_text(text, encoding="utf-8")
    command = [sys.executable, "-m", "warpimpact", "design", "small.toml", "--no-browser", "--device", "cpu"]
    process = subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True)
    assert process.stdout is not None
    return Page(process, process.stdout.readline().strip())


def one_round(folder: Path, draw: random.Random, minutes: float, counts: Counter[str]) -> list[str]:
    """Disturb a page for some minutes; returns what went wrong."""
    page, wrong, begin = started(folder), [], time.monotonic()
    try:
        place = urlsplit(page.address)
        connection = http.client.HTTPConnection(str(place.hostname), place.port, timeout=LONGEST)
        connection.request("GET", f"{place.path}start", headers={"Host": place.netloc})
        tables = next(iter(json.loads(connection.getresponse().read())["designs"].values()))
        first = bits(page, tables)
        while time.monotonic() - begin < 60.0 * minutes:
            caller = draw.choice(CALLERS)
            counts[caller.__name__] += 1
            try:
                caller(page, tables, draw)
                if draw.random() < 0.2:
                    counts["compared"] += 1
                    if bits(page, tables) != first:
                        wrong.append(f"other bits after {caller.__name__}")
            except (OSError, http.client.HTTPException) as error:
                wrong.append(f"{caller.__name__}: {error!r}")
            memory = psutil.Process(page.process.pid).memory_info().rss
            counts["largest memory [MiB]"] = max(counts["largest memory [MiB]"], memory >> 20)
            if memory > MOST_MEMORY:
                wrong.append(f"{memory >> 20} MiB after {caller.__name__}")
            if page.process.poll() is not None:
                return [*wrong, f"ended by {caller.__name__} with {page.process.returncode}"]
    finally:
        page.process.send_signal(signal.SIGINT)
        try:
            page.process.wait(LONGEST)
        except subprocess.TimeoutExpired:
            page.process.kill()
            wrong.append("not ended by a signal")
    return wrong


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--minutes", type=float, default=20.0, help="how long to go on")
    parser.add_argument("--seed", type=int, default=1, help="of new figures")
    parser.add_argument("--figures", type=Path, default=FIGURES, help="file that is read and written")
    arguments = parser.parse_args()
    zero: dict[str, Any] = {"seed": arguments.seed, "rounds": 0, "minutes": 0.0, "counts": {}, "wrong": []}
    figures = json.loads(arguments.figures.read_text()) if arguments.figures.exists() else zero
    counts, draw = Counter(figures["counts"]), random.Random(f"{figures['seed']} {figures['rounds']}")
    with tempfile.TemporaryDirectory() as folder:
        figures["wrong"] += one_round(Path(folder), draw, arguments.minutes, counts)
    figures |= {"rounds": figures["rounds"] + 1, "minutes": figures["minutes"] + arguments.minutes}
    figures["counts"] = dict(sorted(counts.items()))
    arguments.figures.write_text(json.dumps(figures, indent=1) + "\n")
    print(figures)
    sys.exit(1 if figures["wrong"] else 0)


if __name__ == "__main__":
    main()
