"""The command sensitivity: how far numbers move if one thing that nobody measured is otherwise."""

import argparse
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path

from .options import Commands, add_campaign, add_command, add_device, add_measures, add_output, add_overwrite, at_least
from .paths import check_output, check_picture, check_suffix
from .progress import Step, show_progress


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
    add_hits(parser)
    add_device(parser)
    add_overwrite(parser, "an existing table and its figure")


def add_hits(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--hits", type=at_least(16), default=256, metavar="N", help="hits of each row (default: 256)")


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
