"""The command test: what a firing test would report of a target, and the error of that report."""

import argparse
from pathlib import Path

from .mistakes import memory_told
from .options import Commands, add_command, add_computing, add_count, add_earlier, add_output, executor_of
from .paths import check_output, check_picture, check_suffix
from .progress import Step, show_progress, show_run, warn


def add_test(commands: Commands) -> None:
    parser = add_command(
        commands,
        "test",
        _test,
        summary="simulate firing tests: V50, its interval, proof at a confidence",
        description="Fire a test procedure many times at a target whose limit velocities are known or are searched "
        "first. Print and draw what the tests report beside the truth: V50, spread, how often the interval holds, how "
        "many shots a precision takes, and the operating characteristic of n shots with at most k perforations. The "
        "limits of a campaign go to TEST_limits.nc, which a later call takes with --resume.",
        example="test campaigns/firing/v50_test.toml -o v50_test.nc",
    )
    parser.add_argument("test", type=Path, metavar="TEST.toml", help="test file: target, procedure, gun, questions")
    add_output(parser, "TEST.nc", "result file (default: the test's name, in this folder); the figure is TEST.png")
    add_computing(parser)
    add_count(parser)
    resume = "keep the limits that are computed, and continue what was interrupted"
    add_earlier(parser, "test", "an existing result with its figure and its limits", resume=resume)


def _test(arguments: argparse.Namespace) -> None:
    from warpimpact.campaign.text import CampaignError
    from warpimpact.firing.firing_view import firing_view
    from warpimpact.firing.known_target import directions_of, response_of
    from warpimpact.firing.plan_file import read_test
    from warpimpact.firing.repeated import simulate_test
    from warpimpact.plotting.firing import directions_figure, firing_figure
    from warpimpact.results import files
    from warpimpact.view.view import text_of

    test = read_test(arguments.test)
    output = arguments.output or Path(arguments.test.stem + ".nc")
    picture = output.with_suffix(".png")
    replace = arguments.overwrite or arguments.resume
    check_suffix(output, "a test", ".nc")
    check_output(output, overwrite=replace)
    polar = picture.with_name(f"{picture.stem}_directions.png")
    for path in (picture, polar):
        check_picture(path, overwrite=replace)
    resume, overwrite = arguments.resume, arguments.overwrite
    with memory_told(arguments.test), executor_of(arguments) as executor:
        with show_run() as progress:
            response, attributes = response_of(
                test,
                output,
                executor=executor,
                count=arguments.count,
                resume=resume,
                overwrite=overwrite,
                progress=progress,
                tell=warn,
            )
        with (
            show_progress("direction") as show,
            directions_of(
                test,
                output,
                executor=executor,
                resume=resume,
                overwrite=overwrite,
                progress=lambda done, total: show(Step(done, total)),
                tell=warn,
            ) as sector,
        ):
            try:
                dataset = simulate_test(test, response, attributes, sector)
            except ValueError as error:
                raise CampaignError(f"{arguments.test}: {error}") from None
            files.write(dataset, output)
    print(text_of(firing_view(dataset)))
    figures = {picture: firing_figure} if test.needs_limits else {}
    if test.directions is not None:
        figures[polar] = directions_figure
    for path, draw in figures.items():
        draw(dataset).savefig(path, dpi=150)
    print(f"written to {output}, figure in {' and '.join(map(str, figures))}")
