"""The command limit: the impact velocity, or the thickness of plate, that every hit of a campaign just perforates."""

import argparse
from pathlib import Path
from typing import Any

from .options import Commands, add_campaign, add_command, add_measures, add_output, at_least
from .paths import check_picture, check_place, replaces
from .progress import warn
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
