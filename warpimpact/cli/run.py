"""The command run: compute the hit map of a campaign."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from warpimpact.results import attributes as attr

from .mistakes import say
from .options import (
    Commands,
    add_campaign,
    add_command,
    add_computing,
    add_count,
    add_earlier,
    add_output,
    executor_of,
)
from .paths import check_result
from .progress import show_run, warn

if TYPE_CHECKING:
    from warpimpact.campaign.campaign import Campaign
    from warpimpact.results.table import Result
    from warpimpact.runs.compute import Computation


def add_run(commands: Commands) -> None:
    parser = add_command(
        commands,
        "run",
        _run,
        summary="compute the hit map of a campaign",
        description="Compute every hit of a campaign and write a netCDF file.",
        example="run campaigns/slotted_plate.toml -o slotted.nc --count 512",
    )
    add_campaign(parser)
    add_output(parser, "RESULT.nc", "result file (default: the campaign's name, in this folder)")
    add_run_options(parser, "run")


def _run(arguments: argparse.Namespace) -> int:
    from warpimpact.analysis.summary import promise_text, range_note, summary_text, symmetry_text
    from warpimpact.campaign.campaign import Campaign
    from warpimpact.results.netcdf import open_table

    campaign = Campaign.from_toml(arguments.campaign, count=arguments.count)
    output = arguments.output or Path(arguments.campaign.stem + ".nc")
    check_result(output, "a result")
    run_shown(campaign, output, arguments)
    with open_table(output) as dataset:
        print(summary_text(dataset))
        if attr.SYMMETRIES in dataset.attrs:
            print(symmetry_text(dataset))
        if (promise := promise_text(dataset)) is not None:
            print(promise)
        for line in range_note({"": dataset}, str(output)):
            print(line)
        print(f"{dataset.attrs[attr.HITS_PER_SECOND]:.4g} hits per second on {dataset.attrs[attr.DEVICE]}")
        print(f"written to {output}")
        return failure_code(dataset, output)


def add_run_options(parser: argparse.ArgumentParser, what: str) -> None:
    """Options of a command that computes every hit: device, number of hits, and what happens to an earlier computation,
    which `what` names."""
    add_computing(parser)
    add_count(parser)
    add_earlier(parser, what, f"an existing result or an interrupted {what}")


def run_shown(
    campaign: "Campaign", output: Path, arguments: argparse.Namespace, computation: "Computation | None" = None
) -> None:
    """Compute every hit of a campaign into a file as the options say, and show the progress.

    Args:
        arguments: parsed options, including those of `add_run_options`.
        computation: what is computed of every hit; a hit map if None.
    """
    from warpimpact.runs.compute import HIT_MAP
    from warpimpact.runs.run import run_to_file

    with show_run() as progress, executor_of(arguments) as executor:
        run_to_file(
            campaign,
            output,
            device=executor,
            computation=computation or HIT_MAP,
            resume=arguments.resume,
            overwrite=arguments.overwrite,
            progress=progress,
            tell=warn,
        )


def failure_code(dataset: "Result", path: Path) -> int:
    """3 if more shots failed than the campaign allows, with a message; else 0."""
    from warpimpact.results.dataset import failed

    share = float(failed(dataset).mean())
    allowed = dataset.attrs[attr.FAILED_SHARE]
    if share <= allowed:
        return 0
    say(
        f"{share:.3g} of the shots failed, more than output.failed_share = {allowed:g}; "
        f"warpimpact inspect {path} lists them"
    )
    return 3
