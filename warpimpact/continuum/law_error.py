"""The error of the fast laws behind a plate, as the stored plates have it (docs/continuum.md)."""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files

from warpimpact.statistics.law_error import LawErrors

FILE = "law_error.json"
"""Made by `make benchmark` from the stored states (tests/benchmarks/law_error.py)."""


@cache
def law_errors() -> LawErrors:
    """The error of the campaign's law and of the second one, and of the first alone."""
    return LawErrors.from_numbers(json.loads(files(__package__).joinpath(FILE).read_text(encoding="utf-8")))
