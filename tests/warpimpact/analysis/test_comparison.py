"""Plates side by side: rankings with known answers, intervals that contain the answer as often as they claim, one
sentence for what cannot be compared."""

import io
import math
import re
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import pytest
import xarray

from warpimpact.analysis.comparison import Comparison, compare, comparison_view, verdict_of
from warpimpact.analysis.numbers import text_of
from warpimpact.analysis.same_shots import shared_hits, shot_by_shot
from warpimpact.campaign.campaign import CampaignError, read_plates
from warpimpact.cli import main
from warpimpact.errors import ResultError
from warpimpact.kernels.status import Status
from warpimpact.measures.draws import standard_normals
from warpimpact.plotting import comparison_figure
from warpimpact.records import attributes as attr
from warpimpact.statistics.intervals import wilson

pytestmark = pytest.mark.usefixtures("small_chunks")
TWO_PLATES = Path(__file__).parents[3] / "campaigns" / "two_plates.toml"
TRIALS = 40
LEAST = 34  # 95 % of 40 trials: 38 ± 1.4, three standard deviations below; intervals half as wide would hold 27 times
MEAN, TAIL, TILTED = (
    "mean(residual_energy_fraction)",
    "worst_tenth(residual_energy_fraction)",
    "P(inclination@130mm > 30 deg)",
)
NUMBERS = np.random.default_rng(3)


def difference(comparison: Comparison, measure: str, one: str, other: str) -> Any:
    (row,) = (pair for pair in comparison.differences[measure].itertuples() if (pair.one, pair.other) == (one, other))
    return row


def velocities(fraction: np.ndarray | float) -> np.ndarray:
    """Residual velocities of energy fractions [m/s]."""
    return 1000.0 * np.sqrt(fraction)


def moved(dataset: xarray.Dataset) -> xarray.Dataset:
    """The same outcomes of shots that hit elsewhere."""
    return dataset.assign_coords(hit_y=dataset["hit_y"] * 0.5)


@pytest.mark.parametrize(("share", "differs"), [(1e-8, False), (1e-4, True)])
def test_rounding_is_no_difference_of_plates(share: float, differs: bool, make_plate_result) -> None:
    fraction = NUMBERS.uniform(0.5, 0.9, 500)
    one, other = (make_plate_result(velocities(part)) for part in (fraction, (1.0 + share) * fraction))
    comparison = compare({"a": one, "b": other})
    for measure in (MEAN, TAIL, "mean(residual_energy_density@130mm)"):
        pair = difference(comparison, measure, "a", "b")
        assert (pair.significant, pair.value != 0.0) == (differs, differs)
        assert comparison.ranks(measure) == ({"a": (1, 1), "b": (2, 2)} if differs else {"a": (1, 2), "b": (1, 2)})


def test_ranks_are_ranges_where_hits_do_not_decide(make_plate_result) -> None:
    """Two plates that hardly scatter differ; the third scatters so that it differs from neither."""
    plates = [
        make_plate_result(velocities(fraction))
        for fraction in (
            np.linspace(0.49, 0.51, 100),
            np.linspace(0.54, 0.56, 100),
            np.tile([0.0, 0.1, 1.0, 1.0, 0.8], 20),
        )
    ]
    comparison = compare(dict(zip(["first", "second", "wide"], plates, strict=True)))
    assert comparison.ranks(MEAN) == {"first": (1, 2), "second": (2, 3), "wide": (1, 3)}
    assert comparison.first(MEAN) == ["first", "wide"]
    assert comparison.ranks("P(stopped)") == dict.fromkeys(["first", "second", "wide"], (1, 3))


@pytest.mark.parametrize("numerics", [0.0, 0.05])
def test_plates_whose_printed_intervals_do_not_meet_have_different_ranks(
    numerics: float, make_plate_result, monkeypatch: pytest.MonkeyPatch
) -> None:
    """What is printed is what ranks, whatever the numerics may shift."""
    monkeypatch.setattr("warpimpact.measures.estimates.shift_of", lambda measure, pair: numerics)
    numbers, names, decided = np.random.default_rng(7), list("ab"), 0
    for trial in range(24):
        shares = numbers.uniform(0.1, 0.5, 2)
        plates = [
            make_plate_result(velocities(numbers.uniform(0.2, 0.3 + share, 240)), 60.0 * (numbers.random(240) < share))
            for share in shares
        ]
        comparison = compare(
            dict(zip(names, [plates[0], *(map(moved, plates[1:]) if trial % 2 else plates[1:])], strict=True))
        )
        for text, table in comparison.differences.items():
            scores, ranks = comparison.scores[text], comparison.ranks(text)
            for pair in table.itertuples():
                one, other = scores.loc[pair.one], scores.loc[pair.other]
                distance = one.high < other.low or other.high < one.low
                assert pair.significant or not distance
                first, last = sorted([ranks[pair.one], ranks[pair.other]])
                assert pair.significant or first[1] >= last[0]  # ranks of plates that may be equal meet
                decided += distance
    assert decided > 12


def test_errors_that_plates_share_cancel_in_the_difference_of_their_answers(make_plate_result, make_answer) -> None:
    """All draws are off by up to a tenth of the energy; in each of them one plate leaves 0.03 more."""
    error, hits = 0.05 * standard_normals("shared")[:, None], NUMBERS.uniform(0.4, 0.5, 64)
    one, other = (
        make_answer(make_plate_result(np.full(64, 500.0)), velocities(hits + more + error)) for more in (0.03, 0.0)
    )
    comparison = compare({"one": one, "other": other}, [MEAN])
    a, b = comparison.scores[MEAN].itertuples()
    assert a.low < b.value < a.value < b.high
    pair = difference(comparison, MEAN, "one", "other")
    assert pair.value == pytest.approx(a.value - b.value, abs=1e-12)
    assert [pair.value, pair.low, pair.high] == pytest.approx([0.03] * 3, abs=1e-6)
    assert comparison.ranks(MEAN) == {"other": (1, 1), "one": (2, 2)}
    assert comparison.hits_used == ("64 hits of each plate, by the fast law alone, the same shots",)
    (verdict,) = verdict_of(comparison)
    assert verdict == "Best by residual energy fraction, mean: other."


def test_a_plate_with_draws_and_one_without_are_independent(make_plate_result, make_answer) -> None:
    """By hand after Zou and Donner."""
    plain = make_plate_result(velocities(NUMBERS.uniform(0.4, 0.5, 64)))
    drawn = make_answer(plain, velocities(0.45 + 0.05 * standard_normals("own")[:, None] + np.zeros(64)))
    comparison = compare({"drawn": drawn, "plain": plain}, [MEAN])
    a, b = comparison.scores[MEAN].itertuples()
    pair = difference(comparison, MEAN, "drawn", "plain")
    expected = a.value - b.value - math.hypot(a.value - a.low, b.high - b.value)
    assert pair.low == pytest.approx(expected, rel=1e-9)
    (verdict,) = verdict_of(comparison)
    assert verdict.endswith(" cannot be told apart.")
    assert "Intervals do not contain the error of the method: plain." in comparison.notes


def test_values_are_those_of_each_plate_alone_however_many_are_compared(make_plate_result, make_answer) -> None:
    plates = {
        name: make_answer(
            make_plate_result(np.full(64, 500.0)),
            velocities(0.45 + 0.05 * standard_normals(name)[:, None] + NUMBERS.uniform(0.0, 0.1, 64)),
        )
        for name in "abcd"
    }
    both, every = compare({name: plates[name] for name in "ab"}, [MEAN]), compare(plates, [MEAN])
    pd.testing.assert_frame_equal(both.scores[MEAN], every.scores[MEAN].loc[["a", "b"]])
    two, four = (difference(one, MEAN, "a", "b") for one in (both, every))
    assert (four.value, four.high > two.high, four.low < two.low) == (two.value, True, True)


def test_a_clearly_better_plate_is_first_whichever_way_is_up(make_plate_result) -> None:
    fraction, tilt = NUMBERS.uniform(0.5, 0.9, 500), NUMBERS.uniform(0.0, 60.0, 500)
    plates = [
        make_plate_result(velocities(fraction + less), tilt + more) for less, more in [(0.1, 0), (0, 20), (0, 20)]
    ]
    comparison = compare(dict(zip(["worst", "one", "other"], plates, strict=True)))
    for measure in (MEAN, TAIL, "mean(residual_energy_density@130mm)", TILTED):
        assert comparison.ranks(measure) == {"one": (1, 2), "other": (1, 2), "worst": (3, 3)}
    text = text_of(comparison_view(comparison))
    assert re.search(r"\nworst +3 .* \+10.0 points \(\+10.0 to \+10.0\)\n", text)
    assert re.search(r"\nother +1 to 2 .* \+0.0 points \(\+0.0 to \+0.0\)\n", text)


def test_the_same_shots_narrow_the_interval(make_plate_result) -> None:
    common = NUMBERS.uniform(0.2, 0.8, 500)
    one, other = (make_plate_result(velocities(common + NUMBERS.uniform(0.0, 0.05, 500))) for _ in range(2))
    paired, moved_ = compare({"a": one, "b": other}), compare({"a": one, "b": moved(other)})
    assert moved_.hits_used[1:] == ("a and b: independent, because their shots hit other places of the cell",)
    for measure in (MEAN, TAIL):
        pairs = [difference(comparison, measure, "a", "b") for comparison in (paired, moved_)]
        widths = [pair.high - pair.low for pair in pairs]
        assert pairs[0].value == pytest.approx(pairs[1].value)
        assert widths[0] < 0.5 * widths[1]


def test_all_hits_count_the_common_ones_shot_by_shot(make_plate_result) -> None:
    numbers = np.random.default_rng(4)
    one, alike, other = (numbers.uniform(0.2, 0.8, 1000) for _ in range(3))
    alike = one + 0.05 * (alike - 0.5)
    plates = [make_plate_result(velocities(fraction)) for fraction in (one, alike, other)]
    comparison = compare({"a": plates[0], "b": plates[1].isel(hit=slice(200)), "c": plates[2].isel(hit=slice(200))})
    assert comparison.plates["hits"].tolist() == [1000, 200, 200]
    assert comparison.hits_used == ("hits: a 1000, b 200, c 200, the same shots",)
    assert comparison.scores[MEAN]["value"].iloc[0] == pytest.approx(one.mean())
    values = comparison.scores[MEAN]["value"]
    for name, numbers in (("b", alike), ("c", other)):
        pair = difference(comparison, MEAN, "a", name)
        assert pair.value == pytest.approx(values["a"] - values[name]) == one.mean() - numbers[:200].mean()
        assert pair.low < pair.value < pair.high


def test_equal_hits_leave_what_so_many_shots_leave_of_a_share(make_plate_result) -> None:
    """Of six cores that all are stopped, 39 % of all may pass by Wilson's interval, with any energy."""
    high = float(wilson(0, 6, 0.95)[1])
    plates = [make_plate_result(np.zeros(count), status=Status.ARRESTED) for count in (6, 6)]
    comparison = compare(dict(zip(["a", "b"], plates, strict=True)), ["P(perforated)", MEAN, "mean(residual_energy)"])
    for text in ("P(perforated)", MEAN):
        row = comparison.scores[text].iloc[0]
        assert (row.value, row.low, row.high) == pytest.approx((0.0, 0.0, high))
    pair = difference(comparison, MEAN, "a", "b")
    assert (pair.value, pair.low, pair.high) == pytest.approx((0.0, -high, high), abs=1e-9)
    energy = comparison.scores["mean(residual_energy)"].iloc[0]
    assert (energy.low, math.isnan(energy.high)) == (0.0, True)  # without a largest number there is no end
    alike = (
        compare(dict(zip(["a", "b"], [make_plate_result(np.full(6, 500.0))] * 2, strict=True)), [MEAN])
        .scores[MEAN]
        .iloc[0]
    )
    assert (alike.low, alike.high) == (0.25, 0.25)  # not at a bound: the same shot six times


@pytest.mark.parametrize(("independent", "fewest"), [(False, 400), (True, 400), (False, 150)])
def test_differences_hold_as_often_as_they_say_all_pairs_together(
    independent: bool, fewest: int, make_plate_result
) -> None:
    """Three plates of known energy fractions: mean, worst tenth and share."""
    truths = {MEAN: (0.05, 0.04), TAIL: (0.05, 0.04), TILTED: (0.1, 0.02)}
    held, numbers = dict.fromkeys(truths, 0), np.random.default_rng(9)
    for _ in range(TRIALS):
        plates = []
        common, turned = numbers.random(400), numbers.random(400)
        for shift, share in ((0.05, 0.5), (0.0, 0.4), (0.04, 0.42)):
            if independent:
                common, turned = numbers.random(400), numbers.random(400)
            fraction = 0.4 * common + 0.4 * numbers.random(400) + 0.1 + shift
            # A tenth of the tilts do not depend on the shot.
            own = np.where(numbers.random(400) < 0.1, numbers.random(400), turned)
            plates.append(make_plate_result(velocities(fraction), np.where(own < share, 60.0, 10.0)))
        if independent:
            plates = [plates[0], moved(plates[1]), moved(plates[2])]
        plates[1] = plates[1].isel(hit=slice(fewest))
        comparison = compare(dict(zip(["a", "b", "c"], plates, strict=True)))
        for measure, (above, between) in truths.items():
            exact = {("a", "b"): above, ("b", "c"): -between, ("a", "c"): above - between}
            pairs = [difference(comparison, measure, *names) for names in exact]
            if math.isnan(pairs[0].low):  # the worst tenth of few hits has no interval
                held[measure] += 1
            else:
                held[measure] += all(p.low <= exact[p.one, p.other] <= p.high for p in pairs)
    assert min(held.values()) >= LEAST, held


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"impact_velocity": ("hit", np.full(100, 900.0))}, "impact.velocity is 900.0 here, 1000.0 in a"),
        ({"standoff_point": "centre_of_mass"}, 'output.standoff_point is "centre_of_mass" here, "nose" in a'),
    ],
)
def test_plates_of_another_question_are_refused(change: dict, sentence: str, make_plate_result) -> None:
    plate = make_plate_result(velocities(np.linspace(0.5, 1.0, 100)))
    with pytest.raises(ResultError) as caught:
        compare({"a": plate, "b": plate.assign_attrs(change) if "standoff_point" in change else plate.assign(change)})
    assert str(caught.value).startswith(f"b: cannot be compared with a: {sentence}")
    with pytest.raises(ResultError, match=r"^b: has no description of its core and impact, which a comparison needs"):
        compare({"a": plate, "b": plate.drop_attrs()})


def test_the_figure_shows_every_measure_and_every_pair(make_plate_result) -> None:
    plate = make_plate_result(velocities(np.linspace(0.5, 1.0, 500)), np.linspace(0.0, 90.0, 500))
    better = make_plate_result(velocities(np.linspace(0.4, 0.9, 500)), np.linspace(0.0, 90.0, 500))
    comparison = compare({"a": plate, "b": better, "c": plate})
    short = comparison_figure(comparison)
    assert [axes.get_title(loc="left").split(";")[0] for axes in short.axes[::2]] == ["residual energy fraction"]
    assert [label.get_text() for label in short.axes[1].get_yticklabels()] == ["a − b", "c − b"]
    figure = comparison_figure(comparison, every=True)
    figure.savefig(io.BytesIO(), format="png")
    assert short.get_figheight() < 0.4 * figure.get_figheight()
    assert len(figure.axes) == 2 * 4
    lines = [line for line in figure.axes[1].lines if line.get_marker() == "o"]
    hollow = [len(line.get_xdata()) for line in lines if line.get_markerfacecolor() == "white"]
    assert (hollow, sum(len(line.get_xdata()) for line in lines)) == ([1], 3)


def of_model(hits: list[int], velocity: list[float], status: list[int], attributes: dict[str, str]) -> xarray.Dataset:
    count = len(hits)
    along = 1e-3 * np.array(hits, dtype=float)
    return xarray.Dataset(
        {
            "status": ("hit", np.array(status, dtype=np.int8)),
            "residual_velocity": ("hit", np.array(velocity)),
            "deflection": ("hit", np.zeros(count)),
            "tilt": (("hit", "standoff"), np.array(velocity)[:, None] / 10.0),
        },
        {"hit": hits, "hit_y": ("hit", along), "hit_z": ("hit", along), "standoff": [0.05]},
        attributes,
    )


def test_bias_rms_ranks_and_the_worst_hits_are_those_of_the_shared_sound_hits() -> None:
    fast = of_model([0, 1, 2, 3, 4], [700.0, 710.0, 720.0, 730.0, 740.0], [0] * 5, {})
    slow = of_model(
        [1, 2, 3, 4], [700.0, 724.0, 726.0, np.nan], [0, 0, 0, int(Status.HOURGLASSED)], {attr.CONTINUUM: "{}"}
    )
    shared = shared_hits({"slow": slow, "fast": fast})
    assert shared is not None
    view = shot_by_shot(shared)
    row = view["shot by shot"][1].loc["residual velocity, m/s"]
    difference = np.array([10.0, -4.0, 4.0])
    numbers = (3, difference.mean(), np.sqrt((difference**2).mean()), 1.0)
    assert [float(row[name]) for name in ("hits", "bias", "rms", "rank correlation")] == pytest.approx(
        numbers, abs=5e-3
    )
    assert row["largest differences at hits"].startswith("1 (+10)")
    assert "1 failed and are left out" in text_of(view)
    assert "tilt at 50 mm" in text_of(view)
    assert "contradict" not in text_of(view)


def test_models_that_contradict_each_other_are_not_compared_in_numbers() -> None:
    """Two cores arrested by one model pass at 523 and 574 m/s by the other, and one passes by both."""
    fast = of_model([4, 7, 9], [0.0, 0.0, 600.0], [int(Status.ARRESTED)] * 2 + [0], {})
    slow = of_model([4, 7, 9], [523.0, 574.0, 605.0], [0, 0, 0], {attr.CONTINUUM: "{}"})
    shared = shared_hits({"fast": fast, "slow": slow})
    assert shared is not None
    view = shot_by_shot(shared)
    text = text_of(view)
    assert "fast and slow end differently at 2 hits: 4, 7\n" in text
    assert "The models contradict each other here. Cores that pass, of 3: 1 by fast, 3 by slow. Believe neither" in text
    assert view["shot by shot"][-1].loc["residual velocity, m/s", "bias"] == "-5"


SMALL = TWO_PLATES.read_text(encoding="utf-8").replace("\nhits = 12", "") + '[numerics]\nfidelity = "draft"\n'


def test_a_campaign_with_plates_is_run_compared_and_not_run_again(
    in_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    Path("two.toml").write_text(SMALL, encoding="utf-8")
    command = ["compare", "two.toml", "--count", "256", "--device", "cpu"]
    assert main(command) == 0
    shown = capsys.readouterr().out
    assert len(shown.splitlines()) <= 10
    assert shown.startswith("residual energy fraction, mean, lower is better\n")
    assert re.search(r"\nround holes +1 ", shown)
    assert "\n256 hits of each plate, by the fast law alone, the same shots\n" in shown
    assert "Outside the tested range: " in shown
    assert sorted(path.name for path in in_tmp_path.iterdir()) == ["round holes.nc", "slots.nc", "two.png", "two.toml"]
    before = Path("slots.nc").stat()
    assert main(["compare", "slots.nc", "round holes.nc"]) == 0
    assert Path("slots.nc").stat() == before
    assert capsys.readouterr().out == shown.replace("two.png", "comparison.png")
    assert main(["compare", "slots.nc", "round holes.nc", "--all", "-o", "all.svg"]) == 0
    every = capsys.readouterr().out
    assert every.startswith("256 hits of each plate, by the fast law alone, the same shots\n")
    assert every.count("round holes") > 4
    assert main(["compare", "slots.nc", "round holes.nc", "--measure", "mean(tilt@130mm)", "-o", "tilt.svg"]) == 0
    assert capsys.readouterr().out.count("not ranked") == 2  # shown all the same, as it was asked for
    Path("two.toml").write_text(SMALL.replace("seed = 1", "seed = 2"), encoding="utf-8")
    assert main(command) == 2
    assert "slots.nc: has other hits or another campaign; give --folder FOLDER" in capsys.readouterr().err
    assert main([*command, "--folder", "second"]) == 0


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (('"round holes"', '"slots"'), 'plate[1].name: got "slots", but each plate needs its own name'),
        (('"slots"', '"../slots"'), 'plate[0].name: got "../slots", but each plate needs its own name: a letter or a'),
        (('"4 mm"\nresistance', '"4 kg"\nresistance'), ', plate "slots": plate.thickness: got "4 kg", which is not a'),
    ],
)
def test_a_wrong_plate_is_refused_in_one_sentence(change: tuple[str, str], sentence: str, tmp_path: Path) -> None:
    (tmp_path / "two.toml").write_text(SMALL.replace(*change, 1), encoding="utf-8")
    with pytest.raises(CampaignError) as caught:
        read_plates(tmp_path / "two.toml")
    assert sentence in str(caught.value)
