"""The command run: compute the hit map of a campaign."""

import argparse
from pathlib import Path
from typing import Any

import xarray

from warpimpact.analysis.inspection import promise_text, range_note, summary_text, symmetry_text
from warpimpact.campaign.campaign import Campaign
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results.dataset import failed
from warpimpact.runs.run import run_to_file

from .messages import say, warn
from .paths import check_output
from .progress import show_run


def run_command(arguments: argparse.Namespace) -> int:
    campaign = Campaign.from_toml(arguments.campaign, count=arguments.count)
    output = arguments.output or Path(arguments.campaign.stem + ".nc")
    check_output(output, ".nc", overwrite=True)
    with show_run(arguments) as progress:
        run_to_file(campaign, output, progress=progress, **computing(arguments))
    with files.opened(output) as dataset:
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


def computing(arguments: argparse.Namespace) -> dict[str, Any]:
    """The options of a computation into a file, as `run_to_file` takes them."""
    names = ("device", "workers", "scheduler", "resume", "overwrite")
    return {name: getattr(arguments, name) for name in names} | {"warn": warn}


def failure_code(dataset: xarray.Dataset, path: Path) -> int:
    """Return 3, with a message, if more shots failed than the campaign allows; else 0."""
    share = float(failed(dataset).mean())
    allowed = dataset.attrs[attr.FAILED_SHARE]
    if share <= allowed:
        return 0
    say(
        f"{share:.3g} of the shots failed, more than output.failed_share = {allowed:g}; "
        f"warpimpact inspect {path} lists them"
    )
    return 3
