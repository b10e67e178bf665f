"""Declarations of commands, and options that several of them take."""

import argparse
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Any, NamedTuple


class Option(NamedTuple):
    """An argument of a command, as argparse takes it."""

    names: tuple[str, ...]
    settings: dict[str, Any]

    def add_to(self, parser: argparse._ActionsContainer) -> None:
        parser.add_argument(*self.names, **self.settings)


class OneOf(NamedTuple):
    """Options that exclude each other."""

    options: tuple[Option, ...]

    def add_to(self, parser: argparse._ActionsContainer) -> None:
        group = parser.add_mutually_exclusive_group()
        for one in self.options:
            one.add_to(group)


def option(*names: str, **settings: Any) -> Option:
    """Declare an argument with the settings of argparse."""
    return Option(names, settings)


def one_of(*options: Option) -> OneOf:
    """Declare options that exclude each other."""
    return OneOf(options)


@dataclass(frozen=True)
class Command:
    """A command, whose function `NAME_command` is in a module of this room.

    Attributes:
        module: its module, which is imported when the command runs: what it imports takes seconds.
        summary: its line in `warpimpact --help`.
        example: a command line, without the program's name.
    """

    name: str
    module: str
    summary: str
    description: str
    options: Sequence[Option | OneOf]
    example: str

    def add_to(self, commands: "argparse._SubParsersAction[argparse.ArgumentParser]") -> None:
        parser = commands.add_parser(
            self.name, description=self.description, epilog=f"example: warpimpact {self.example}"
        )
        parser.set_defaults(command=self)
        for one in (*self.options, *_VOLUME):
            one.add_to(parser)

    def run(self, arguments: argparse.Namespace) -> int:
        """Run the command and return its exit code."""
        module = import_module(f".{self.module}", __package__)
        return int(getattr(module, f"{self.name}_command")(arguments) or 0)


def at_least(least: int) -> Callable[[str], int]:
    """Return a parser of whole numbers that are at least `least`."""

    def whole_number(text: str) -> int:
        if (number := int(text)) < least:
            raise argparse.ArgumentTypeError(f"got {number}, but it must be at least {least}")
        return number

    return whole_number


def text(name: str, metavar: str, text: str, **settings: Any) -> Option:
    """Declare a text."""
    return option(name, metavar=metavar, help=text, **settings)


def choice(name: str, choices: Sequence[str], text: str, **settings: Any) -> Option:
    """Declare one of some words."""
    return option(name, choices=choices, help=text, **settings)


def number(name: str, text: str, *, least: int = 0, **settings: Any) -> Option:
    """Declare a whole number that is at least `least`."""
    return option(name, type=at_least(least), metavar="N", help=text, **settings)


def flag(name: str, text: str, **settings: Any) -> Option:
    """Declare an option without a value."""
    return option(name, action="store_true", help=text, **settings)


def file(name: str, metavar: str, text: str, **settings: Any) -> Option:
    """Declare a file."""
    return option(name, type=Path, metavar=metavar, help=text, **settings)


def output(metavar: str, text: str) -> Option:
    """Declare the file that a command writes."""
    return option("-o", "--output", type=Path, metavar=metavar, help=text)


def folder(text: str) -> Option:
    """Declare the folder in which a command writes files with names of its own."""
    return file("--folder", "FOLDER", text)


def overwrite(replaced: str) -> Option:
    return flag("--overwrite", f"replace {replaced}")


def earlier(what: str, replaced: str, resume: str = "") -> tuple[Option, Option]:
    """Declare what happens to an earlier computation, which `what` names: --resume and --overwrite."""
    usual = f"continue an interrupted {what}; start a new one if there is none"
    return flag("--resume", resume or usual), overwrite(replaced)


def measures(default: str = "the measures of docs/protection.md") -> Option:
    """Declare the measures of results; `default` names those that are shown without it."""
    return option(
        "--measure",
        action="append",
        default=[],
        metavar="TEXT",
        help='a measure, such as "worst_tenth(residual_energy_density@130mm)", "P(inclination > 40 deg)" or V50; '
        f"may be given several times (default: {default})",
    )


def campaign_folder(text: str) -> Option:
    return file("--campaign-folder", "FOLDER", text)


CAMPAIGN = file("campaign", "CAMPAIGN.toml", "campaign file: core, plate, shots and numerics")
RESULT = file("result", "RESULT.nc", "written by warpimpact run")
RESULTS = file("results", "RESULT.nc", "written by warpimpact run", nargs="+")
COUNT = option("--count", type=int, metavar="N", help="number of hits, instead of the campaign's")
DEVICE = option(
    "--device",
    default="auto",
    metavar="auto|cpu|cuda:0",
    help="where to compute (default: auto, which is a GPU if there is one); a run takes several: cuda:0,cuda:1",
)
COMPUTING = (
    DEVICE,
    one_of(
        option("--scheduler", metavar="ADDRESS", help="compute on the workers of this Dask scheduler"),
        number("--workers", "compute in N processes on this machine", least=1),
    ),
)
_VOLUME = (
    one_of(
        option("-v", "--verbose", action="count", default=0, help="show what is done; -vv shows more"),
        option("-q", "--quiet", action="store_true", help="show no progress"),
    ),
)
