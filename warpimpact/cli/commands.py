"""All commands: what they are for, and the arguments that they take."""

from .options import (
    CAMPAIGN,
    COMPUTING,
    COUNT,
    DEVICE,
    RESULT,
    RESULTS,
    Command,
    campaign_folder,
    choice,
    earlier,
    file,
    flag,
    folder,
    measures,
    number,
    one_of,
    option,
    output,
    overwrite,
    text,
)

SCHEMA = "warpimpact.schema.json"
"""Usual name of the schema of campaigns."""

DAILY = (
    Command(
        "catalogue",
        "show",
        "list threats and materials by name, or show one",
        "List the threats and materials that a campaign may name, or show one: core drawn, masses, velocities of "
        "standards; strength, rows and range; what is known from where, and what is assumed.",
        [
            text("name", "NAME", "threat or material (default: list all)", nargs="?"),
            file("--file", "MINE.toml", "entries of your own, as a campaign names them"),
            output("CORE.png", "draw the core of a threat into this picture"),
            overwrite("an existing picture"),
        ],
        example='catalogue ".30 AP M2" -o core.png',
    ),
    Command(
        "new",
        "start",
        "start a campaign of your own from an example",
        "Copy a campaign, a fit, a test or a design that comes with warpimpact, and the files that it names. Write its "
        f"schema, such as {SCHEMA}, so that an editor can complete and check the keys.",
        [
            text("name", "NAME", "name of an example", nargs="?", default=""),
            flag("--list", "list the examples, each with the question that it answers"),
            output("CAMPAIGN.toml", "campaign file (default: NAME.toml in this folder)"),
            overwrite("existing files"),
        ],
        example="new slotted_plate -o my.toml",
    ),
    Command(
        "design",
        "design",
        "draw a plate in the browser; its hit map answers while a slider moves",
        "Open a page in the browser of this machine. It draws the plate of a campaign, and its hit map answers while a "
        "slider moves. The page gives the campaign file and the report of what it shows. It is for this machine alone "
        "and needs no network. Ctrl-C ends it. It needs: pip install 'warpimpact[design]'",
        [
            text(
                "designs",
                "CAMPAIGN.toml",
                "campaigns, results, searches with their designs, or the address of a page (default: slotted_plate)",
                nargs="*",
            ),
            option("--port", type=int, default=0, metavar="N", help="port of the page (default: one that is free)"),
            flag("--no-browser", "print the address and open no browser"),
            DEVICE,
        ],
        example="design campaigns/slotted_plate.toml",
    ),
    Command(
        "run",
        "run",
        "compute the hit map of a campaign",
        "Compute every hit of a campaign and write a netCDF file.",
        [
            CAMPAIGN,
            output("RESULT.nc", "result file (default: the campaign's name, in this folder)"),
            *COMPUTING,
            COUNT,
            *earlier("run", "an existing result or an interrupted run"),
        ],
        example="run campaigns/slotted_plate.toml -o slotted.nc --count 512",
    ),
    Command(
        "compare",
        "compare",
        "compare plates: which protects better",
        "Compare plates under the same shots: the measure that decides, ranks, differences with their intervals, and a "
        "figure; every other measure with --all. Of targets with layers, and of limits, a second figure, "
        "FIGURE_weight.png, shows them against their weight. A map and a result of continuum of the same shots are "
        "compared hit by hit, with their maps side by side. A campaign with several plates is run first: each plate "
        "gives NAME.nc. A plate whose result exists is not run again.",
        [
            file(
                "files",
                "RESULT.nc",
                "results, one with references, or a campaign with several [[plate]]",
                nargs="+",
            ),
            output("FIGURE.png", "figure as PNG, PDF or SVG (default: comparison.png, or the campaign's name)"),
            folder("of a campaign: folder of the results NAME.nc (default: the folder of the figure)"),
            measures(),
            flag("--all", "show every measure, every pair of plates, and what was compared how", dest="every"),
            flag("--sensitivity", "of a campaign: rank with each change of what nobody measured, too"),
            *COMPUTING,
            COUNT,
            *earlier("campaign", "an existing figure; of a campaign, compute all plates again"),
        ],
        example="compare campaigns/two_plates.toml, or: warpimpact compare slotted.nc round.nc",
    ),
    Command(
        "limit",
        "studies",
        "find the limit velocity of every hit of a campaign, V50 and V05",
        "Find for every hit the impact velocity at which the core just perforates, with at most 14 runs of a hit. "
        "Write a netCDF file and a figure: the map of the limits, and the share of the hits that perforate against "
        "velocity, with V50 and V05. Also find the limit of the solid plate, or add-on, that is as heavy. The plate "
        "must not weaken by time: give degradation_distance.",
        [
            CAMPAIGN,
            measures("V50 and V05, or H50 and H05 of thicknesses"),
            output("LIMIT.nc", "result file (default: the campaign's name and _limit.nc); the figure is LIMIT.png"),
            choice("--quantity", ("velocity", "thickness"), "what to find (default: velocity)", default="velocity"),
            number("--layer", "layer whose thickness to find (default: 0, the plate)", default=0),
            text("--tolerance", "TOLERANCE", 'width of a limit, such as "0.5 m/s" (default: 1 m/s, 0.01 mm)'),
            *COMPUTING,
            COUNT,
            *earlier("search", "an existing result or an interrupted search"),
        ],
        example="limit campaigns/limit_velocity.toml -o limit.nc",
    ),
    Command(
        "optimise",
        "studies",
        "search the best designs: lightest, safest, and what lies between",
        "Search the free variables of a target for the designs that no other one beats in every objective. Every "
        "design gets the same hits; the front is computed again with fresh hits. Write every design as netCDF, a "
        "campaign file for each design of the front, and a figure. Exit code 4: no design keeps the bounds. Needs pip "
        "install 'warpimpact[optimise]'.",
        [
            file("design", "DESIGN.toml", "design file: a campaign, and what is free"),
            output("FRONT.nc", "result file (default: the design's name, in this folder)"),
            *COMPUTING,
            *earlier("search", "an existing result, its campaigns or an interrupted search"),
        ],
        example="optimise campaigns/designs/lightest_plate.toml -o front.nc",
    ),
    Command(
        "report",
        "share",
        "write a report as one HTML file",
        "Write a report of one or several results as one HTML file that works offline. It shows the campaign, the "
        "plates, interactive maps and trajectories, numbers with intervals, and the limits of the model. A posterior "
        "is reported alone: its parameters, what they explain, and its figures. So is a search for designs: a click on "
        "a point of its front shows the plate, its map and its campaign.",
        [
            RESULTS,
            output("REPORT.html", "report file (default: the name of the first result with .html, in its folder)"),
            number("--trajectories", "hits of each result to replay: the worst, and others (default: 32)", default=32),
            campaign_folder("folder of the files that the campaigns name (default: the folder of each result)"),
            overwrite("an existing report"),
        ],
        example="report slotted.nc -o slotted.html",
    ),
)
"""Commands of a task from names to a report."""

EXPERT = (
    Command(
        "plate",
        "show",
        "draw the plate of a campaign to scale",
        "Draw the plate of a campaign to scale, with the largest section of the core. Print open area, smallest "
        "ligament and areal density. No shot is computed.",
        [
            CAMPAIGN,
            output("PLATE.png", "picture file (default: the campaign's name with _plate, in this folder)"),
            overwrite("an existing picture"),
        ],
        example="plate campaigns/slotted_plate.toml",
    ),
    Command(
        "inspect",
        "show",
        "print what a result contains",
        "Print the origin of a result, its numbers with their intervals, and the shots that failed. Of a sweep, a "
        "posterior, a search, a firing test or a replayed hit print what the command that wrote it prints.",
        [
            RESULT,
            measures(),
            flag("--campaign", "print only the campaign that the result contains"),
        ],
        example="inspect slotted.nc",
    ),
    Command(
        "plot",
        "show",
        "draw maps of a result, or of several results side by side",
        "Draw the figures of a result as PNG files: maps, marginal distributions, residual velocity against tilt, and "
        "maps of uncertainty where shots scatter or an error was estimated. For several results: maps side by side "
        "with the same colour scale.",
        [
            RESULTS,
            folder("existing folder of the pictures (default: the folder of the result)"),
            overwrite("existing pictures"),
            one_of(
                text("--measure", "TEXT", 'the map of this measure of one result, as "P(tilt@130mm > 30 deg)"'),
                text("--variable", "NAME", "the map of this variable of one result, as edge_distance"),
            ),
        ],
        example="plot slotted.nc --folder maps",
    ),
    Command(
        "sensitivity",
        "studies",
        "tell how far numbers move if something unmeasured is otherwise",
        "Compute a campaign with one thing otherwise at a time: resistance, weakening, friction, onset, edges of "
        "holes, obliquity, yaw, stand-off, strength of the core. All rows have the same hits. Print a table, write it "
        "as CSV, and draw a figure of the same name.",
        [
            CAMPAIGN,
            measures("what reaches the base; residual velocity, deflection and tilt"),
            output("TABLE.csv", "table (default: the campaign's name and _sensitivity.csv, in this folder)"),
            number("--hits", "hits of each row (default: 256)", least=16, default=256),
            DEVICE,
            overwrite("an existing table and its figure"),
        ],
        example="sensitivity campaigns/slotted_plate.toml",
    ),
    Command(
        "sweep",
        "studies",
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
            *earlier("sweep", "an existing sweep with its points and its figure"),
        ],
        example="sweep campaigns/obliquity_sweep.toml -o sweep.nc",
    ),
    Command(
        "test",
        "studies",
        "V50 of fired shots; simulate firing tests and plans of proof",
        "SHOTS.csv has a column of velocities and one that says whether each shot perforated: print and draw V50 by "
        "maximum likelihood and by MIL-STD-662F, spread, and interval. TEST.toml simulates a test: fire a procedure "
        "many times at a target whose limit velocities are known or are searched first. Print and draw what the tests "
        "report and the truth, and the operating characteristic of n shots with at most k perforations. The limits of "
        "a campaign go to TEST_limits.nc, which a later call takes with --resume.",
        [
            file("test", "SHOTS.csv|TEST.toml", "fired shots, or a test to simulate"),
            output("FILE", "result: SHOTS_v50.csv of shots, or TEST.nc; the figure has its name with .png"),
            *COMPUTING,
            COUNT,
            *earlier("test", "an existing result with its figure and its limits"),
        ],
        example="test shots.csv",
    ),
    Command(
        "replay",
        "share",
        "compute a hit of a result again, with its history",
        "Compute a hit of a result again on the CPU. Write its history as netCDF and PNG files. The end has the bits "
        "of the stored outcome if the same kind of CPU and the same version computed the result. If a GPU computed it, "
        "both agree within rounding.",
        [
            RESULT,
            option("--hit", type=int, required=True, metavar="N", help="number of the hit in the result, from 0"),
            output("HIT.nc", "history file (default: RESULT_hitN.nc in the folder of the result)"),
            campaign_folder("folder of the files that the campaign names (default: the result's folder)"),
            number("--snapshots", "instants that show what is left of the target (default: 6)", least=2, default=6),
            file("--animation", "HIT.gif", "also write a film of the hit; HIT.mp4 needs FFmpeg"),
            overwrite("an existing history"),
        ],
        example="replay slotted.nc --hit 34",
    ),
    Command(
        "export",
        "share",
        "write a result as CSV, a hit for ParaView, or a plate as a drawing",
        "Write a result as CSV, one row per hit. Or write the history of a hit as a folder of VTK files; open its "
        "core.pvd and plate.pvd in ParaView. VTK needs: pip install 'warpimpact[vtk]'. Or write the holes of a "
        "campaign's plate as an SVG or DXF drawing in mm. DXF needs: pip install 'warpimpact[cad]'.",
        [
            file("file", "RESULT.nc|HIT.nc|CAMPAIGN.toml", "written by warpimpact run or replay, or a campaign file"),
            output("FILE", "CSV file or drawing (default: the file's name with .csv or .svg, in its folder)"),
            folder("new folder of VTK files (default: the name of the history with _vtk, in its folder)"),
            overwrite("an existing file"),
        ],
        example="export slotted.nc -o slotted.csv",
    ),
    Command(
        "continuum",
        "continuum",
        "compute hits by finite elements",
        "Compute hits of a campaign, or some of those of a result, by explicit finite elements of the target, which "
        "take seconds to minutes of a core each, and write a result as run does. A GPU computes hundreds at a time. "
        "compare takes it together with a result of the fast law. Its materials have constants of their own "
        "(docs/continuum.md). Options come before the campaign's table [continuum].",
        [
            file("file", "FILE", "a campaign, or a result of warpimpact run"),
            output("RESULT.nc", "result file (default: the file's name with _continuum, in this folder)"),
            COUNT,
            one_of(
                number("--hit", "of a result: this hit; may be given several times", action="append"),
                number("--hits", "of a result: number of hits, spread over the map", least=1),
            ),
            text(
                "--material",
                "NAME",
                "material of the continuum, or a TOML file; again for each layer behind (default: the campaign's)",
                action="append",
            ),
            text("--friction", "MU", "between core and target (default: continuum.friction)", type=float),
            choice("--fidelity", ("draft", "standard", "reference"), "size of the elements (default: the campaign's)"),
            text("--element", "LENGTH", 'size of the elements, such as "0.5 mm", in place of a fidelity'),
            *COMPUTING,
            *earlier("computation", "an existing result or an interrupted computation"),
        ],
        example="continuum campaigns/slotted_plate.toml --count 4 --material ARMOX560T -o continuum.nc",
    ),
    Command(
        "identify",
        "studies",
        "find parameters with their uncertainty from measured shots",
        "Find the parameters of plate, interaction and core that agree with measured shots, each with its uncertainty. "
        "Unknown hit points are integrated out. Write the posterior as a netCDF file, the draws of the material as a "
        "CSV file that hits.file takes, and figures into the same folder. Print which parameters the shots determine, "
        "and whether the computation has converged.",
        [
            file("fit", "FIT", "fit file, or a result of warpimpact continuum, whose hits count as measured shots"),
            output("POSTERIOR.nc", "file of the posterior (default: the fit's name, in this folder)"),
            *COMPUTING,
            overwrite("an existing posterior"),
        ],
        example="identify campaigns/fits/paper_fit.toml -o paper_fit.nc",
    ),
    Command(
        "validate",
        "show",
        "compute the published shots and compare",
        "Compute the paper's two shots. Compare them with the paper's model, its experiment and LS-DYNA. Of a result, "
        "tell the hits that come closest to the two shots.",
        [
            file("campaign", "FILE", "the paper's two shots (default: paper_shots), or a result", nargs="?"),
            DEVICE,
        ],
        example="validate",
    ),
    Command(
        "schema",
        "start",
        "print the JSON schema of campaign files, for editors",
        "Print the JSON schema of campaign files. An editor that knows TOML, such as VS Code with Even Better TOML, "
        f"completes and checks a campaign whose first line is: #:schema {SCHEMA}",
        [
            one_of(
                *(
                    option(
                        f"--{kind}",
                        action="store_const",
                        const=kind,
                        dest="kind",
                        default="campaign",
                        help=f"print the schema of {kind}s, which warpimpact {command} takes",
                    )
                    for kind, command in (("fit", "identify"), ("test", "test"), ("design", "optimise"))
                )
            ),
            output("SCHEMA.json", "file (default: printed)"),
            overwrite("an existing file"),
        ],
        example=f"schema -o {SCHEMA}",
    ),
)
"""Commands for experts."""
