"""The commands limit, sweep, sensitivity, test, optimise and identify: many runs, one answer."""

import argparse
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .mistakes import say
from .options import (
    Commands,
    add_campaign,
    add_command,
    add_computing,
    add_count,
    add_device,
    add_earlier,
    add_measures,
    add_output,
    add_overwrite,
    at_least,
    executor_of,
)
from .paths import check_output, check_picture, check_place, check_result, check_suffix, replaces
from .progress import Step, show_progress, show_run, warn
from .run import add_run_options, failure_code, run_shown

if TYPE_CHECKING:
    from warpimpact.identification.identify import FitProgress


def add_limit(commands: Commands) -> None:
    parser = add_command(
        commands,
        "limit",
        _limit,
        summary="find the limit velocity of every hit of a campaign, V50 and V05",
        description="Find for every hit the impact velocity at which the core just perforates, with at most 14 runs of "
        "a hit. Write a netCDF file and a figure: the map of the limits, and the share of the hits that perforate "
        "against velocity, with V50 and V05. Also find the limit of the solid plate, or add-on, that is as "
        "heavy. The plate must not weaken by time: give degradation_distance.",
        example="limit campaigns/limit_velocity.toml -o limit.nc",
    )
    add_campaign(parser)
    add_measures(parser, "V50 and V05, or H50 and H05 of thicknesses")
    add_output(parser, "LIMIT.nc", "result file (default: the campaign's name and _limit.nc); the figure is LIMIT.png")
    parser.add_argument(
        "--quantity",
        choices=("velocity", "thickness"),
        default="velocity",
        help="what to find: the impact velocity, or the thickness of the plate (default: velocity)",
    )
    parser.add_argument(
        "--layer",
        type=at_least(0),
        default=0,
        metavar="N",
        help="layer whose thickness to find: 0 is the plate (default), 1 the first layer behind it",
    )
    parser.add_argument(
        "--tolerance",
        metavar="TOLERANCE",
        help='how far the two ends of a limit may lie apart, such as "0.5 m/s" or "0.02 mm" (default: 1 m/s, 0.01 mm)',
    )
    add_run_options(parser, "search")


def _limit(arguments: argparse.Namespace) -> int:
    from warpimpact.analysis.summary import range_note
    from warpimpact.campaign.campaign import Campaign
    from warpimpact.plotting.limit import limit_figure
    from warpimpact.results import files
    from warpimpact.studies.limit import LimitMap, warning_of
    from warpimpact.studies.limit_view import limit_view
    from warpimpact.view.view import text_of

    is_sought = arguments.quantity == "velocity"
    campaign = Campaign.from_toml(arguments.campaign, count=arguments.count, needs_velocity=not is_sought)
    output = arguments.output or Path(arguments.campaign.stem + "_limit.nc")
    picture = output.with_suffix(".png")
    check_place(output)
    check_picture(picture, overwrite=replaces(arguments, output))
    computation = LimitMap.of(campaign, arguments.quantity, _tolerance(arguments), arguments.layer)
    computation.check(arguments.measure)
    if sentence := warning_of(campaign, arguments.quantity):
        warn(sentence)
    run_shown(campaign, output, arguments, computation)
    dataset = files.read(output)
    print(text_of(limit_view(dataset, arguments.measure)))
    for line in range_note({"": dataset}, str(output)):
        print(line)
    limit_figure(dataset).savefig(picture, dpi=150)
    print(f"written to {output}, figure in {picture}")
    return failure_code(dataset, output)


def _tolerance(arguments: argparse.Namespace) -> float | None:
    """The tolerance in SI; None where none is given."""
    from warpimpact.campaign.text import CampaignError
    from warpimpact.scene.units import PositiveLength, PositiveSpeed, quantity

    if arguments.tolerance is None:
        return None
    kind: Any = PositiveSpeed if arguments.quantity == "velocity" else PositiveLength
    try:
        tolerance: float = quantity(kind)(arguments.tolerance)
    except ValueError as error:
        raise CampaignError(f"--tolerance: {error}") from None
    if not tolerance > 0.0:
        raise CampaignError(f'--tolerance: got "{arguments.tolerance}", but it must be greater than 0')
    return tolerance


def add_sweep(commands: Commands) -> None:
    parser = add_command(
        commands,
        "sweep",
        _sweep,
        summary="run a campaign at every combination of some inputs",
        description="Run a campaign with a table [sweep] at every combination of the values in it. Write a netCDF "
        "file with a dimension for each input, and a figure of the same name. The folder SWEEP_points has the result "
        "of every point, which the other commands take.",
        example="sweep campaigns/obliquity_sweep.toml -o sweep.nc",
    )
    add_campaign(parser)
    add_measures(parser, "velocity, deflection and tilt behind the target, and the share that passes")
    add_output(parser, "SWEEP.nc", "file of the sweep (default: the campaign's name, in this folder)")
    add_computing(parser)
    add_count(parser)
    resume = "keep the points that are complete, and compute the rest"
    add_earlier(parser, "sweep", "an existing sweep with its points and its figure", resume=resume)


def _sweep(arguments: argparse.Namespace) -> None:
    from warpimpact.analysis.sweep_view import sweep_view
    from warpimpact.plotting.sweep import sweep_figure
    from warpimpact.results import files
    from warpimpact.results.kinds import SWEEP
    from warpimpact.studies.sweep import folder_of, read_sweep, run_sweep
    from warpimpact.view.view import text_of

    sweep = read_sweep(arguments.campaign, count=arguments.count)
    sweep.check(arguments.measure)
    output = arguments.output or Path(arguments.campaign.stem + ".nc")
    picture = output.with_suffix(".png")
    check_result(output, "a sweep")
    check_picture(picture, overwrite=replaces(arguments, output))

    with show_run() as follow, executor_of(arguments) as executor:

        def named(name: str) -> Any:
            print(f"point {name}", file=sys.stderr)
            return follow

        run_sweep(
            sweep,
            output,
            device=executor,
            resume=arguments.resume,
            overwrite=arguments.overwrite,
            progress=named,
            tell=warn,
        )
    dataset = files.read(output, SWEEP)
    print(text_of(sweep_view(dataset, arguments.measure)))
    sweep_figure(dataset, arguments.measure).savefig(picture, dpi=150)
    for written in (output, folder_of(output), picture):
        print(written)


def add_sensitivity(commands: Commands) -> None:
    parser = add_command(
        commands,
        "sensitivity",
        _sensitivity,
        summary="tell how far numbers move if something unmeasured is otherwise",
        description="Compute a campaign with one thing otherwise at a time: resistance, weakening, friction, onset, "
        "edges of holes, obliquity, yaw, stand-off, strength of the core. All rows have the same hits. Print a table, "
        "write it as CSV, and draw a figure of the same name.",
        example="sensitivity campaigns/slotted_plate.toml",
    )
    add_campaign(parser)
    add_measures(parser, "what reaches the base; residual velocity, deflection and tilt")
    add_output(parser, "TABLE.csv", "table (default: the campaign's name and _sensitivity.csv, in this folder)")
    parser.add_argument("--hits", type=at_least(16), default=256, metavar="N", help="hits of each row (default: 256)")
    add_device(parser)
    add_overwrite(parser, "an existing table and its figure")


def _sensitivity(arguments: argparse.Namespace) -> None:
    from warpimpact.campaign.campaign import Campaign
    from warpimpact.plotting.sensitivity import sensitivity_figure
    from warpimpact.studies.sensitivity import largest_move, sensitivity

    campaign = Campaign.from_toml(arguments.campaign)
    output = arguments.output or Path(f"{arguments.campaign.stem}_sensitivity.csv")
    picture = output.with_suffix(".png")
    check_suffix(output, "a table", ".csv")
    check_output(output, overwrite=arguments.overwrite)
    check_picture(picture, overwrite=arguments.overwrite)
    with show_progress() as show:
        table = sensitivity(
            campaign,
            hits=arguments.hits,
            measures=arguments.measure,
            device=arguments.device,
            progress=lambda done, total: show(Step(done, total)),
        )
    print(table.to_string(float_format="{:.4g}".format, na_rep="-"))
    print(largest_move(table))
    table.to_csv(output)
    sensitivity_figure(table, campaign.title, arguments.hits).savefig(picture, dpi=150)
    print(f"written to {output}, figure in {picture}")


def add_test(commands: Commands) -> None:
    parser = add_command(
        commands,
        "test",
        _test,
        summary="V50 of fired shots; simulate firing tests and plans of proof",
        description="SHOTS.csv has a column of velocities and one that says whether each shot perforated: print and "
        "draw V50 by maximum likelihood and by MIL-STD-662F, spread, and interval. TEST.toml simulates a test: fire a "
        "procedure many times at a target whose limit velocities are known or are searched first. Print and draw what "
        "the tests report beside the truth, and the operating characteristic of n shots with at most k perforations. "
        "The limits of a campaign go to TEST_limits.nc, which a later call takes with --resume.",
        example="test shots.csv",
    )
    parser.add_argument("test", type=Path, metavar="SHOTS.csv|TEST.toml", help="fired shots, or a test to simulate")
    add_output(parser, "FILE", "figure SHOTS.png of shots, or result TEST.nc, with its figure beside it")
    add_computing(parser)
    add_count(parser)
    resume = "keep the limits that are computed, and continue what was interrupted"
    add_earlier(parser, "test", "an existing result with its figure and its limits", resume=resume)


def _test(arguments: argparse.Namespace) -> None:
    if arguments.test.suffix.lower() == ".csv":
        _evaluate(arguments)
    else:
        _simulate(arguments)


def _evaluate(arguments: argparse.Namespace) -> None:
    from warpimpact.firing.v50 import read_shots, v50
    from warpimpact.plotting.firing import shots_figure

    picture = arguments.output or Path(arguments.test.stem + ".png")
    check_picture(picture, overwrite=arguments.overwrite)
    shots = read_shots(arguments.test)
    found = v50(*shots)
    print(found)
    shots_figure(shots, found, arguments.test.stem).savefig(picture, dpi=150)
    print(f"figure in {picture}")


def _simulate(arguments: argparse.Namespace) -> None:
    from warpimpact.firing.plan import read_test
    from warpimpact.firing.simulate import response_of, simulate_test
    from warpimpact.firing.view import firing_view
    from warpimpact.plotting.firing import firing_figure
    from warpimpact.results import files
    from warpimpact.view.view import text_of

    test = read_test(arguments.test)
    output = arguments.output or Path(arguments.test.stem + ".nc")
    picture, resume, overwrite = output.with_suffix(".png"), arguments.resume, arguments.overwrite
    check_suffix(output, "a test", ".nc")
    for path in (output, picture):
        check_output(path, overwrite=overwrite or resume)
    with executor_of(arguments) as executor, show_run() as progress:
        options = {"resume": resume, "overwrite": overwrite, "progress": progress, "tell": warn}
        response = response_of(test, output, executor=executor, count=arguments.count, **options)
    dataset = simulate_test(test, response)
    files.write(dataset, output)
    print(text_of(firing_view(dataset)))
    firing_figure(dataset).savefig(picture, dpi=150)
    print(f"written to {output}, figure in {picture}")


NONE_WITHIN_BOUNDS = 4
"""Exit code where no computed design keeps the bounds."""


def add_optimise(commands: Commands) -> None:
    parser = add_command(
        commands,
        "optimise",
        _optimise,
        summary="search the best designs: lightest, safest, and what lies between",
        description="Search the free variables of a target for the designs that no other one beats in every objective. "
        "Every design gets the same hits; the front is computed again with fresh hits. Write every design as netCDF, "
        "a campaign file for each design of the front, and a figure. Exit code 4: no design keeps the bounds. Needs "
        "pip install 'warpimpact[optimise]'.",
        example="optimise campaigns/designs/lightest_plate.toml -o front.nc",
    )
    parser.add_argument("design", type=Path, metavar="DESIGN.toml", help="design file: a campaign, and what is free")
    add_output(parser, "FRONT.nc", "result file (default: the design's name, in this folder)")
    add_computing(parser)
    add_earlier(parser, "search", "an existing result, its campaigns or an interrupted search")


def _optimise(arguments: argparse.Namespace) -> int:
    from warpimpact.optimisation.design import read_design
    from warpimpact.optimisation.front_view import front_view
    from warpimpact.optimisation.optimise import folder_of, optimise_to_file
    from warpimpact.plotting.front import front_figure
    from warpimpact.results import files, front
    from warpimpact.results.kinds import FRONT
    from warpimpact.view.view import text_of

    design = read_design(arguments.design)
    output = arguments.output or Path(arguments.design.stem + ".nc")
    check_result(output, "a search")
    picture = output.with_suffix(".png")
    check_picture(picture, overwrite=replaces(arguments, output))
    with (
        show_progress("design") as show,
        executor_of(arguments) as executor,
    ):
        campaigns = optimise_to_file(
            design,
            output,
            device=executor,
            resume=arguments.resume,
            overwrite=arguments.overwrite,
            progress=lambda now: show(Step(now.done, now.total, text=f"{now.front} on the front, {now.what}")),
            tell=warn,
        )
    dataset = files.read(output, FRONT)
    print(text_of(front_view(dataset)))
    front_figure(dataset, design.folder).savefig(picture, dpi=150)
    beside = f", campaigns in {folder_of(output)}" if campaigns else ""
    print(f"written to {output}, figure in {picture}{beside}")
    return 0 if dataset.attrs[front.OUTCOME] == front.FEASIBLE else NONE_WITHIN_BOUNDS


PROCESSES = 16
"""Most processes of a fit, unless the user gives a number; each takes some 0.4 GB."""
WORTHWHILE = 2.0
"""Seconds of computing after which processes are started. A process needs as long until it computes."""


def add_identify(commands: Commands) -> None:
    parser = add_command(
        commands,
        "identify",
        _identify,
        summary="find parameters with their uncertainty from measured shots",
        description="Find the parameters of plate, interaction and core that agree with measured shots, each with its "
        "uncertainty. Unknown hit points are integrated out. Write the posterior as a netCDF file, the draws "
        " of the material as a CSV file that hits.file takes, and figures into the same folder. Print which "
        "parameters the shots determine, and whether the computation has converged.",
        example="identify campaigns/fits/paper_fit.toml -o paper_fit.nc",
    )
    parser.add_argument(
        "fit",
        type=Path,
        metavar="FIT",
        help="fit file: scene, measured shots, and priors of what is unknown; or a result of warpimpact continuum, "
        "whose hits then count as measured shots",
    )
    add_output(parser, "POSTERIOR.nc", "file of the posterior (default: the fit's name, in this folder)")
    add_computing(parser)
    add_overwrite(parser, "an existing posterior")


def _identify(arguments: argparse.Namespace) -> int:
    from warpimpact.identification.computed_shots import fit_of_result
    from warpimpact.identification.fit_file import read_fit
    from warpimpact.identification.identify import identify
    from warpimpact.identification.posterior import material_draws, posterior_view
    from warpimpact.plotting.posterior import FIGURES
    from warpimpact.results import files
    from warpimpact.results.posterior_file import INTERRUPTED
    from warpimpact.runs.executor import executor_for
    from warpimpact.solver.device import cores, find_device
    from warpimpact.view.view import text_of

    by_elements = arguments.fit.suffix == ".nc"
    fit = fit_of_result(arguments.fit) if by_elements else read_fit(arguments.fit)
    output = arguments.output or Path(f"{arguments.fit.stem}_fit.nc" if by_elements else f"{arguments.fit.stem}.nc")
    check_result(output, "a posterior")
    check_output(output, overwrite=arguments.overwrite)
    pictures = {output.with_name(f"{output.stem}_{name}.png"): draw for name, draw in FIGURES.items()}
    table = output.with_suffix(".csv")
    check_output(table, overwrite=arguments.overwrite)
    for picture in pictures:
        check_picture(picture, overwrite=arguments.overwrite)
    for sentence in fit.warnings:
        warn(sentence)
    device, workers, scheduler = arguments.device, arguments.workers, arguments.scheduler
    after = 0.0
    if workers is None and scheduler is None and find_device(device).is_cpu:
        workers, after = min(cores(), PROCESSES), WORTHWHILE
    say(f"computes at most {fit.sampling.sets} sets of parameters, {fit.sampling.hits} hits of each shot")
    with (
        show_progress("set") as show,
        executor_for(device, workers=workers, scheduler=scheduler, apart=True, after=after) as executor,
    ):
        posterior = identify(
            fit,
            device=executor,
            progress=lambda now: show(Step(now.done, now.total, text=_running(now))),
        )
    files.write(posterior, output)
    print(text_of(posterior_view(posterior)))
    print(f"written to {output}")
    if len(draws := material_draws(fit, posterior)):
        draws.to_csv(table, index=False)
        print(f"draws of the material for hits.file in {table}")
    for picture, draw in pictures.items():
        draw(posterior).savefig(picture, dpi=150)
        print(picture)
    return 130 if posterior.attrs[INTERRUPTED] else 0


def _running(now: "FitProgress") -> str:
    effective = "" if now.effective != now.effective else f", effective sample size {now.effective:.0f}"
    return f"smallest misfit {now.misfit:.3g}{effective}"
