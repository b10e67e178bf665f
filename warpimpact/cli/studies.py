"""The commands limit, sweep and sensitivity: one campaign with other inputs."""

import argparse
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

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


@contextmanager
def show_rows() -> Iterator[Callable[[int, int], None]]:
    """Show the progress of a study of sensitivity."""
    with show_progress() as show:
        yield lambda done, total: show(Step(done, total))


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
    with show_rows() as progress:
        table = sensitivity(
            campaign,
            hits=arguments.hits,
            measures=arguments.measure,
            device=arguments.device,
            progress=progress,
        )
    print(table.to_string(float_format="{:.4g}".format, na_rep="-"))
    print(largest_move(table))
    table.to_csv(output)
    sensitivity_figure(table, campaign.title, arguments.hits).savefig(picture, dpi=150)
    print(f"written to {output}, figure in {picture}")
