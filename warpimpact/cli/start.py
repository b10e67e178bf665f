"""The commands new and schema, which help to write a campaign, and design, a page where a plate is drawn."""

import argparse
import json
import os
import re
import tempfile
import tomllib
import webbrowser
from collections.abc import Callable
from contextlib import ExitStack
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

from warpimpact.campaign.schema import campaign_schema, file_schema
from warpimpact.design.designs import DesignStore, from_address, read_designs
from warpimpact.errors import CampaignError
from warpimpact.firing.simulate import FiringTest
from warpimpact.identification.fit_file import FitFile
from warpimpact.optimisation.design import design_schema
from warpimpact.records import kinds
from warpimpact.scene.input_files import files_of
from warpimpact.scene.units import hint

from .commands import SCHEMA
from .common import check_output, run_options, write_text
from .messages import say

_FOLDERS = (".", "fits", "firing", "designs")
"""Folders of the examples: campaigns, and what identify, test and optimise take."""


def new_command(arguments: argparse.Namespace) -> None:
    folder, name = Path(str(files("warpimpact.campaigns"))), arguments.name.removesuffix(".toml")
    examples = sorted((path for kind in _FOLDERS for path in folder.glob(f"{kind}/*.toml")), key=lambda path: path.stem)
    paths = {path.stem: path for path in examples}
    if arguments.list:
        for name, path in paths.items():
            question = path.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ")
            print(f"{name:<{max(map(len, paths))}}  {question}")
        return
    if name not in paths:
        raise CampaignError(f'got the unknown example "{name}"; {hint(name, paths)}; warpimpact new --list lists all')
    source, output = paths[name], arguments.output or Path(f"{name}.toml")
    # Commands in the comments name the file by its place in the checkout.
    text = re.sub(rf"campaigns/(?:\w+/)?{name}\.toml", lambda _: output.name, source.read_text(encoding="utf-8"))
    tables = tomllib.loads(text)
    copies = {source.parent / file: output.parent / file for file in files_of(tables, ("file", "campaign")).values()}
    for file in (output, *copies.values()):
        check_output(arguments, file)
    names = {kinds.FIT: "fit", kinds.TEST: "test", kinds.DESIGN: "design"}
    kind = names.get(kinds.text_kind(tables)[0], "campaign")
    schema = output.parent / (SCHEMA if kind == "campaign" else f"warpimpact.{kind}.schema.json")
    texts = {output: f"#:schema {schema.name}\n{text}", schema: _schema_text(kind)}
    texts |= {copy: original.read_text(encoding="utf-8") for original, copy in copies.items()}
    for path, content in texts.items():
        write_text(content, path)
        print(path)


def schema_command(arguments: argparse.Namespace) -> None:
    text = _schema_text(arguments.kind)
    if arguments.output is None:
        print(text, end="")
        return
    check_output(arguments, arguments.output)
    write_text(text, arguments.output)
    print(arguments.output)


def _schema_text(kind: str) -> str:
    schemas: dict[str, Callable[[], dict[str, Any]]] = {
        "campaign": campaign_schema,
        "design": design_schema,
        "fit": partial(file_schema, FitFile, "warpimpact fit"),
        "test": partial(file_schema, FiringTest, "warpimpact firing test"),
    }
    return json.dumps(schemas[kind](), indent=1, ensure_ascii=False) + "\n"


def design_command(arguments: argparse.Namespace) -> None:
    try:  # starlette and uvicorn are optional
        from warpimpact.design.server import serve
    except ModuleNotFoundError as error:
        raise CampaignError(f"design needs {error.name}: pip install 'warpimpact[design]'") from None
    given = arguments.designs or [str(files("warpimpact.campaigns") / "slotted_plate.toml")]
    addresses = [name for name in given if name.startswith("http://")]
    designs = {f"address {number}": from_address(address) for number, address in enumerate(addresses, 1)}
    designs |= read_designs([Path(name) for name in given if name not in addresses])
    with ExitStack() as opened, run_options(arguments) as options:

        def ready(address: str) -> None:
            print(address, flush=True)
            if not arguments.no_browser:
                path = _redirecting_file(address)
                opened.callback(path.unlink, missing_ok=True)
                webbrowser.open(path.as_uri())

        try:
            serve(DesignStore(designs), port=arguments.port, options=options, ready=ready)
        except (OSError, OverflowError) as error:
            raise CampaignError(f"--port: got {arguments.port}, but it cannot be used ({error})") from None
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
