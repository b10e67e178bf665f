"""The command sweep: one campaign at every combination of some values of its inputs."""

import argparse
import sys
from pathlib import Path
from typing import Any

from .options import (
    Commands,
    add_campaign,
    add_command,
    add_computing,
    add_count,
    add_earlier,
    add_measures,
    add_output,
    executor_of,
)
from .paths import check_picture, check_result, replaces
from .progress import show_run, warn


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
