"""Hostile fits: one sentence, whatever a fit file or its posterior holds; no traceback, no hang."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from warpimpact.identification.fit import Fit
from warpimpact.identification.fit_file import fit_from
from warpimpact.identification.parameters import FitError

TEXT = Path(__file__).with_name("two_shots.toml").read_text(encoding="utf-8")
DISTRIBUTION = {"distribution": ["1 mm"] * 5000, "low": 0, "high": 1}
CASES: dict[str, tuple[tuple[Any, ...], Any, str]] = {
    "no prior": (("prior",), "x", 'prior: got "x", but it must be a table'),
    "a prior of a table": (("prior",), {"distribution": "uniform", "low": 1, "high": 2}, "prior"),
    "a long distribution": (("prior", "plate", "resistance"), DISTRIBUTION, "but it must be one of"),
    "too many spacings": (
        ("prior", "plate", "pattern"),
        {"spacing": [{"distribution": "uniform", "low": 1, "high": 2}] * 3},
        "is no number",
    ),
    "an impact": (("shot", 0, "impact"), [1, 2], "shot[0].impact: got [1, 2], but it must be a table"),
    "a status": (("shot", 0, "measured"), {"status": ["perforated"]}, "shot[0].measured.status: got ["),
    "a plate of a shot": (("shot", 0, "plate"), 7, "shot[0].plate: got 7, but it must be a table"),
    "a core": (("core",), 5, "core: got 5, but it must be a table"),
    "numerics": (("numerics",), "fine", 'numerics: got "fine", but it must be a table'),
    "a selection": (("selection",), 5, 'got the unknown key "selection"'),
    "a discrepancy": (("discrepancy",), 0.5, "discrepancy: got 0.5, but it must be a table"),
}


def put(data: Any, place: tuple[Any, ...], value: Any) -> Any:
    """The nested tables with one value replaced."""
    if not place:
        return value
    copy = dict(data) if isinstance(data, dict) else list(data)
    copy[place[0]] = put(copy[place[0]] if place[1:] else None, place[1:], value)
    return copy


@pytest.mark.parametrize("case", CASES)
def test_a_hostile_fit_is_refused_in_a_sentence(case: str) -> None:
    place, value, expected = CASES[case]
    text = json.dumps(put(tomllib.loads(TEXT), place, value))
    with pytest.raises(FitError) as caught:
        fit_from(text, "fit.json", Path())
    assert expected in str(caught.value)
    assert len(str(caught.value)) < 500


def test_many_shots_are_checked_in_proportion(monkeypatch: pytest.MonkeyPatch) -> None:
    counted: list[None] = []
    scene_of = Fit.scene_of
    monkeypatch.setattr(Fit, "scene_of", lambda *given: counted.append(None) or scene_of(*given))
    data = tomllib.loads(TEXT)
    fit_from(json.dumps(data), "fit.json", Path())
    one = len(counted)
    many = data | {"shot": data["shot"] * 50}
    fit = fit_from(json.dumps(many), "fit.json", Path())
    assert len(counted) - one <= one + len(many["shot"])
    assert len(fit.warnings) == 49 * len(data["shot"])  # one for each that repeats another
    with pytest.raises(FitError, match="at most 256"):
        fit_from(json.dumps(data | {"shot": data["shot"] * 200}), "fit.json", Path())
