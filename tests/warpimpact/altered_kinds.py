"""A small file of every kind that the package writes, and the commands that such a file is given to.

`python tests/warpimpact/altered_kinds.py FOLDER TRIES [KIND …]` gives so many altered files of each kind to each of its
commands.
"""

from __future__ import annotations

import contextlib
import io
import os
import random
import shutil
import sys
import tempfile
import time
import warnings
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path

from altered_files import NOTHING, altered_files
from matplotlib.figure import Figure

from warpimpact.campaign.campaign import Campaign
from warpimpact.cli import main

HEAD = """
title = "a plate"
core = { shape = "cone", diameter = "6 mm", length = "20 mm", cone_length = "8 mm", mass = "4 g" }
impact = { velocity = "600 m/s" }
output = { standoffs = ["50 mm", "130 mm"] }
"""
PLATE = """
[plate]
thickness = "4 mm"
resistance = "2600 MPa"
degradation = 0.8
degradation_distance = "1 mm"
pattern = { shape = "circle", diameter = "4 mm", spacing = "8 mm" }
"""
TARGET = HEAD + "hits = { count = 16 }\n" + PLATE
LAYER = '[[layer]]\nthickness = "2 mm"\nresistance = "2600 MPa"\ngap = "20 mm"\ndegradation = 1.0\n'
PILOT = 'numerics = { fidelity = "draft" }\n'
FIXED = "numerics = { level = 0 }\n"
SWEEP = '[sweep]\nvelocity = ["200 m/s", "500 m/s", "800 m/s"]\n'
ASKED = """
objectives = [{ measure = "areal_density" }, { measure = "mean(residual_energy_fraction)" }]
search = { designs = 4, hits = 16, most_hits = 16, confirm_hits = 64 }
"""
FREE = """
[[references]]
name = "published"
plate = { thickness = "3 mm", resistance = "2600 MPa" }
[variables]
thickness = ["2 mm", "3 mm", "4 mm"]
"""
FIRING = """
title = "a test"
tests = 20
[target]
mean = "800 m/s"
deviation = "25 m/s"
[procedure]
name = "langlie"
lowest = 700
highest = 900
shots = 8
"""
OF_A_FILE = '[target]\n{} = "altered.nc"\n[procedure]\nname = "langlie"\nlowest = 100\nhighest = 900\nshots = 8\n'
_MAP = (
    ("inspect", "altered.nc"),
    ("export", "altered.nc", "-o", "a.csv", "--overwrite"),
    ("plot", "altered.nc", "-o", ".", "--overwrite"),
    ("report", "altered.nc", "-o", "a.html", "--trajectories", "0", "--overwrite"),
    ("compare", "altered.nc", "result.nc", "-o", "c.png", "--overwrite"),
)
_TEST = ("test", "-q", "-o", "t.nc", "--overwrite")
_REPORT = ("report", "altered.nc", "-o", "a.html", "--overwrite")
COMMANDS: dict[str, Sequence[Sequence[str]]] = {
    "result": (*_MAP, ("replay", "altered.nc", "--hit", "3", "-o", "h.nc", "--overwrite")),
    "limits": (*_MAP[:4], (*_TEST, "limits.toml")),
    "history": (("export", "altered.nc", "-o", "vtk"), ("inspect", "altered.nc")),
    "sweep": ((*_TEST, "sweep.toml"), ("inspect", "altered.nc")),
    "posterior": (_REPORT,),
    "front": (_REPORT, ("design", "altered.nc", "--no-browser", "--port", "70000")),
    "firing": (("inspect", "altered.nc"), ("report", "altered.nc", "-o", "a.html", "--overwrite")),
}


def write_files(folder: Path) -> None:
    """Write a file of every kind, `KIND.nc`, and what the commands need beside it."""
    from warpimpact.firing.plan_file import firing_test
    from warpimpact.firing.repeated import simulate_test
    from warpimpact.identification.fit_file import fit_from
    from warpimpact.identification.identify import identify_to_file
    from warpimpact.optimisation.design import design_from
    from warpimpact.optimisation.optimise import optimise
    from warpimpact.results import files
    from warpimpact.runs.replay import replay
    from warpimpact.runs.run import run, run_to_file
    from warpimpact.studies.limit import LimitMap
    from warpimpact.studies.sweep import read_sweep, run_sweep

    result = run(Campaign.from_text(PILOT + TARGET + LAYER, name="a", folder=Path()), device="cpu")
    files.write(result, folder / "result.nc")
    files.write(replay(result, 3, folder=Path()), folder / "history.nc")
    plate = Campaign.from_text(FIXED + TARGET, name="a", folder=Path())
    run_to_file(plate, folder / "limits.nc", device="cpu", computation=LimitMap.of(plate))
    (folder / "sweep_campaign.toml").write_text(FIXED + TARGET + SWEEP)
    run_sweep(read_sweep(folder / "sweep_campaign.toml"), folder / "sweep.nc", device="cpu")
    fit = (Path(__file__).parents[1] / "validation" / "calibration.toml").read_text(encoding="utf-8")
    small = fit.replace("[sampling]\nhits = 64", "[sampling]\nsets = 128\ndraws = 50\neffective = 60\nhits = 32")
    identify_to_file(fit_from(small, "fit.toml", Path()), folder / "posterior.nc", device="cpu")
    design = design_from(FIXED + HEAD + ASKED + PLATE + FREE, "design", Path())
    files.write(optimise(design), folder / "front.nc")
    files.write(simulate_test(firing_test(FIRING, "test", Path()), None, {}, None), folder / "firing.nc")
    for name in ("limits", "sweep"):
        (folder / f"{name}.toml").write_text('title = "a"\ntests = 20\n' + OF_A_FILE.format(name))


def failures(
    kind: str,
    tries: int,
    seed: object = 0,
    only: Collection[str] = (),
    commands: int = 9,
    names: Collection[str] = (),
) -> Iterator[str | None]:
    """Give altered files of a kind in the working folder to every command that takes one, or to a number of them, or to
    those of some names; what each failed with, None if it read or refused it in a sentence."""
    given = [command for command in COMMANDS[kind] if not names or command[0] in names]
    first = None if kind == "firing" else COMMANDS[kind][0]  # no command reads a firing test
    draw = random.Random(kind)
    for alteration in altered_files(Path(f"{kind}.nc"), Path("altered.nc"), tries, seed, only):
        for command in draw.sample(given, min(commands, len(given))):
            shutil.rmtree("vtk", ignore_errors=True)
            said = io.StringIO()
            with contextlib.redirect_stderr(said), contextlib.redirect_stdout(io.StringIO()), warnings.catch_warnings():
                warnings.simplefilter("ignore")
                code = main(command)
            text = said.getvalue()
            is_refused = (
                code == 2 and text.count("\n") == 1 and len(text) < 1000 and (alteration, command) != (NOTHING, first)
            )
            is_well = code in (0, 3) or is_refused
            yield None if is_well else f"{kind}, {alteration}, {command[0]}: {code} {text[-300:]}"


def try_all(folder: Path, tries: int, kinds: Sequence[str]) -> None:
    """Print what failed, and a row of the table for every kind."""
    os.chdir(folder)
    tempfile.tempdir = str(folder)  # of bug reports
    Figure.savefig = lambda figure, *_, **__: figure.draw_without_rendering()  # type: ignore[method-assign,assignment]
    for kind in kinds:
        begin, count, failed = time.monotonic(), 0, 0
        for failure in failures(kind, tries):
            count += 1
            if failure is not None:
                failed += 1
                print(failure, flush=True)
        print(f"{kind:<10} {count:>6} tries {failed:>4} failures {time.monotonic() - begin:.0f} s", flush=True)


if __name__ == "__main__":
    if not Path(sys.argv[1], "firing.nc").exists():
        write_files(Path(sys.argv[1]))
    try_all(Path(sys.argv[1]), int(sys.argv[2]), sys.argv[3:] or [*COMMANDS])
