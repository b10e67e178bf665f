"""A study of sensitivity: each row is what a campaign with this change gives, at the same hits."""

import re
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from warpimpact import Campaign, run, sensitivity
from warpimpact.campaign.tables import ContinuumTable
from warpimpact.catalogue.catalogue import flow_entry
from warpimpact.cli import main
from warpimpact.errors import CampaignError
from warpimpact.measures.estimates import estimated
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import law_of
from warpimpact.plotting.studies import sensitivity_figure
from warpimpact.statistics.comparisons import shifted_numbers
from warpimpact.statistics.intervals import Estimate
from warpimpact.studies.sensitivity import (
    as_text,
    changes,
    element_changes,
    elements_note,
    largest_move,
    paired_move,
    plate_sensitivity,
    reversals,
)

from ...options import CPU
from ..conftest import drawn_result

TEXT = """title = "slots"
core = { shape = "ogive", diameter = "6 mm", crh = 3.0, length = "27 mm", mass = "4 g" }
numerics = { level = 1 }
[plate]
thickness = "4 mm"
resistance = "2.6 GPa"
shear_coefficient = 0.05
degradation = 0.8
pattern = { shape = "circle", diameter = "5 mm", spacing = ["8 mm", "8 mm"] }
[impact]
velocity = "825 m/s"
[hits]
count = 64
[output]
standoffs = ["130 mm"]
"""
OF_CATALOGUE = """title = "catalogue"
core = { threat = ".30 AP M2" }
plate = { material = "HHA Class 1", thickness = "6 mm" }
hits = { count = 4 }
"""
MEAN = "residual velocity, mean [m/s]"
LAYER = '[[layer]]\ngap = "100 mm"\nthickness = "6 mm"\nresistance = "1 GPa"\n'


def read(text: str = TEXT) -> Campaign:
    return Campaign.from_text(text, name="a", folder=Path())


WEAKER, STRONGER = (f"elements: strength at its {end} end" for end in ("low", "high"))
ELEMENTS = '[continuum]\nmaterials = ["AA6082-T6"]\nspacing = "1.2 mm"\nhits = 6\n'


@pytest.mark.usefixtures("coarse_elements")
def test_elements_have_rows_of_their_own() -> None:
    """A stronger plate and friction take more from the cores."""
    thin = TEXT.replace("4 mm", "2.4 mm", 1)
    table = sensitivity(read(thin + ELEMENTS), hits=16, measures=["mean(residual_velocity)"], options=CPU)
    assert {"elements: friction 0.06", WEAKER, STRONGER} < {*table.index}
    assert table[MEAN]["elements: friction 0.06"] < table[MEAN]["as given"] - 1.0
    assert table[MEAN][STRONGER] < table[MEAN]["as given"] < table[MEAN][WEAKER]


def test_elements_are_open_where_paired_hits_move_by_more_than_the_interval() -> None:
    measure = Measure.parse("mean(residual_velocity)")
    given = np.array([300.0, 310.0, 320.0, np.nan])
    changed = np.array([280.0, 290.0, np.nan, 500.0])
    assert paired_move(measure, given, changed) == -20.0
    assert np.isnan(paired_move(measure, given, np.full(4, np.nan)))
    moves = {"elements: a": {measure: -20.0}, "elements: b": {measure: 4.0}}
    note = elements_note(moves, {measure: Estimate(600.0, 595.5, 604.5)})
    assert note.endswith("answer: residual velocity, mean [m/s] (± 4.5): a -20.")
    assert elements_note(moves, {measure: Estimate(600.0, 575.0, 625.0)}) == ""


def test_changes_of_elements_leave_out_what_is_given() -> None:
    """All stresses of a material vary by the error of its strength, or by 5 %."""
    elements = ContinuumTable(materials=("AA7075-T651",), friction=0.06)
    error, changes = flow_entry("AA7075-T651").strength_error or 0.05, element_changes(elements)
    assert list(changes) == ["elements: friction 0", WEAKER, STRONGER, "elements: standard size"]
    given, stronger = elements.method.flows[0], changes[STRONGER].flows[0]
    assert stronger.yield_stress == pytest.approx((1.0 + error) * given.yield_stress)
    assert stronger.hardening == pytest.approx((1.0 + error) * given.hardening)


def test_what_scatters_does_not_change() -> None:
    scattered = read(TEXT + '[impact.yaw]\ndistribution = "normal"\nmean = 0\nstd = "1 deg"\n')
    assert {*changes(read())} - {*changes(scattered)} == {"2° of yaw"}


def test_resistance_of_the_catalogue_has_its_interval_and_follows_the_friction() -> None:
    given, changed = read(OF_CATALOGUE), changes(read(OF_CATALOGUE))
    low, high = (changed[f"resistance at its {end} end"].plate.resistance for end in ("low", "high"))
    assert 0.6 < low / given.plate.resistance < 1.0 < high / given.plate.resistance < 1.6
    named = OF_CATALOGUE.replace("thickness", "shear_coefficient = 0.1, thickness")
    of_more = changed["friction 0.1"].plate.resistance
    assert of_more == pytest.approx(read(named).plate.resistance, rel=1e-3)
    assert of_more < 0.99 * given.plate.resistance


def test_a_row_is_the_answer_moved_as_the_changed_campaign_moves_the_law() -> None:
    table = sensitivity(read(), hits=64, options=CPU)
    assert table.index[0] == "as given"
    assert list(table.columns) == [MEAN, "deflection, mean [°]", "tilt at 130 mm, mean [°]"]
    texts = {
        "as given": TEXT,
        "no weakening": TEXT.replace("degradation = 0.8", "degradation = 1.0"),
        "resistance at its high end": TEXT.replace('"2.6 GPa"', '"3.38 GPa"'),
        "friction 0": TEXT.replace("shear_coefficient = 0.05", "shear_coefficient = 0"),
        "2° of yaw": TEXT.replace("[impact]", '[impact]\nyaw = "2 deg"'),
    }
    by_number = sensitivity(read(TEXT + LAYER), hits=16, measures=["P(base_pierced)", "mean(base_depth)"], options=CPU)
    assert by_number.iloc[:, 0].between(0.0, 1.0).all()  # no probability above 1, no depth beyond the base of 6 mm
    assert by_number.iloc[:, 1].between(0.0, 6.0 + 1e-9).all()
    results = {name: run(read(text), options=CPU) for name, text in texts.items()}
    (given,) = estimated(results["as given"], [Measure.parse("mean(residual_velocity)")]).values()
    law = {name: float(law_of(result)["residual_velocity"].mean()) for name, result in results.items()}
    for name in texts:
        moved = shifted_numbers(np.array(given.value), law["as given"], law[name], (0.0, np.inf))
        assert table.loc[name, MEAN] == pytest.approx(float(moved), rel=1e-6), name
    tilts = [float(law_of(run(read(TEXT.replace("130", at)), options=CPU))["tilt"].mean()) for at in ("130", "65")]
    column = table["tilt at 130 mm, mean [°]"]
    nearer = shifted_numbers(np.array(column["as given"]), *tilts, (0.0, 180.0))
    assert column["half the stand-off"] == pytest.approx(float(nearer), rel=1e-6)
    assert table.loc["half the stand-off", MEAN] == table.loc["as given", MEAN]


def test_behind_a_base_a_study_computes_what_a_run_computes() -> None:
    given = TEXT.replace("numerics = { level = 1 }", "").replace("count = 64", "count = 16\nirreducible = false")
    campaign = read(given + LAYER)
    table = sensitivity(campaign, hits=16, measures=["mean(residual_velocity)"], options=CPU)
    (answer,) = estimated(run(campaign, options=CPU), [Measure.parse("mean(residual_velocity)")]).values()
    assert table.iloc[0, 0] == pytest.approx(answer.value, rel=1e-6)


def test_the_order_of_plates_turns_over_where_only_one_of_them_changes() -> None:
    """The stronger plate is the best, except where nothing separates them."""
    strong = read(TEXT.replace('"2.6 GPa"', '"2.7 GPa"').replace("degradation = 0.8\n", ""))
    table = plate_sensitivity({"weak": read(), "strong": strong}, "mean(residual_velocity)", hits=64, options=CPU)
    assert list(table.columns) == ["weak", "strong", "best"]
    assert table.loc["as given", "best"] == "strong"
    assert table.loc["weakens half as fast", "strong"] == table.loc["as given", "strong"]  # it does not weaken
    assert table.loc["weakening to 0.8 in 1 µs", "weak"] == table.loc["as given", "weak"]
    unsure = {"weak": 1000.0}
    implausible_notes = plate_sensitivity(
        {"weak": read(), "strong": strong}, "mean(residual_velocity)", shifts=unsure, hits=64, options=CPU
    )
    assert not any(implausible_notes["best"])
    best = pd.DataFrame({"best": ["a", "a", "b", ""]}, ["as given", "one", "two", "three"])
    sentence = "a stays the best with 1 of 3 changes; another plate is the best with: two; 1 do not decide."
    assert reversals(best) == sentence


def test_plates_differ_in_the_draws_of_their_answers() -> None:
    """1 m/s in every draw is significant, and nothing is where the draws belong to nothing in common."""
    plates = {"weak": read(), "strong": read(TEXT.replace('"2.6 GPa"', '"2.7 GPa"'))}
    first, second = np.random.default_rng(1).normal(500.0, 20.0, (2, 64, 4))
    for draws, best in ((first - 1.0, "strong"), (second, "")):
        answers = {"weak": drawn_result(first), "strong": drawn_result(draws)}
        table = plate_sensitivity(plates, "mean(residual_velocity)", answers=answers, hits=16, options=CPU)
        assert table["weak"]["as given"] == pytest.approx(first.mean())
        assert table["weak"]["no weakening"] < table["weak"]["as given"]
        assert table["best"]["as given"] == best


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("V50", "which warpimpact limit computes"),
        ("P(base_pierced)", r"P\(base_pierced\) needs a table \[\[layer\]\]"),
    ],
)
def test_a_measure_that_the_campaign_lacks_is_named(text: str, message: str) -> None:
    with pytest.raises(CampaignError, match=message):
        sensitivity(read(), measures=[text])


@pytest.mark.usefixtures("in_tmp_path")
def test_the_command_writes_table_and_figure(capsys: pytest.CaptureFixture[str]) -> None:
    Path("a.toml").write_text(TEXT, encoding="utf-8")
    arguments = ["sensitivity", "a.toml", "-o", "a.csv", "--hits", "16", "--device", "cpu", "-q"]
    assert main([*arguments, "--measure", "mean(tilt)"]) == 0
    table = pd.read_csv("a.csv", index_col="change")
    assert list(table.columns) == ["tilt at 130 mm, mean [°]"]
    sentence = f"tilt at 130 mm, mean [°] is {table.iloc[0, 0]:#.4g} as given, by 16 hits. It moves most with: "
    assert sentence in capsys.readouterr().out
    assert Path("a.png").is_file()
    assert main(arguments) == 2
    (panel,) = sensitivity_figure(table).axes
    assert len(panel.patches) == len(table) - 1
    assert {bar.get_x() for bar in panel.patches} == {table.iloc[0, 0]}


@pytest.mark.usefixtures("in_tmp_path")
def test_plates_of_a_campaign_are_ranked_with_each_change(capsys: pytest.CaptureFixture[str]) -> None:
    head, plate = TEXT.partition("[impact]")[0].split("[plate]")
    weak, strong = (f'[[plate]]{plate}name = "{name}"\n'.replace("2.6", y) for name, y in (("a", "1.0"), ("b", "5.0")))
    Path("two.toml").write_text(head + weak + strong + TEXT[TEXT.index("[impact]") :], encoding="utf-8")
    arguments = ["compare", "two.toml", "--device", "cpu", "-q", "--measure", "mean(residual_energy_fraction)"]
    assert main([*arguments, "--sensitivity"]) == 0
    shown = capsys.readouterr().out
    assert "\nresidual energy fraction, mean, by 64 hits:\n" in shown
    rank, given = (re.search(rf"^{row}.*$", shown, re.MULTILINE)[0] for row in ("b  ", "as given"))
    assert rank.split()[5] == given.split()[3]  # one number of plate b
    assert "\nNo plate is significantly the best as given.\n" in shown
    assert main(["compare", "a.nc", "b.nc", "--sensitivity"]) == 2
    assert "Give the campaign with their [[plate]]." in capsys.readouterr().err


def test_shares_are_in_percent_and_the_first_that_moves_is_in_the_sentence() -> None:
    table = pd.DataFrame({"P(broken)": [0.0] * 3, "v": [0.5, 0.379, 0.6]}, ["as given", "a", "b"])
    table.attrs |= {"digits": {"v": ".1%"}, "hits": 1}
    assert as_text(table)["v"].tolist() == ["50.0%", "37.9%", "60.0%"]
    assert largest_move(table) == "v is 50.0% as given, by 1 hit. It moves most with: a (37.9%), b (60.0%)."
    assert largest_move(table[["P(broken)"]]) == "By 1 hit no change moves these numbers."
