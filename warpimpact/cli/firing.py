"""The command test: V50 of fired shots, or what a simulated firing test would report of a target."""

import argparse
from pathlib import Path

from .options import Commands, add_command, add_computing, add_count, add_earlier, add_output, executor_of
from .paths import check_output, check_picture, check_suffix
from .progress import show_run, warn


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
