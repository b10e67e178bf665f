"""The command as a process of its own, also as `python -m warpimpact`: it listens to signals while it loads."""

import os
import signal
from typing import NoReturn


def command() -> NoReturn:
    """Run one command. A signal that comes while it is loaded ends it in a sentence, as one that comes later does."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) is not signal.SIG_IGN:  # a background job of a shell ignores SIGINT
            signal.signal(number, _ended)
    from warpimpact.cli import command as loaded

    loaded()


def _ended(*_: object) -> None:
    os.write(2, b"warpimpact: interrupted\n")
    os._exit(130)


if __name__ == "__main__":
    command()
