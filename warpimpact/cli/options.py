"""Arguments that several commands take."""

import argparse
from collections.abc import Callable
from pathlib import Path
from typing import TypeAlias

Commands: TypeAlias = "argparse._SubParsersAction[argparse.ArgumentParser]"
Command: TypeAlias = Callable[[argparse.Namespace], int | None]


def add_command(
    commands: Commands, name: str, command: Command, *, summary: str, description: str, example: str
) -> argparse.ArgumentParser:
    """The parser of a new command, of which `command` returns the exit code, None for 0.

    Args:
        summary: its line in the help of all commands.
        example: what a person may type, but for the program's name.
    """
    parser = commands.add_parser(name, help=summary, description=description, epilog=f"example: warpimpact {example}")
    parser.set_defaults(command=command)
    return parser


def add_campaign(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("campaign", type=Path, metavar="CAMPAIGN.toml", help="what is shot at what")


def add_result(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("result", type=Path, metavar="RESULT.nc", help="written by warpimpact run")


def add_results(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("results", type=Path, nargs="+", metavar="RESULT.nc", help="written by warpimpact run")


def add_output(parser: argparse.ArgumentParser, metavar: str, text: str) -> None:
    parser.add_argument("-o", "--output", type=Path, metavar=metavar, help=text)


def add_overwrite(parser: argparse.ArgumentParser, replaced: str) -> None:
    parser.add_argument("--overwrite", action="store_true", help=f"replace {replaced}")


def add_count(parser: argparse.ArgumentParser) -> None:
    parser.add_argument("--count", type=int, metavar="N", help="number of hits, in place of the campaign's")


def add_campaign_folder(parser: argparse.ArgumentParser, text: str) -> None:
    parser.add_argument("--campaign-folder", type=Path, metavar="FOLDER", help=text)


def add_device(parser: argparse.ArgumentParser) -> None:
    parser.add_argument(
        "--device",
        default="auto",
        metavar="auto|cpu|cuda:0",
        help="auto takes CUDA where there is any; several for a run: cuda:0,cuda:1",
    )


def at_least(least: int) -> Callable[[str], int]:
    """The reader of a whole number that has a least value."""

    def whole_number(text: str) -> int:
        if (number := int(text)) < least:
            raise argparse.ArgumentTypeError(f"got {number}, but it must be at least {least}")
        return number

    return whole_number
