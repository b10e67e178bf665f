"""All commands: what they are for, the arguments that they take, and options that several of them share."""

import argparse
from collections.abc import Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple

Option = tuple[tuple[str, ...], dict[str, Any]]
"""Names and settings of an argument, as argparse takes them."""

SCHEMA = "warpimpact.schema.json"
"""Usual name of the schema of campaigns."""


MODULES = {
    "compare": "compare",
    "run": "continuum run",
    "show": "catalogue export inspect plate plot replay report validate",
    "start": "design new schema",
    "studies": "identify limit optimise sensitivity sweep test",
}
"""Commands by the module with their functions, which is imported when a command runs: that takes seconds."""


class Command(NamedTuple):
    """A command, whose function `NAME_command` is in a module of this room.

    Attributes:
        summary: its line in `warpimpact --help`.
        options: its arguments; those in a list exclude each other.
        example: a command line, without the program's name.
    """

    name: str
    summary: str
    description: str
    options: Sequence[Option | list[Option]]
    example: str

    def add_to(self, commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
        epilog = f"example: warpimpact {self.example}"
        parser = commands.add_parser(self.name, description=self.description, epilog=epilog)
        parser.set_defaults(command=self)
        for one in (*self.options, VOLUME):
            group = parser.add_mutually_exclusive_group() if isinstance(one, list) else parser
            for names, settings in one if isinstance(one, list) else [one]:
                group.add_argument(*names, **settings)

    def function(self) -> Any:
        """The function of the command, which takes its arguments and returns its exit code; None is success."""
        module = next(module for module, names in MODULES.items() if self.name in names.split())
        return getattr(import_module(f".{module}", __package__), f"{self.name}_command")


def option(*names: str, text: str, **settings: Any) -> Option:
    """Declare an argument that `text` explains."""
    return names, settings | {"help": text}


def whole_number(least: int, text: str) -> int:
    """Parse a whole number, which may be written as 1e4."""
    try:
        number = float(text)
    except ValueError:
        number = least - 0.5
    if not number.is_integer() or number < least:
        wanted = f"a whole number of at least {least}, such as {least + 1} or 1e4"
        raise argparse.ArgumentTypeError(f'got "{text}", but it must be {wanted}')
    return int(number)


def number(name: str, text: str, *, least: int = 0, **settings: Any) -> Option:
    return option(name, type=partial(whole_number, least), metavar="N", text=text, **settings)


def flag(name: str, text: str, **settings: Any) -> Option:
    return option(name, action="store_true", text=text, **settings)


def file(name: str, metavar: str, text: str, **settings: Any) -> Option:
    return option(name, type=Path, metavar=metavar, text=text, **settings)


def output(metavar: str, text: str) -> Option:
    """Declare the file that a command writes."""
    return option("-o", "--output", type=Path, metavar=metavar, text=text)


def folder(text: str) -> Option:
    """Declare the folder in which a command writes files with names of its own."""
    return file("--folder", "FOLDER", text)


def overwrite(replaced: str) -> Option:
    return flag("--overwrite", f"replace {replaced}")


def earlier(what: str, replaced: str) -> tuple[Option, Option]:
    """Declare what happens to an earlier computation, which `what` names."""
    return flag("--resume", f"continue an interrupted {what}; start a new one if there is none"), overwrite(replaced)


def measures(default: str = "the measures of docs/protection.md") -> Option:
    """Declare the measures of results; `default` names those that are shown without it."""
    text = (
        'a measure, such as "worst_tenth(residual_energy_density@130mm)", "P(inclination > 40 deg)" or V50; may be '
        f"given several times (default: {default})"
    )
    return option("--measure", action="append", default=[], metavar="TEXT", text=text)


CAMPAIGN = file("campaign", "CAMPAIGN.toml", "core, plate, impact, hits and numerics")
RESULT = file("result", "RESULT.nc", "written by warpimpact run")
RESULTS = file("results", "RESULT.nc", "written by warpimpact run", nargs="+")
CAMPAIGN_FOLDER = file("--campaign-folder", "FOLDER", "folder of the files that the campaign names (default: RESULT's)")
COUNT = number("--count", "number of hits, such as 1e4, instead of the campaign's", least=1)
DEVICE = option(
    "--device",
    default="auto",
    metavar="auto|cpu|cuda:0",
    text="where to compute (default: auto, which is a GPU if there is one); a run takes several: cuda:0,cuda:1",
)
ELEMENTS = [
    number(
        "--elements",
        "compute so many of the hits by finite elements, too, such as 12 (default: [continuum] hits)",
        least=1,
        dest="continuum_hits",
    ),
    flag("--fast", "compute no hits by finite elements, whatever the campaign says"),
]
COMPUTING = (
    DEVICE,
    [
        option("--scheduler", metavar="ADDRESS", text="compute on the workers of this Dask scheduler"),
        number("--workers", "compute in N processes on this machine", least=1),
    ],
)
VOLUME = [
    option("-v", "--verbose", action="count", default=0, text="show what is done; -vv shows more"),
    option("-q", "--quiet", action="store_true", text="show no progress"),
]

DAILY = (
    Command(
        "catalogue",
        "list threats and materials by name, or show one",
        "List the threats and materials that a campaign may name, or show one: its numbers, what is known from where, "
        "and what is assumed.",
        [
            option("name", metavar="NAME", nargs="?", text="threat or material (default: list all)"),
            file("--file", "MINE.toml", "entries of your own, as a campaign names them"),
            output("CORE.png", "draw the core of a threat into this picture"),
            overwrite("an existing picture"),
        ],
        'catalogue ".30 AP M2" -o core.png',
    ),
    Command(
        "new",
        "start a campaign of your own from an example",
        "Copy a campaign, a fit, a test or a design that comes with warpimpact, and the files that it names. Write its "
        f"schema, such as {SCHEMA}, so that an editor can complete and check the keys.",
        [
            option("name", metavar="NAME", nargs="?", default="", text="name of an example"),
            flag("--list", "list the examples, each with the question that it answers"),
            output("CAMPAIGN.toml", "campaign file (default: NAME.toml in this folder)"),
            overwrite("existing files"),
        ],
        "new slotted_plate -o my.toml",
    ),
    Command(
        "design",
        "draw a plate in the browser; its hit map answers while a slider moves",
        "Open a page in the browser that draws the plate of a campaign; its hit map answers while a slider moves. The "
        "page gives the campaign file and the report. It is for this machine alone. Ctrl-C ends it. Needs pip install "
        "'warpimpact[design]'.",
        [
            option(
                "designs",
                metavar="CAMPAIGN.toml",
                nargs="*",
                text="campaigns, results, searches, or the address of a page (default: slotted_plate)",
            ),
            number("--port", "port of the page (default: one that is free)", default=0),
            flag("--no-browser", "print the address and open no browser"),
            DEVICE,
        ],
        "design campaigns/slotted_plate.toml",
    ),
    Command(
        "run",
        "compute the hit map of a campaign",
        "Compute every hit of a campaign and write a netCDF file.",
        [
            CAMPAIGN,
            output("RESULT.nc", "result file (default: the campaign's name, in this folder)"),
            *COMPUTING,
            COUNT,
            ELEMENTS,
            *earlier("run", "an existing result or an interrupted run"),
        ],
        "run campaigns/slotted_plate.toml -o slotted.nc --count 512",
    ),
    Command(
        "compare",
        "compare plates: which protects better",
        "Compare plates under the same shots: the measure that decides, ranks, differences with intervals, a verdict "
        "and a figure. Results at several angles or of several threats, or a sweep, give one table. A campaign with "
        "several plates is run first, each into NAME.nc unless that exists. A map and a result of continuum of the "
        "same shots are compared hit by hit.",
        [
            file("files", "RESULT.nc", "results, one with references, or a campaign with several [[plate]]", nargs="+"),
            output("FIGURE.png", "figure as PNG, PDF or SVG (default: comparison.png, or the campaign's name)"),
            folder("of a campaign: folder of the results NAME.nc (default: the folder of the figure)"),
            measures(),
            flag("--all", "show every measure, and what was compared how", dest="every"),
            flag("--sensitivity", "of a campaign: rank again with each unmeasured input changed"),
            *COMPUTING,
            COUNT,
            ELEMENTS,
            *earlier("campaign", "an existing figure; of a campaign, compute all plates again"),
        ],
        "compare campaigns/two_plates.toml, or: warpimpact compare slotted.nc round.nc",
    ),
    Command(
        "limit",
        "find the limit velocity of every hit of a campaign, V50 and V05",
        "Find for every hit the velocity at which the core just passes. Write a netCDF file and a figure: the map "
        "of limits, and the share that passes against velocity, with V50 and V05; the same of the solid plate, or "
        "add-on, that is as heavy. The plate must not weaken by time: give degradation_distance.",
        [
            CAMPAIGN,
            measures("V50 and V05, or H50 and H05 of thicknesses"),
            output("LIMIT.nc", "result file (default: the campaign's name and _limit.nc); the figure is LIMIT.png"),
            option(
                "--quantity",
                choices=("velocity", "thickness"),
                default="velocity",
                text="what to find (default: velocity)",
            ),
            number("--layer", "layer whose thickness to find (default: 0, the plate)", default=0),
            option("--tolerance", metavar="TOLERANCE", text='width of a limit, as "0.5 m/s" (default: 1 m/s, 0.01 mm)'),
            *COMPUTING,
            COUNT,
            *earlier("search", "an existing result or an interrupted search"),
        ],
        "limit campaigns/limit_velocity.toml -o limit.nc",
    ),
    Command(
        "optimise",
        "search the best designs: lightest, safest, and what lies between",
        "Search the free variables of a target for the front: designs that no other design beats in every objective. "
        "Write every design as netCDF, a campaign file for each design of the front, and a figure. Exit code 4: no "
        "design meets the bounds. Needs pip install 'warpimpact[optimise]'.",
        [
            file("design", "DESIGN.toml", "design file: a campaign, and what is free"),
            output("FRONT.nc", "result file (default: the design's name, in this folder)"),
            ELEMENTS,
            *COMPUTING,
            *earlier("search", "an existing result, its campaigns or an interrupted search"),
        ],
        "optimise campaigns/designs/lightest_plate.toml -o front.nc",
    ),
    Command(
        "report",
        "write a report as one HTML file",
        "Write a report of one or several results as one HTML file that works offline: campaign, plates, interactive "
        "maps and trajectories, numbers with intervals, and the limits of the model. A file of any other kind, such as "
        "a search or a posterior, is reported alone.",
        [
            RESULTS,
            output("REPORT.html", "report file (default: the name of the first result with .html, in its folder)"),
            number("--trajectories", "hits of each result to replay: the worst, and others (default: 32)", default=32),
            CAMPAIGN_FOLDER,
            overwrite("an existing report"),
        ],
        "report slotted.nc -o slotted.html",
    ),
)
"""Commands of a task from names to a report."""

EXPERT = (
    Command(
        "plate",
        "draw the plate of a campaign to scale",
        "Draw the plate of a campaign to scale, with the largest section of the core. Print open area, smallest "
        "ligament and areal density. No shot is computed.",
        [
            CAMPAIGN,
            output("PLATE.png", "picture file (default: the campaign's name with _plate, in this folder)"),
            overwrite("an existing picture"),
        ],
        "plate campaigns/slotted_plate.toml",
    ),
    Command(
        "inspect",
        "print what a result contains",
        "Print the origin of a result, its numbers with their intervals, and the shots that failed. For a sweep, a "
        "search or another file, print what its own command prints.",
        [RESULT, measures(), flag("--campaign", "print only the campaign that the result contains")],
        "inspect slotted.nc",
    ),
    Command(
        "plot",
        "draw maps of a result, or of several results side by side",
        "Draw two figures of a result as PNG files: an overview, and what decides (the base if there is one, else "
        "the energy behind the plate and behind the solid one). For several results: maps side by side with the same "
        "colour scale.",
        [
            RESULTS,
            folder("existing folder of the pictures (default: the folder of the result)"),
            flag("--all", "draw all figures: a map of each variable, distributions, layers, uncertainty", dest="every"),
            overwrite("existing pictures"),
            [
                option("--measure", metavar="TEXT", text='map of this measure of one result: "P(tilt@130mm > 30 deg)"'),
                option("--variable", metavar="NAME", text="map of this variable of one result, as edge_distance"),
            ],
        ],
        "plot slotted.nc --folder maps",
    ),
    Command(
        "sensitivity",
        "show how far numbers move with each unmeasured input",
        "Compute a campaign with one input changed at a time, such as resistance, weakening, friction or yaw. All "
        "rows have the same hits. Print a table, write it as CSV, and draw a figure of the same name.",
        [
            CAMPAIGN,
            measures("what reaches the base; residual velocity, deflection and tilt"),
            output("TABLE.csv", "table (default: the campaign's name and _sensitivity.csv, in this folder)"),
            number("--hits", "hits of each row (default: 256)", least=16, default=256),
            DEVICE,
            overwrite("an existing table and its figure"),
        ],
        "sensitivity campaigns/slotted_plate.toml",
    ),
    Command(
        "sweep",
        "run a campaign at every combination of some inputs",
        "Run a campaign with a table [sweep] at every combination of the values in it. Write a netCDF file with a "
        "dimension for each input, and a figure of the same name. The folder SWEEP_points has the result of every "
        "point, which the other commands take.",
        [
            CAMPAIGN,
            measures("velocity, deflection and tilt behind the target, and the share that passes"),
            output("SWEEP.nc", "file of the sweep (default: the campaign's name, in this folder)"),
            *COMPUTING,
            COUNT,
            ELEMENTS,
            *earlier("sweep", "an existing sweep with its points and its figure"),
        ],
        "sweep campaigns/obliquity_sweep.toml -o sweep.nc",
    ),
    Command(
        "test",
        "V50 of fired shots; simulate firing tests and plans of proof",
        "SHOTS.csv has a column of velocities and one that says whether each core passed: print and draw V50, "
        "spread and interval. TEST.toml simulates a test procedure many times at a target with known limit velocities; "
        "those of a campaign are computed first, into TEST_limits.nc. Print and draw reported and true values, and the "
        "operating characteristic of a plan of proof.",
        [
            file("test", "SHOTS.csv|TEST.toml", "fired shots, or a test to simulate"),
            output("FILE", "result: SHOTS_v50.csv of shots, or TEST.nc; the figure has its name with .png"),
            *COMPUTING,
            COUNT,
            *earlier("test", "an existing result with its figure and its limits"),
        ],
        "test shots.csv",
    ),
    Command(
        "replay",
        "compute a hit of a result again, with its history",
        "Compute a hit of a result again on the CPU. Write its history as netCDF and PNG files. The end equals the "
        "stored outcome bit for bit if the same kind of CPU and the same version computed the result.",
        [
            RESULT,
            number("--hit", "number of the hit in the result, from 0", required=True),
            output("HIT.nc", "history file (default: RESULT_hitN.nc in the folder of the result)"),
            CAMPAIGN_FOLDER,
            number("--snapshots", "number of pictures of what is left of the target (default: 6)", least=2, default=6),
            file("--animation", "HIT.gif", "also write a film of the hit; HIT.mp4 needs FFmpeg"),
            overwrite("an existing history"),
        ],
        "replay slotted.nc --hit 34",
    ),
    Command(
        "export",
        "write a result as CSV, a hit for ParaView, or a plate as a drawing",
        "Write a result as CSV, one row per hit. Or write the history of a hit as VTK files; open its core.pvd and "
        "plate.pvd in ParaView (pip install 'warpimpact[vtk]'). Or write the holes of a campaign's plate as an SVG or "
        "DXF drawing in mm (pip install 'warpimpact[cad]').",
        [
            file("file", "RESULT.nc|HIT.nc|CAMPAIGN.toml", "written by warpimpact run or replay, or a campaign file"),
            output("FILE", "CSV file or drawing (default: the file's name with .csv or .svg, in its folder)"),
            folder("new folder of VTK files (default: the name of the history with _vtk, in its folder)"),
            overwrite("an existing file"),
        ],
        "export slotted.nc -o slotted.csv",
    ),
    Command(
        "continuum",
        "narrow an answer by more finite elements, or compute hits by them",
        "Compute some hits of a result by finite elements of the target; its answer counts them from then on. A hit "
        "takes seconds to minutes of one CPU core. For a campaign, or with --hit or -o, the hits become a result of "
        "their own, which compare takes with one of the fast law. Options override the campaign's table [continuum] "
        "(docs/continuum.md).",
        [
            file("file", "FILE", "a campaign, or a result of warpimpact run"),
            output("HITS.nc", "file of the hits alone (of a campaign, or with --hit: the file's name with _continuum)"),
            COUNT,
            [
                number("--hit", "of a result: this hit; may be given several times", action="append"),
                number(
                    "--hits",
                    "of a result: number of hits, spread over the map (default: 16)",
                    least=1,
                    dest="continuum_hits",
                ),
            ],
            option(
                "--material",
                metavar="NAME",
                action="append",
                text="material, or a TOML file; again for each layer behind (default: the campaign's)",
            ),
            option("--friction", metavar="MU", type=float, text="between core and target"),
            option("--fidelity", choices=("draft", "standard", "reference"), text="size of the elements"),
            option("--element", metavar="LENGTH", text='size of the elements, as "0.5 mm", in place of a fidelity'),
            *COMPUTING,
            *earlier("computation", "an existing result or an interrupted computation"),
        ],
        "continuum slotted.nc --hits 16 --material ARMOX560T",
    ),
    Command(
        "identify",
        "find parameters with their uncertainty from measured shots",
        "Find the parameters of plate, interaction and core that agree with measured shots, each with its uncertainty. "
        "Write the posterior as a netCDF file, the draws of the material as a CSV file that hits.file takes, and "
        "figures. Print which parameters the shots determine, and whether the computation has converged.",
        [
            file("fit", "FIT", "fit file, or a result of warpimpact continuum, whose hits count as measured shots"),
            output("POSTERIOR.nc", "file of the posterior (default: the fit's name, in this folder)"),
            *COMPUTING,
            overwrite("an existing posterior"),
        ],
        "identify campaigns/fits/paper_fit.toml -o paper_fit.nc",
    ),
    Command(
        "validate",
        "compute the published shots and compare",
        "Compute the paper's two shots. Compare them with the paper's model, its experiment and LS-DYNA. For a "
        "result, print the hits closest to the two shots.",
        [
            file("campaign", "FILE", "the paper's two shots (default: paper_shots), or a result", nargs="?"),
            DEVICE,
        ],
        "validate",
    ),
    Command(
        "schema",
        "print the JSON schema of campaign files, for editors",
        "Print the JSON schema of campaign files. An editor that knows TOML, such as VS Code with Even Better TOML, "
        f"completes and checks a campaign whose first line is: #:schema {SCHEMA}",
        [
            [
                option(
                    f"--{kind}",
                    action="store_const",
                    const=kind,
                    dest="kind",
                    default="campaign",
                    text=f"print the schema of {kind}s, which warpimpact {command} takes",
                )
                for kind, command in (("fit", "identify"), ("test", "test"), ("design", "optimise"))
            ],
            output("SCHEMA.json", "file (default: printed)"),
            overwrite("an existing file"),
        ],
        f"schema -o {SCHEMA}",
    ),
)
"""Commands for experts."""
