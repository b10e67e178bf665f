"""What is computed into the same file: hits at a finer level, and the solid plate of equal areal density."""

import json
import math
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import Campaign, FastLaw
from warpimpact.analysis.comparison import compare
from warpimpact.analysis.effectiveness import effectiveness
from warpimpact.analysis.inspection import inspect_view, numerics_note
from warpimpact.analysis.numbers import text_of
from warpimpact.kernels.status import Status
from warpimpact.measures.estimates import estimated
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import FINER, finer_pair, law_of, node_hits
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.results import files
from warpimpact.runs.run import run, run_to_file
from warpimpact.runs.store import Store
from warpimpact.solver.accuracy import PILOT_HITS

from ...options import CPU
from ..slotted import slotted, slotted_text

PATTERN = slotted_text()[slotted_text().index("[plate.pattern]") : slotted_text().index("[impact]")]
STANDARD = ('"draft"', '"standard"')


def computed(campaign: Campaign, path: Path) -> xarray.DataTree:
    run_to_file(campaign, path, options=CPU)
    return files.read(path)


@pytest.mark.usefixtures("small_chunks")
def test_a_shot_that_does_not_scatter_is_fired_once_and_meets_the_closed_form(tmp_path: Path) -> None:
    """Without friction and degradation the work is Y·h·π R²."""
    no_loss = [("shear_coefficient = 0.05", "shear_coefficient = 0.0"), ("degradation = 0.8 ", "degradation = 1.0 ")]
    campaign = slotted(*no_loss, ('fidelity = "draft"', 'fidelity = "reference"'), count=4)
    dataset = computed(campaign, tmp_path / "a.nc")
    solid = node_hits(dataset, "solid")
    assert solid is not None
    assert solid.sizes["hit"] == 1
    assert dataset["solid/tilt"].dims == ("standoff",)  # it stands for all hits
    thickness = 4e-3 * (1.0 - dataset.attrs["open_area"])
    work = 2.6e9 * thickness * math.pi * campaign.core.max_radius**2
    exact = math.sqrt(825.0**2 - 2.0 * work / 4e-3)
    assert float(solid["residual_velocity"][0]) == pytest.approx(exact, abs=0.5)
    assert float(solid["tilt"][0, 1]) == pytest.approx(0.0, abs=0.01)
    assert int(solid["status"][0]) == Status.PERFORATED


@pytest.mark.usefixtures("small_chunks")
@pytest.mark.parametrize(
    ("change", "shots"),
    [
        (('"825 m/s" ', '{ distribution = "uniform", low = 800, high = 850 } '), 256),
        (("[plate.pattern]", 'size = ["80 mm", "80 mm"]\n\n[plate.pattern]'), 256),
        (('["50 mm", "130 mm"]', '["50 mm", "130 mm"]\nsolid_reference = false'), 0),
        ((PATTERN, ""), 0),
    ],
    ids=["scatter", "rim", "off", "solid already"],
)
def test_it_takes_the_shots_of_the_first_shard_if_they_differ_and_none_if_not_requested(
    tmp_path: Path, change: tuple[str, str], shots: int
) -> None:
    result = computed(slotted(change, count=600), tmp_path / "a.nc")
    assert {*result.children} - {FINER, "law", "draws"} == ({"solid"} if shots else set())
    if shots:
        np.testing.assert_array_equal(result["solid/status"].notnull(), np.arange(600) < shots)


@pytest.mark.usefixtures("small_chunks")
def test_it_is_a_campaign_of_its_own(tmp_path: Path) -> None:
    campaign = slotted(('"825 m/s" ', '{ distribution = "uniform", low = 700, high = 850 } '), count=32)
    dataset = computed(campaign, tmp_path / "a.nc")
    level = FastLaw.model_validate_json(dataset.attrs["resolution"])
    alone = run(campaign.model_copy(update={"numerics": level}).solid(), options=CPU)
    neighbour = run(campaign, references=True, options=CPU)
    for result in (dataset, neighbour):
        np.testing.assert_array_equal(result["solid/residual_velocity"], alone["residual_velocity"])


GRID = (('sampling = "sobol"', 'sampling = "grid"'), ("seed = 1\n", ""))
EVERY = ("[hits]", "[hits]\nirreducible = false")


@pytest.mark.parametrize("changes", [(), GRID], ids=["sobol", "grid"])
def test_the_finer_hits_are_those_that_this_level_computes(changes: tuple[tuple[str, str], ...]) -> None:
    campaign = slotted(*changes, count=256)
    result = run(campaign, options=CPU)
    pair = finer_pair(result)
    assert pair is not None
    coarse, fine = pair
    assert coarse.sizes["hit"] >= PILOT_HITS
    at = coarse[v.HIT].values
    np.testing.assert_array_equal(np.flatnonzero(result["finer/status"].notnull()), at)
    level = json.loads(result.attrs[attr.RESOLUTION])["level"] + 2
    again = law_of(run(campaign.model_copy(update={"numerics": FastLaw(level=level)}), options=CPU))
    for name in (v.RESIDUAL_VELOCITY, v.TILT, v.YAW, v.STATUS):
        np.testing.assert_array_equal(fine[name].values, again[name].values[at])
        assert name == v.STATUS or (coarse[name].values != fine[name].values).any()
    assert FINER not in again.children


@pytest.mark.usefixtures("small_chunks")
def test_a_run_that_lost_its_first_shard_has_them_again(
    tmp_path: Path, assert_same_bits: Callable[[Path, Path], None], monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = slotted(EVERY, STANDARD, count=1024)
    straight, broken = tmp_path / "straight.nc", tmp_path / "broken.nc"
    run_to_file(scene, straight, options=CPU)
    with monkeypatch.context() as patched:
        patched.setattr(files, "write", lambda *_, **__: 1 / 0)
        with pytest.raises(ZeroDivisionError):
            run_to_file(scene, broken, options=CPU)
    first, *others = sorted(Path(f"{broken}.parts").glob("chunk_*.nc"))
    assert others
    first.unlink()
    run_to_file(scene, Store(broken, resume=True), options=CPU)
    assert_same_bits(straight, broken)


def test_a_file_and_a_choice_of_its_hits_keep_them(tmp_path: Path) -> None:
    whole = computed(slotted(STANDARD, count=256), tmp_path / "a.nc")
    chosen = whole.isel(hit=np.arange(40, 80)[::-1])
    pair = finer_pair(chosen)
    assert pair is not None
    finer = node_hits(whole, FINER)
    assert finer is not None
    np.testing.assert_array_equal(np.sort(pair[0][v.HIT]), np.intersect1d(chosen[v.HIT], finer[v.HIT]))
    assert finer_pair(whole.isel(hit=slice(250, None))) is None
    assert finer_pair(whole.to_dataset()) is None


def test_measures_say_what_the_numerics_may_shift_them_by_and_a_finer_level_agrees() -> None:
    message, truth = (
        law_of(run(slotted(EVERY, count=1024).model_copy(update={"numerics": numerics}), options=CPU))
        for numerics in (FastLaw(), FastLaw(level=6))
    )
    requested = [
        Measure.parse(text)
        for text in (
            "mean(residual_velocity)",
            "mean(tilt@130mm)",
            "quantile(tilt@130mm, 0.9)",
            "P(tilt@130mm > 30 deg)",
            "P(perforated)",
        )
    ]
    actual, exact = estimated(message, requested), estimated(truth, requested)
    for one in requested:
        shift = actual[one].numerics
        assert not np.isnan(shift)
        # The hits whose yes turns to no are few: chance, which the interval by the hits has.
        changed = np.sum(one.values(message.to_dataset()) != one.values(truth.to_dataset())) if one.is_binary else 0
        assert abs(actual[one].value - exact[one].value) <= shift + 2.0 * np.sqrt(changed) / message.sizes["hit"], one
        assert np.isnan(exact[one].numerics)
    for one, other in zip(effectiveness(message).itertuples(), effectiveness(truth).itertuples(), strict=True):
        if one.hit is None and not one.measure.is_binary:
            assert abs(one.value - other.value) <= (one.numerics or 0.0), one.name
    assert ", numerics ± " in text_of(inspect_view(message))
    assert ", numerics ± " not in text_of(inspect_view(truth))
    assert "numerics ± is not known: numerics.level fixes the level" in numerics_note(truth)
    assert "numerics ± is not known: none of these hits" in numerics_note(message.isel(hit=slice(900, None)))
    assert any("numerics ± is not known of b: " in note for note in compare({"a": message, "b": truth}).notes)
