"""The error of the fast laws behind a plate, as the stored plates have it (docs/continuum.md)."""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files

from warpimpact.statistics.law_error import LawErrors

FILE = "law_error.json"
"""Made by `make benchmark` from the stored states (tests/benchmarks/law_error.py)."""


@cache
def law_errors(of_catalogue: bool) -> LawErrors:
    """The error of the campaign's law and of the second one, and of the first alone.

    Args:
        of_catalogue: whether the resistance of the perforated plates is that of the catalogue, which meets limits of
            solid plates. Behind holes such a law takes more energy than finite elements do.
    """
    tables = json.loads(files(__package__).joinpath(FILE).read_text(encoding="utf-8"))
    return LawErrors.from_numbers(tables["catalogue" if of_catalogue else "given"])
