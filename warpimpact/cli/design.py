"""The command design: a page on this machine where a plate is drawn and its map answers."""

import argparse
import os
import tempfile
import webbrowser
from contextlib import ExitStack
from importlib.resources import files
from pathlib import Path

from warpimpact.campaign.text import CampaignError
from warpimpact.design.designs import DesignStore, from_address, read_designs

from .messages import say


def design_command(arguments: argparse.Namespace) -> None:
    try:  # starlette and uvicorn are optional
        from warpimpact.design.server import serve
    except ModuleNotFoundError as error:
        raise CampaignError(f"design needs {error.name}: pip install 'warpimpact[design]'") from None
    given = arguments.designs or [str(files("warpimpact.campaigns") / "slotted_plate.toml")]
    addresses = [name for name in given if name.startswith("http://")]
    designs = {f"address {number}": from_address(address) for number, address in enumerate(addresses, 1)}
    designs |= read_designs([Path(name) for name in given if name not in addresses])
    if not 0 <= arguments.port < 2**16:
        raise CampaignError(f"--port: got {arguments.port}, but it must be a number from 0 to 65535")
    opened = ExitStack()

    def ready(address: str) -> None:
        print(address, flush=True)
        if arguments.no_browser:
            return
        try:
            path = _redirecting_file(address)
        except OSError as error:
            say(f"no browser is opened, because a file for it cannot be written ({error.strerror})")
            return
        opened.callback(path.unlink, missing_ok=True)
        webbrowser.open(path.as_uri())

    try:
        with opened:
            serve(DesignStore(designs), port=arguments.port, device=arguments.device, ready=ready)
    except OSError as error:
        raise CampaignError(f"--port: got {arguments.port}, but it cannot be used ({error.strerror})") from None
    except KeyboardInterrupt:
        say("ended")


def _redirecting_file(address: str) -> Path:
    """Write a file that leads a browser to an address and that only its owner can read.

    Every user of the machine can see the command line of a browser, so the address is not part of it. The file is in
    the home folder, because browsers in a sandbox see neither temporary nor hidden files.
    """
    home = Path("~").expanduser()
    folder = home if os.access(home, os.W_OK) else None
    number, name = tempfile.mkstemp(".html", "warpimpact-design-", folder)
    with os.fdopen(number, "w", encoding="utf-8") as file:
        file.write(
            f'<!DOCTYPE html><meta charset="utf-8"><meta name="referrer" content="no-referrer">'
            f'<meta http-equiv="refresh" content="0;url={address}"><a href="{address}">warpimpact design</a>'
        )
    return Path(name)
