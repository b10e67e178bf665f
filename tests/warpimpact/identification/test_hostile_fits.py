"""Hostile fits: one sentence, whatever a fit file or its posterior holds; no traceback, no hang."""

import json
import math
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
import xarray

from warpimpact.identification.fit import Fit
from warpimpact.identification.fit_file import fit_from
from warpimpact.identification.parameters import FitError
from warpimpact.results import posterior_file
from warpimpact.results.files import ResultError, read_tree, write_tree

TEXT = (Path(__file__).parents[2] / "validation" / "calibration.toml").read_text(encoding="utf-8")
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
    "a selection": (("selection",), 5, "selection: got 5, but it must be a list"),
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


def test_half_a_character_is_refused() -> None:
    with pytest.raises(ValueError, match=r"is not valid TOML: .* can.t encode character"):
        fit_from(json.dumps(tomllib.loads(TEXT) | {"title": "\ud800"}), "fit.json", Path())


ALTERATIONS: dict[str, tuple[str, Callable[[xarray.Dataset], xarray.Dataset]]] = {
    "a parameter that the best lacks": ("best", lambda d: d.drop_vars("resistance")),
    "a parameter along nothing": ("posterior", lambda d: d.isel(draw=0)),
    "no path": ("posterior", lambda d: d.assign(resistance=d["resistance"].drop_attrs())),
    "no misfit": ("best", lambda d: d.rename(misfit="fit")),
    "words for numbers": ("posterior_predictive", lambda d: d.assign(fitted=d["fitted"].astype(str))),
    "unnamed observations": ("observed_data", lambda d: d.drop_vars("observation")),
    "a size in words": ("/", lambda d: d.assign_attrs(effective_sample_size="large")),
    "no title": ("/", lambda d: d.drop_attrs().assign_attrs({k: a for k, a in d.attrs.items() if k != "title"})),
    "an infinite number of draws": ("/", lambda d: d.assign_attrs(wanted_sample_size=math.inf)),
    "a material without tables": ("/", lambda d: d.assign_attrs(material="[1, 2]")),
    "an infinite draw": ("prior", lambda d: d.assign(resistance=d["resistance"] * math.inf)),
    "a draw that is none": ("posterior", lambda d: d.assign(resistance=d["resistance"] * math.nan)),
    "a huge hit": ("posterior", lambda d: d.assign(hit_y=d["hit_y"] + 1e300)),
    "no rows": ("/", lambda d: d.assign_attrs(row_probability='{"a": "b"}')),
}


@pytest.mark.parametrize("case", ALTERATIONS)
def test_an_altered_posterior_is_refused_in_a_sentence(case: str, posterior: Path, tmp_path: Path) -> None:
    group, change = ALTERATIONS[case]
    tree = read_tree(posterior, posterior_file.POSTERIOR)
    groups = {name: tree[name].to_dataset() for name in ("/", *tree.children)}
    groups[group] = change(groups[group])
    path = tmp_path / "altered.nc"
    write_tree(xarray.DataTree.from_dict(groups), path)
    with pytest.raises(ResultError, match="not a posterior of warpimpact") as caught:
        read_tree(path, posterior_file.POSTERIOR)
    assert "\n" not in str(caught.value)
