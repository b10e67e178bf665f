"""The commands new and schema, which help to write a campaign."""

import argparse
import json
import re
import tomllib
from collections.abc import Callable, Iterator
from functools import partial
from importlib.resources import files
from pathlib import Path
from typing import Any

from warpimpact.campaign.schema import campaign_schema, file_schema
from warpimpact.campaign.text import CampaignError
from warpimpact.firing.plan import FiringTest
from warpimpact.identification.fit import FitFile
from warpimpact.optimisation.design import design_schema
from warpimpact.results import kinds
from warpimpact.scene.units import meant

from .commands import SCHEMA
from .paths import check_output, write_text

_FOLDERS = (".", "fits", "firing", "designs")
"""Folders of the examples: campaigns, and what identify, test and optimise take."""


def new_command(arguments: argparse.Namespace) -> None:
    paths, name = _paths(), arguments.name.removesuffix(".toml")
    if arguments.list:
        for name, path in paths.items():
            question = path.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ")
            print(f"{name:<{max(map(len, paths))}}  {question}")
        return
    if name not in paths:
        raise CampaignError(f'got the unknown example "{name}"; {meant(name, paths)}; warpimpact new --list lists all')
    source, output = paths[name], arguments.output or Path(f"{name}.toml")
    # Commands in the comments name the file by its place in the checkout.
    text = re.sub(rf"campaigns/(?:\w+/)?{name}\.toml", lambda _: output.name, source.read_text(encoding="utf-8"))
    tables = tomllib.loads(text)
    copies = {source.parent / file: output.parent / file for file in _named(tables)}
    for file in (output, *copies.values()):
        check_output(file, overwrite=arguments.overwrite)
    names = {kinds.FIT: "fit", kinds.TEST: "test", kinds.DESIGN: "design"}
    kind = names.get(kinds.text_kind(tables)[0], "campaign")
    schema = output.parent / (SCHEMA if kind == "campaign" else f"warpimpact.{kind}.schema.json")
    texts = {output: f"#:schema {schema.name}\n{text}", schema: _schema_text(kind)}
    texts |= {copy: original.read_text(encoding="utf-8") for original, copy in copies.items()}
    for path, content in texts.items():
        write_text(content, path)
        print(path)


def _paths() -> dict[str, Path]:
    """Names of the examples of this installation, and their files."""
    folder = Path(str(files("warpimpact.campaigns")))
    paths = [path for kind in _FOLDERS for path in folder.glob(f"{kind}/*.toml")]
    return {path.stem: path for path in sorted(paths, key=lambda path: path.stem)}


def _named(value: Any) -> Iterator[str]:
    """Files that a campaign names."""
    inner = value.items() if isinstance(value, dict) else enumerate(value) if isinstance(value, list) else ()
    for key, entry in inner:
        if key in ("file", "campaign") and isinstance(entry, str):
            yield entry
        yield from _named(entry)


def schema_command(arguments: argparse.Namespace) -> None:
    text = _schema_text(arguments.kind)
    if arguments.output is None:
        print(text, end="")
        return
    check_output(arguments.output, overwrite=arguments.overwrite)
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
