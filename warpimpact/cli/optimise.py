"""The command optimise: the best designs of a target."""

import argparse
from pathlib import Path

from .options import Commands, add_command, add_computing, add_earlier, add_output, executor_of
from .paths import check_picture, check_result, replaces
from .progress import Step, show_progress, warn

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
