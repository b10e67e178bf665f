"""A fit that is cheap to compute: two shots at a thin plate with round holes."""

from collections.abc import Callable
from pathlib import Path

import pytest

from warpimpact.identification.fit import Fit
from warpimpact.identification.reading import fit_from

TEXT = (Path(__file__).parents[2] / "validation" / "calibration.toml").read_text(encoding="utf-8")

FitMaker = Callable[..., Fit]


@pytest.fixture
def text() -> str:
    return TEXT


@pytest.fixture
def make_fit() -> FitMaker:
    """A function of replacements in the text of the fit."""

    def make(*changes: tuple[str, str]) -> Fit:
        changed = TEXT
        for before, after in changes:
            assert before in changed
            changed = changed.replace(before, after)
        return fit_from(changed, "fit.toml", Path())

    return make
