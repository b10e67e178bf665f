"""The `warpimpact` command: what a person types, progress, tables and clear errors.

A file per group of commands. What is heavy is imported once a command needs it, which keeps `--help` quick. Change
arguments, messages and progress here; a number is computed in another room. It imports every other room.
"""

import argparse
import sys
from collections.abc import Sequence

from warpimpact import __version__

from .accuracy import add_study, add_validate
from .compare import add_compare
from .export import add_export, add_report
from .mistakes import implausible_told, mistakes
from .replay import add_replay
from .run import add_run
from .show import add_inspect, add_plate, add_plot

_COMMANDS = (
    add_run,
    add_inspect,
    add_plot,
    add_compare,
    add_plate,
    add_replay,
    add_export,
    add_report,
    add_study,
    add_validate,
)
"""In the order of the help."""


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command; returns the exit code: 2 after a mistake that the user can put right, 3 when more shots failed
    than the campaign allows, 130 when interrupted."""
    arguments = _parser().parse_args(argv)
    try:
        with implausible_told():
            code: int | None = arguments.command(arguments)
    except KeyboardInterrupt as interrupt:
        print(f"warpimpact: {str(interrupt) or 'interrupted'}", file=sys.stderr)
        return 130
    except mistakes() as error:
        print(f"warpimpact: error: {error}", file=sys.stderr)
        return 2
    return code or 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(
        prog="warpimpact",
        description="Hit maps of hard bullet cores against perforated armour plates.",
        epilog="example: warpimpact run campaigns/slotted_plate.toml && warpimpact plot slotted_plate.nc",
    )
    parser.add_argument("--version", action="version", version=f"warpimpact {__version__}")
    commands = parser.add_subparsers(metavar="COMMAND", required=True)
    for add in _COMMANDS:
        add(commands)
    return parser
