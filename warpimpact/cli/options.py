"""Arguments that several commands take."""

import argparse
from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path
from typing import TYPE_CHECKING, TypeAlias

if TYPE_CHECKING:
    from warpimpact.runs.executor import Executor

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
Command: TypeAlias = Callable[[argparse.Namespace], int | None]


def add_command(
    commands: Commands, name: str, command: Command, *, summary: str, description: str, example: str
) -> argparse.ArgumentParser:
    """Add a command and return its parser. `command` returns the exit code; None means 0.

    Args:
        summary: the line of the command in `warpimpact --help`.
        example: a command line, without the program's name.
    """
    parser = commands.add_parser(name, description=description, epilog=f"example: warpimpact {example}")
    parser.set_defaults(command=command, summary=summary)
    volume = parser.add_mutually_exclusive_group()
    volume.add_argument("-v", "--verbose", action="count", default=0, help="show what is done; -vv shows more")
    volume.add_argument("-q", "--quiet", action="store_true", help="show no progress")
    return parser


def add_campaign(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "campaign", type=Path, metavar="CAMPAIGN.toml", help="campaign file: core, plate, shots and numerics"
    )


def add_result(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("result", type=Path, metavar="RESULT.nc", help="written by warpimpact run")


def add_results(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("results", type=Path, nargs="+", metavar="RESULT.nc", help="written by warpimpact run")


def add_output(parser: argparse.ArgumentParser, metavar: str, text: str) -> None:
    parser.add_argument("-o", "--output", type=Path, metavar=metavar, help=text)


def add_measures(parser: argparse.ArgumentParser, default: str = "the measures of docs/protection.md") -> None:
    """Add `--measure`, the measures of the results; `default` says what is shown without it."""
    parser.add_argument(
        "--measure",
        action="append",
        default=[],
        metavar="TEXT",
        help='what is asked, such as "worst_tenth(residual_energy_density@130mm)", "P(inclination > 40 deg)" or V50; '
        f"may be given several times (default: {default})",
    )


def add_earlier(parser: argparse.ArgumentParser, what: str, replaced: str, *, resume: str = "") -> None:
    """Add `--resume` and `--overwrite`: what happens to an earlier computation.

    Args:
        what: name of the computation.
        replaced: what `--overwrite` replaces.
        resume: what `--resume` does, in other words than those for any computation.
    """
    usual = f"continue an interrupted {what}; start a new one if there is none"
    parser.add_argument("--resume", action="store_true", help=resume or usual)
    add_overwrite(parser, replaced)


def add_overwrite(parser: argparse.ArgumentParser, replaced: str) -> None:
    parser.add_argument("--overwrite", action="store_true", help=f"replace {replaced}")


def add_count(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--count", type=int, metavar="N", help="number of hits, instead of the campaign's")


def add_campaign_folder(parser: argparse.ArgumentParser, text: str) -> None:
    parser.add_argument("--campaign-folder", type=Path, metavar="FOLDER", help=text)


def add_device(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--device",
        default="auto",
        metavar="auto|cpu|cuda:0",
        help="where to compute (default: auto, which is a GPU if there is one); a run takes several: cuda:0,cuda:1",
    )


def add_computing(parser: argparse.ArgumentParser) -> None:
    """Add the options on where to compute: a device, processes, or a cluster; `executor_of` reads them."""
    add_device(parser)
    cluster = parser.add_mutually_exclusive_group()
    cluster.add_argument("--scheduler", metavar="ADDRESS", help="compute on the workers of this Dask scheduler")
    cluster.add_argument("--workers", type=at_least(1), metavar="N", help="compute in N processes on this machine")


def executor_of(arguments: argparse.Namespace) -> "AbstractContextManager[Executor]":
    """The executor that the options of `add_computing` ask for."""
    from warpimpact.runs.executor import executor_for

    return executor_for(arguments.device, workers=arguments.workers, scheduler=arguments.scheduler)


def at_least(least: int) -> Callable[[str], int]:
    """Return a parser of whole numbers that are at least `least`."""

    def whole_number(text: str) -> int:
        if (number := int(text)) < least:
            raise argparse.ArgumentTypeError(f"got {number}, but it must be at least {least}")
        return number

    return whole_number
