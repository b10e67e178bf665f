"""Every command that computes takes the same options, as the table in docs/contributing.md says."""

import argparse
from pathlib import Path

import pytest

from warpimpact.cli import parser

OPTIONS = {"threads": "--device", "processes": "--workers", "Dask": "--scheduler", "resume": "--resume"}
PAGE = Path(__file__).parents[3] / "docs" / "contributing.md"


def options_of(command: str) -> set[str]:
    (commands,) = [action for action in parser()._actions if isinstance(action, argparse._SubParsersAction)]
    return {option for action in commands.choices[command]._actions for option in action.option_strings}


def rows() -> dict[str, dict[str, str]]:
    """The table of the page: cells by command and by head."""
    lines = PAGE.read_text(encoding="utf-8").split("| command |")[1].splitlines()
    heads = [head.strip() for head in lines[0].strip(" |").split("|")]
    found = {}
    for line in lines[2:]:
        if not line.startswith("|"):
            break
        name, *cells = (cell.strip() for cell in line.strip("|").split("|"))
        found[name.strip("`")] = dict(zip(heads, cells, strict=True))
    return found


@pytest.mark.parametrize("command", ["run", "limit", "sweep", "compare", "test", "identify", "optimise", "continuum"])
def test_the_table_says_which_options_a_command_takes(command: str) -> None:
    taken, told = options_of(command), rows()[command]
    assert {name: told[name] == "yes" for name in OPTIONS} == {
        name: option in taken for name, option in OPTIONS.items()
    }


def test_the_table_has_every_command_that_computes_on_workers() -> None:
    (commands,) = [action for action in parser()._actions if isinstance(action, argparse._SubParsersAction)]
    assert {name for name in commands.choices if "--workers" in options_of(name)} == set(rows())
