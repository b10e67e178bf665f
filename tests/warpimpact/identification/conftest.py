"""A fit that is cheap to compute: two shots at a thin plate with round holes."""

from collections.abc import Callable
from pathlib import Path

import pytest
import xarray

from warpimpact.identification.fit import Fit, fit_from
from warpimpact.identification.identify import identify

from ...options import CPU

TEXT = Path(__file__).with_name("two_shots.toml").read_text(encoding="utf-8")

FitMaker = Callable[..., Fit]
SMALL = ("[sampling]\nhits = 64", "[sampling]\nsets = 1024\ndraws = 100\neffective = 60\nhits = 32")
"""What makes the fit one of a second."""


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


@pytest.fixture
def small() -> tuple[str, str]:
    return SMALL


@pytest.fixture(scope="session")
def posterior() -> xarray.Dataset:
    """The posterior of a small fit."""
    assert SMALL[0] in TEXT
    return identify(fit_from(TEXT.replace(*SMALL), "fit.toml", Path()), options=CPU)
