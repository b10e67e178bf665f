"""The commands new and schema, which help to write a campaign."""

import argparse
import re
import shutil
from collections.abc import Iterator
from pathlib import Path
from typing import Any

from .options import Commands, add_command, add_output, add_overwrite
from .paths import check_output

_SCHEMA = "warpimpact.schema.json"
_FOLDERS = (".", "fits", "firing", "designs")
"""Folders of the examples: campaigns, and what identify, test and optimise take."""


def add_new(commands: Commands) -> None:
    parser = add_command(
        commands,
        "new",
        _new,
        summary="start a campaign of your own from an example",
        description="Copy a campaign, a fit, a test or a design that comes with warpimpact, and the files that it "
        f"names. Write its schema, such as {_SCHEMA}, so that an editor can complete and check the keys.",
        example="new slotted_plate -o my.toml",
    )
    parser.add_argument("name", metavar="NAME", nargs="?", default="", help="name of an example")
    parser.add_argument("--list", action="store_true", help="list the examples, each with the question that it answers")
    add_output(parser, "CAMPAIGN.toml", "campaign file (default: NAME.toml in this folder)")
    add_overwrite(parser, "existing files")


def _new(arguments: argparse.Namespace) -> None:
    import tomllib

    from warpimpact.campaign.text import CampaignError
    from warpimpact.results import kinds
    from warpimpact.scene.units import meant
    from warpimpact.view.view import Section, labelled, text_of

    paths, name = _paths(), arguments.name.removesuffix(".toml")
    if arguments.list:
        questions = [
            (name, path.read_text(encoding="utf-8").splitlines()[0].removeprefix("# ")) for name, path in paths.items()
        ]
        print(text_of([Section([labelled(questions)])]))
        return
    if name not in paths:
        raise CampaignError(f'got the unknown example "{name}"; {meant(name, paths)}; warpimpact new --list lists all')
    source, output = paths[name], arguments.output or Path(f"{name}.toml")
    # Commands in the comments name the file by its place in the checkout.
    text = re.sub(
        rf"campaigns/(?:\w+/)?{name}\.toml",
        lambda _: output.name,
        source.read_text(encoding="utf-8"),
    )
    tables = tomllib.loads(text)
    copies = {source.parent / file: output.parent / file for file in _named(tables)}
    for file in (output, *copies.values()):
        check_output(file, overwrite=arguments.overwrite)
    for original, copy in copies.items():
        shutil.copyfile(original, copy)
    names = {kinds.FIT: "fit", kinds.TEST: "test", kinds.DESIGN: "design"}
    kind = names.get(kinds.text_kind(tables)[0], "campaign")
    schema = output.parent / (_SCHEMA if kind == "campaign" else f"warpimpact.{kind}.schema.json")
    output.write_text(f"#:schema {schema.name}\n{text}", encoding="utf-8")
    schema.write_text(_schema_text(kind), encoding="utf-8")
    for written in (output, *copies.values(), schema):
        print(written)


def _paths() -> dict[str, Path]:
    """Names of the examples of this installation, and their files."""
    from importlib.resources import files

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


def add_schema(commands: Commands) -> None:
    parser = add_command(
        commands,
        "schema",
        _schema,
        summary="print the JSON schema of campaign files, for editors",
        description="Print the JSON schema of campaign files. An editor that knows TOML, such as VS Code with Even "
        f"Better TOML, completes and checks a campaign whose first line is: #:schema {_SCHEMA}",
        example=f"schema -o {_SCHEMA}",
    )
    other = parser.add_mutually_exclusive_group()
    for kind, command in (("fit", "identify"), ("test", "test"), ("design", "optimise")):
        text = f"print the schema of {kind}s, which warpimpact {command} takes"
        other.add_argument(f"--{kind}", action="store_const", const=kind, dest="kind", default="campaign", help=text)
    add_output(parser, "SCHEMA.json", "file (default: printed)")
    add_overwrite(parser, "an existing file")


def _schema(arguments: argparse.Namespace) -> None:
    text = _schema_text(arguments.kind)
    if arguments.output is None:
        print(text, end="")
        return
    check_output(arguments.output, overwrite=arguments.overwrite)
    arguments.output.write_text(text, encoding="utf-8")
    print(arguments.output)


def _schema_text(kind: str) -> str:
    import json

    from warpimpact.campaign.schema import campaign_schema, file_schema

    if kind == "fit":  # each kind takes seconds to import
        from warpimpact.identification.fit_file import FitFile

        schema = file_schema(FitFile, "warpimpact fit")
    elif kind == "test":
        from warpimpact.firing.plan import FiringTest

        schema = file_schema(FiringTest, "warpimpact firing test")
    elif kind == "design":
        from warpimpact.optimisation.design import design_schema

        schema = design_schema()
    else:
        schema = campaign_schema()
    return json.dumps(schema, indent=1, ensure_ascii=False) + "\n"
