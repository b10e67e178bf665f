"""The `warpimpact` command: arguments, progress, tables and clear errors.

`commands.py` declares them all; the module of a command is imported when it runs, which keeps `--help` quick. Change
arguments, messages and progress here; a number is computed in another room. It imports every other room.
"""

import argparse
import os
import signal
import sys
import threading
import traceback
from collections.abc import Sequence
from contextlib import redirect_stderr, redirect_stdout, suppress
from typing import NoReturn

from warpimpact import __version__

from .commands import DAILY, EXPERT
from .messages import Plain, message_of, say, show_log, show_warnings

_EXAMPLE = """\
warpimpact COMMAND --help explains a command. An example:
    warpimpact new slotted_plate -o my.toml && warpimpact run my.toml && warpimpact report my.nc"""


def command() -> NoReturn:
    """Run one command as a process of its own.

    Nothing is left to do when the command has ended, so the process ends at once: to free all that it has loaded would
    take as long as a small run computes. A thread that is still computing, after Ctrl-C, has nothing to save.
    """
    for number in (signal.SIGINT, signal.SIGTERM):  # a batch system sends SIGTERM when the time is used up
        if signal.getsignal(number) is not signal.SIG_IGN:  # a background job of a shell ignores SIGINT
            signal.signal(number, signal.default_int_handler)
    sys.unraisablehook = _interrupt_again
    for name in ("stdout", "stderr"):
        if getattr(sys, name) is None:  # a closed stream: the next file that is opened would get its number
            setattr(sys, name, open(os.devnull, "w", encoding="utf-8"))  # noqa: SIM115, it stays open
    os.environ["MPLBACKEND"] = "agg"  # figures go to files, whatever is set
    code = main()
    for stream in (sys.stdout, sys.stderr):
        with suppress(OSError):  # the reader may be gone
            stream.flush()
    os._exit(code)


def _interrupt_again(lost: "sys.UnraisableHookArgs") -> None:
    """Python drops an exception that is raised while it frees an object, also that of a signal; so it comes again."""
    if issubclass(lost.exc_type, KeyboardInterrupt):
        threading.Timer(0.05, signal.pthread_kill, [threading.main_thread().ident, signal.SIGTERM]).start()
    else:
        sys.__unraisablehook__(lost)


def main(argv: Sequence[str] | None = None) -> int:
    """Run one command and return its exit code: 2 after a mistake that the user can correct, 3 when more shots failed
    than the campaign allows, 70 after a bug of warpimpact, 130 when interrupted, 141 when the reader of its output has
    closed it.

    All errors end here, each in one sentence; only a bug has a traceback.
    """
    with redirect_stderr(Plain(sys.stderr)):  # argparse quotes what the user typed
        arguments = parser().parse_args(argv)
    try:
        show_log(arguments.verbose)
        with redirect_stdout(Plain(sys.stdout)), show_warnings():
            code: int = arguments.command.function()(arguments) or 0
            sys.stdout.flush()
    except KeyboardInterrupt as interrupt:
        say(str(interrupt) or "interrupted")
        return 130
    except BrokenPipeError:  # the reader has closed the pipe, as `head` does
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        return 141
    except Exception as error:
        if sentence := message_of(error):
            say(f"error: {sentence}")
            return 2
        traceback.print_exc(file=Plain(sys.stderr))
        say(f"error: this is a bug of warpimpact {__version__}, please report it with the lines above")
        return 70
    return code


def parser() -> argparse.ArgumentParser:
    """The parser of the command line, with all commands; the documentation is made from it."""
    program = argparse.ArgumentParser(
        prog="warpimpact",
        description="Hit maps of hard bullet cores against perforated armour plates.",
        usage="warpimpact [-h] [--version] COMMAND ...",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    program.add_argument("--version", action="version", version=f"warpimpact {__version__}")
    commands = program.add_subparsers(metavar="COMMAND", required=True, prog="warpimpact", help=argparse.SUPPRESS)
    groups = []
    for title, declared in (("from names to a report", DAILY), ("for experts", EXPERT)):
        for one in declared:
            one.add_to(commands)
        groups.append("\n".join([f"{title}:", *(f"    {one.name:<10} {one.summary}" for one in declared)]))
    program.epilog = "\n\n".join([*groups, _EXAMPLE])
    return program
