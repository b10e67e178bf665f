"""Searches: a design file is read or refused, fronts that are known, and the same front when it is resumed."""

import math
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import Campaign, FastLaw
from warpimpact.analysis.numbers import text_of
from warpimpact.cli import main
from warpimpact.errors import CampaignError, Interrupted, OutputError
from warpimpact.measures.estimates import estimated
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import ELEMENTS, node_hits
from warpimpact.optimisation import confirmation
from warpimpact.optimisation.confirmation import (
    ConfirmedTarget,
    bound_verdict,
    confirm_designs,
    goal_estimate,
    nondominated,
    objectives_and_excesses,
    shifted_goals,
)
from warpimpact.optimisation.design import design_from, read_design, target_weights, violations
from warpimpact.optimisation.front import NONE_FEASIBLE, designs_folder, front_view
from warpimpact.optimisation.optimise import optimise, pilot_numerics
from warpimpact.results.files import read
from warpimpact.runs.options import RunOptions, RunProgress
from warpimpact.runs.store import Store
from warpimpact.solver.accuracy import FIRST_AT_BASE
from warpimpact.solver.device import Worker
from warpimpact.statistics.comparisons import shifted_numbers

from ...options import CPU
from ..conftest import drawn_result
from .conftest import CORE, HOLES, SEARCH, WEIGHT_AND_ENERGY, design

ALTERNATIVES = """
[variables]
thickness = { low = "3 mm", high = "5 mm", step = "0.5 mm" }
"plate.pattern" = [
  { name = "round", shape = "circle", diameter = { low = "4 mm", high = "6 mm" }, spacing = ["9 mm", "9 mm"] },
  { name = "slots", shape = "slot", width = "4 mm", length = "8 mm", spacing = [{ low = 8e-3, high = 9e-3 }, 16e-3] },
]
"""


def test_behind_a_base_a_search_runs_at_the_level_of_a_run() -> None:
    base = '[[layer]]\ngap = "100 mm"\nthickness = "6 mm"\nresistance = "1 GPa"'
    parts = CORE.replace("level = 0", ""), HOLES, base, '[variables]\nthickness = ["4 mm"]', WEIGHT_AND_ENERGY
    one = design_from("\n".join(parts), "design.toml", Path())
    tables = one.tables(one.space.points()[0])
    pilot = pilot_numerics(one, tables, 0, worker=Worker("cpu"), report=None)
    assert FastLaw.model_validate_json(pilot.attrs["numerics"]).level == FIRST_AT_BASE


def test_what_stands_below_an_alternative_counts_with_it_alone() -> None:
    one = design(ALTERNATIVES, WEIGHT_AND_ENERGY)
    names = [variable.name for variable in one.space.variables]
    assert names == ["thickness", "plate.pattern", "plate.pattern[round].diameter", "plate.pattern[slots].spacing.0"]
    assert math.isinf(one.space.size)
    slots = one.space.at([2, 1, 0.5, 0.5])
    assert slots.tolist()[:2] == [4.0, 1.0]
    assert np.isnan(slots[2])
    target, _ = violations(one, one.tables(slots))
    assert target is not None
    plate = target.layers[0]
    assert (plate.thickness, plate.pattern.shape, plate.pattern.spacing[0]) == (0.004, "slot", 8.5e-3)
    assert one.space.text(slots) == "thickness = 4 mm, plate.pattern = slots, plate.pattern[slots].spacing.0 = 0.0085"


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (('[variables]\nthickness = "4 mm"', WEIGHT_AND_ENERGY), 'thickness: got "4 mm", but it must be a range'),
        (('[variables]\nthickness = { low = "5 mm", high = "4 mm" }', WEIGHT_AND_ENERGY), "low must not be greater"),
        (('[variables]\nthickness = { low = "5 mm", high = "1 cm" }', WEIGHT_AND_ENERGY), "the unit must be one"),
        (('[variables]\nthickness = ["3 mm", "3 mm"]', WEIGHT_AND_ENERGY), "but each must differ"),
        (('[variables]\nthicknes = ["3 mm"]', WEIGHT_AND_ENERGY), 'unknown input "thicknes"'),
        (('[variables]\n"plate.pattern" = [{ shape = "none" }]', WEIGHT_AND_ENERGY), "each with a name"),
        (('[[objectives]]\nmeasure = "weight"',), 'objectives[0].measure: got "weight"'),
        ((WEIGHT_AND_ENERGY, '[[bounds]]\nmeasure = "P(stopped)"'), "needs at_most or at_least"),
        ((WEIGHT_AND_ENERGY, "[stop]\nhalf_width = 1"), "a design file takes no [stop]"),
    ],
)
def test_a_design_that_cannot_be_searched_is_refused(parts: tuple[str, ...], message: str) -> None:
    with pytest.raises(CampaignError) as error:
        design(*parts)
    assert message in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("constraint", "broken"),
    [
        ('smallest_ligament = "3.1 mm"', "ligament of 3 mm, but it must be at least 3.1 mm"),
        ('smallest_ligament = "2.9 mm"', ""),
        ('smallest_hole = "5.1 mm"', "hole of 5 mm"),
        ('largest_hole = "4.9 mm"', "hole of 5 mm"),
        ('smallest_corner_radius = "2.6 mm"', "corner radius of 2.5 mm"),
        ("largest_open_area = 0.3", "open area of 0.3068"),
        ("smallest_open_area = 0.31", "open area of 0.3068"),
        ('largest_areal_density = "21 kg/m^2"', "areal density of 21.77 kg/m²"),
        ('smallest_areal_density = "22 kg/m^2"', "areal density of 21.77 kg/m²"),
    ],
)
def test_constraints_are_checked_before_anything_is_computed(constraint: str, broken: str) -> None:
    one = design(HOLES, WEIGHT_AND_ENERGY, "[constraints]", constraint)
    _, broken_ones = violations(one, one.tables(one.space.at([])))
    assert [broken in text for _, _, text in broken_ones] == ([True] if broken else [])


def test_the_weight_of_the_add_on_alone_is_bounded_and_minimised() -> None:
    base = '[[layer]]\nthickness = "10 mm"\nresistance = "1 GPa"\n'
    goals = WEIGHT_AND_ENERGY.replace('"areal_density"', '"add_on_areal_density"')
    one = design(HOLES, goals, base, '[constraints]\nlargest_add_on_areal_density = "21 kg/m^2"')
    target, broken = violations(one, one.tables(one.space.at([])))
    assert "areal density of the add-on of 21.77 kg/m², but it must be at most 21" in broken[0][2]
    assert target is not None
    weights = target_weights(target)
    assert weights["add_on_areal_density"] == pytest.approx(weights["areal_density"] - 78.5)
    assert one.file.objectives[0].spec.quantity.label == "areal density of the add-on"


@pytest.mark.parametrize(
    ("measure", "sentence"),
    [
        ('"base_depht"', "did you mean mean(base_depth)?"),
        ('"mean(tilt)"', "neither is better"),
        (
            '"worst_point(base_depth)"',
            "a search takes no worst point",
        ),
        ('"mean(bending_stress)"\ngoal = "minimise"', "needs output.bending = true"),
        ('"mean(broken_time)"\ngoal = "minimise"', "needs output.bending = true and core.strength"),
    ],
)
def test_a_measure_that_no_search_takes_is_refused(measure: str, sentence: str) -> None:
    with pytest.raises(CampaignError) as error:
        design(f"[[objectives]]\nmeasure = {measure}\n")
    assert sentence in str(error.value)


THICKNESS = '[variables]\nthickness = { low = "2 mm", high = "8 mm" }\n'
FEW = f"{SEARCH}confirmed = 3\n"
SEARCHED = (
    "[variables]",
    'thickness = { low = "2 mm", high = "6 mm" }',
    '"plate.pattern.diameter" = { low = "3 mm", high = "9 mm" }',
    HOLES,
    WEIGHT_AND_ENERGY,
)
THREATS = [f'[[threats]]\nname = "{name}"\nimpact = {{ velocity = {v} }}' for name, v in (("slow", 600), ("fast", 900))]


def _same(one: xarray.Dataset, other: xarray.Dataset) -> None:
    xarray.testing.assert_identical(one.drop_attrs(), other.drop_attrs())


def test_the_front_of_solid_plates_is_that_of_the_work() -> None:
    """docs/model.md §6.1 without friction: m (v₀² − v²)/2 = Y h πR², so v²/v₀² falls on a line over ρh."""
    front = optimise(design(THICKNESS, WEIGHT_AND_ENERGY, SEARCH))
    density, fraction = front["front_result"].values.T
    radius = 3.0e-4 + 0.24**2 / (4 * 5.29)  # the largest of r(s) = c0 + c1 s + c2 s²
    work = 2600e6 * (density / 7850.0) * np.pi * radius**2
    expected = 1.0 - work / (0.5 * 4e-3 * 825.0**2)
    assert fraction == pytest.approx(expected, abs=1e-3)
    assert front.sizes["front"] == front.sizes["design"] == 12  # none beats another
    assert front["front_confirmed"].values.all()


def test_a_space_of_few_points_is_searched_whole() -> None:
    """140 points of 151 break the constraint, more in a row than a search waits for."""
    steps: list[RunProgress] = []
    reference = '[[references]]\nname = "thin"\nplate = { thickness = "3 mm", resistance = "2600 MPa" }\n'
    least = "[constraints]\nsmallest_areal_density = 76.8\n"  # 9.78 mm
    thickness = '[variables]\nthickness = { low = "7 mm", high = "10 mm", step = "0.02 mm" }\n'
    few = SEARCH.replace("designs = 12", "designs = 400").replace("population = 6", "population = 4")
    plan = design(thickness, WEIGHT_AND_ENERGY, least, reference, few)
    front = optimise(plan, options=RunOptions(progress=steps.append))
    assert (front.sizes["design"], front.sizes["front"], front.attrs["refused_designs"]) == (11, 11, 140)
    assert all(step.done <= step.total for step in steps)
    done = [step.done for step in steps]
    assert done == sorted(done)
    assert done[-1] == 11


def test_the_front_has_what_keeps_the_bounds_and_is_not_dominated_beyond_rounding() -> None:
    bound = '[[bounds]]\nmeasure = "areal_density"\nat_most = 30.0\n'
    plan = design(THICKNESS, WEIGHT_AND_ENERGY, bound, SEARCH)

    heavier, lighter = [30.0 * (1 + 1e-9), 0.5], [30.0 * (1 - 1e-9), 0.5 + 1e-9]
    beyond, unknown, light, dominated = [31.0, 0.1], [20.0, np.nan], [10.0, 0.9], [20.0, 0.95]

    def goals(*designs: list[float]) -> np.ndarray:
        return np.array([[*objectives, objectives[0]] for objectives in designs])

    _, excesses = objectives_and_excesses(plan, goals(heavier, beyond))
    assert excesses.astype(bool).tolist() == [[False], [True]]
    assert nondominated(plan, goals(heavier, lighter)).tolist() == [0]  # they agree in seven digits
    assert nondominated(plan, goals(beyond, unknown, heavier, light, dominated)).tolist() == [3, 2]


def test_a_seed_gives_one_search_and_another_seed_another() -> None:
    one, same, other = (optimise(design(*SEARCHED, FEW, f"seed = {seed}")) for seed in (1, 1, 2))
    _same(one, same)
    assert not np.array_equal(one["value"].values, other["value"].values)


def test_campaigns_of_the_front_run_as_they_are(tmp_path: Path) -> None:
    """A file for each design against the first threat, by the printed name, and one for each other threat; beside them
    the answers, in the same order."""
    output = tmp_path / "front.nc"
    front = optimise(design(*SEARCHED, *THREATS, FEW, folder=tmp_path), output)
    files = list(front["front_file"].values)
    further = [file.replace(".toml", "_fast.toml") for file in files]
    results = [file.replace(".toml", ending) for file in files for ending in (".nc", "_1.nc")]
    assert sorted(path.name for path in designs_folder(output).iterdir()) == sorted([*files, *further, *results])
    assert str(front["value"].sel(variable="thickness")["variable_unit"].item()) == "mm"  # a value keeps its unit
    for file, other, density in zip(files, further, front["front_result"].values[:, 0], strict=True):
        campaigns = [Campaign.from_toml(designs_folder(output) / name) for name in (file, other)]
        assert [campaign.impact.velocity for campaign in campaigns] == [600.0, 900.0]
        assert campaigns[0].target.areal_density == pytest.approx(density, rel=1e-9)
    assert front["front_worst_threat"].values.tolist() == [["", "fast"]] * len(files)  # a weight has no threat
    assert "worst threat: fast" in text_of(front_view(front))


def test_a_folder_with_files_of_somebody_is_left_alone(tmp_path: Path) -> None:
    folder = designs_folder(tmp_path / "front.nc")
    folder.mkdir()
    own = folder / "design_00.toml"
    own.write_text("mine")
    for resume in (False, True):
        with pytest.raises(OutputError, match="front_designs: contains files already"):
            optimise(design(*SEARCHED, FEW), Store(tmp_path / "front.nc", resume=resume))
    assert own.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [folder]


def test_an_interrupted_search_is_resumed_to_the_same_front(tmp_path: Path) -> None:
    plan, output, undisturbed = design(*SEARCHED, FEW), tmp_path / "front.nc", optimise(design(*SEARCHED, FEW))

    def interrupt(now: RunProgress) -> None:
        if now.done > 6:
            raise KeyboardInterrupt

    with pytest.raises(Interrupted, match=r"saved in .*; continue with --resume"):
        optimise(plan, output, options=RunOptions(progress=interrupt))
    saved = {path.name: path.stat().st_mtime_ns for path in (tmp_path / "front.nc.parts").glob("chunk_*")}
    assert len(saved) > 1
    _same(optimise(plan, Store(output, resume=True)), undisturbed)
    assert not (tmp_path / "front.nc.parts").exists()


def test_a_complete_search_is_resumed_to_its_campaigns(tmp_path: Path) -> None:
    """As after a death between the result and its campaigns; a campaign that was changed is kept."""
    file, output = tmp_path / "d.toml", tmp_path / "front.nc"
    file.write_text("\n".join([CORE, *SEARCHED, FEW]))
    command = ["optimise", str(file), "-o", str(output), "-q", "--resume"]
    assert main(command) == 0
    changed, *others = sorted(designs_folder(output).glob("*.toml"))
    before = [path.read_text() for path in others]
    for path in (*others, output.with_suffix(".png")):
        path.unlink()
    changed.write_text("changed")
    when = output.stat().st_mtime_ns
    with pytest.warns(UserWarning, match=f"{changed.name}: differs from the design of the front and is kept"):
        optimise(read_design(file), Store(output, resume=True))
    assert main(command) == 0
    assert output.with_suffix(".png").exists()
    assert (output.stat().st_mtime_ns, changed.read_text()) == (when, "changed")
    assert [path.read_text() for path in others] == before
    with pytest.raises(OutputError, match=r"exists already|contains files already"):
        optimise(read_design(file), output)


def test_no_design_within_the_bounds_is_an_outcome() -> None:
    bound = '[[bounds]]\nmeasure = "P(stopped)"\nat_least = 0.9\n'
    front = optimise(design(*SEARCHED, bound, FEW))
    assert front.attrs["outcome"] == NONE_FEASIBLE
    assert (front.sizes["design"], front["front_confirmed"].values.any()) == (12, False)
    view = text_of(front_view(front))
    assert "no design meets the bounds: P(stopped) >= 0.9" in view
    assert "breaks its bound" in view


def test_an_infeasible_space_is_refused_with_what_rules_it_out() -> None:
    constraints = "[constraints]", 'smallest_hole = "5 mm"', 'largest_hole = "4.9 mm"'
    sentence = r"none of (\d+) designs keeps all; \d+ break (smallest|largest)_hole, and the nearest of them has"
    with pytest.raises(CampaignError, match=sentence):
        optimise(design(*SEARCHED, *constraints, SEARCH))


def test_the_worst_threat_counts() -> None:
    both, alone = (optimise(design(HOLES, WEIGHT_AND_ENERGY, *some, SEARCH)) for some in (THREATS, THREATS[1:]))
    worst, fast = both["front_result"].values[0, 1], alone["front_result"].values[0, 1]
    assert fast <= worst < 1.2 * fast  # in some draws the slow one is the worst


def test_a_limit_is_that_of_the_command(tmp_path: Path) -> None:
    one = design(HOLES, '[[objectives]]\nmeasure = "V50"\n', SEARCH, folder=tmp_path)
    front = optimise(one, tmp_path / "front.nc")
    (path,) = designs_folder(tmp_path / "front.nc").glob("*.toml")
    hits = f'[hits]\nsampling = "sobol"\ncount = 64\nirreducible = true\nseed = {one.fresh_seed}'
    path.write_text(path.read_text().partition("[hits]")[0] + hits)
    assert main(["limit", str(path), "-o", str(tmp_path / "limit.nc"), "-q"]) == 0
    (score,) = estimated(read(tmp_path / "limit.nc"), [Measure.parse("V50")]).values()
    ends = [float(front[f"front_result{end}"][0, 0]) for end in ("", "_low", "_high")]
    assert ends == [score.value, score.low, score.high]


THIN = """
title = "thin"
core = { shape = "cone", diameter = "6 mm", length = "16 mm", cone_length = "8 mm", mass = "3 g" }
impact = { velocity = "800 m/s" }
numerics = { level = 0 }
output = { standoffs = ["50 mm"] }
continuum = { materials = ["AA6082-T6"], spacing = "1.2 mm" }
variables = { thickness = ["2.4 mm", "3 mm"] }
[plate]
thickness = "2.4 mm"
resistance = "1.1 GPa"
density = "2700 kg/m^3"
pattern = { shape = "circle", diameter = "5 mm", spacing = ["8 mm", "8 mm"] }
[[objectives]]
measure = "areal_density"
[[objectives]]
measure = "mean(residual_velocity)"
[[references]]
name = "solid"
plate = { thickness = "2.4 mm", resistance = "1.1 GPa", density = "2700 kg/m^3" }
[search]
designs = 2
hits = 16
confirm_hits = 64
"""


@pytest.mark.usefixtures("coarse_elements")
def test_elements_confirm_a_front_later_and_once(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The answers of the front are those of the results beside it, which nobody computes again."""
    path, output = tmp_path / "thin.toml", tmp_path / "thin.nc"
    path.write_text(THIN, encoding="utf-8")
    plain = optimise(path, output, options=CPU)
    path.write_text(THIN.replace('spacing = "1.2 mm"', 'spacing = "1.2 mm", hits = 5'), encoding="utf-8")
    dataset = optimise(path, Store(output, resume=True), options=CPU)
    xarray.testing.assert_equal(dataset["law_result"], plain["law_result"])
    names = ["design_00", "design_01", "reference_00"]
    assert sorted(one.stem for one in (tmp_path / "thin_designs").glob("*.nc")) == names
    mean, results = Measure.parse("mean(residual_velocity)"), {}
    for name in names:
        results[name] = read(tmp_path / "thin_designs" / f"{name}.nc")
        assert node_hits(results[name], ELEMENTS).sizes["hit"] == 5
    for place, file in enumerate(dataset["front_file"].values):
        (of_map,) = estimated(results[file.removesuffix(".toml")], [mean]).values()
        ends = [dataset[f"front_result{end}"].values[place, 1] for end in ("_low", "", "_high")]
        assert ends == [of_map.low, of_map.value, of_map.high]
        assert dataset["result"].values[int(dataset["front_design"][place]), 1] == of_map.value
    monkeypatch.setattr(confirmation, "run_to_file", None)  # it is all there
    xarray.testing.assert_identical(optimise(path, Store(output, resume=True), options=CPU), dataset)


BOUND = '[[bounds]]\nmeasure = "P(perforated)"\nat_most = 0.1\n'
SIX = "[search]\nconfirmed = 6\n"


def test_a_goal_moves_as_the_nearest_answer_does() -> None:
    plan = design(THICKNESS, WEIGHT_AND_ENERGY, BOUND)
    thickness, weight = np.array([2.0, 3.0, 6.0, 7.0]), np.array([16.0, 24.0, 47.0, 55.0])
    law = np.column_stack([weight, [0.9, 0.8, 0.5, 0.4], [1.0, 1.0, 0.5, 0.2]])
    answers = {0: np.array([16.0, 0.7, 1.0]), 3: np.array([55.0, np.nan, 0.0])}
    shifted = shifted_goals(plan, thickness[:, None], law, answers)
    assert shifted[:, 0].tolist() == weight.tolist()
    np.testing.assert_allclose(shifted[:3, 1], [0.7, 0.8 * 0.7 / 0.9, 0.5])  # an unknown answer moves nothing
    assert shifted[:, 2].tolist() == [1.0, 1.0, 0.0, 0.0]  # no core is stopped, or all are
    up = shifted_numbers(np.array([0.2, 1.0]), np.array([0.6] * 2), np.array([0.8] * 2), (0.0, 1.0))
    np.testing.assert_allclose(up, [0.6, 1.0])
    assert np.isnan(shifted[3, 1])


@pytest.mark.parametrize("offset", [-0.9, 0.45])
def test_bounds_are_those_of_the_answers(offset: float) -> None:
    """P falls from 1 at 2 mm to 0 at 8 mm by the fast law; the answer is less, or more, everywhere."""
    plan = design(THICKNESS, '[[objectives]]\nmeasure = "areal_density"\n', BOUND, SIX)
    thickness = np.linspace(2.0, 8.0, 25)
    law = np.column_stack([7.85 * thickness, 1.0 - (thickness - 2.0) / 6.0])
    truth = np.column_stack([law[:, 0], np.clip(law[:, 1] + offset, 0.0, 1.0)])
    confirmed: list[int] = []

    def confirm(place: int, number: int) -> ConfirmedTarget:
        assert place == len(confirmed)
        confirmed.append(number)
        return ConfirmedTarget(np.repeat(truth[number][:, None], 3, axis=1), ["", ""], None)

    known, goals = confirm_designs(plan, thickness[:, None], law, confirm)
    assert list(known) == confirmed
    assert len(confirmed) <= 6
    best = nondominated(plan, truth)
    assert nondominated(plan, goals).tolist() == best.tolist()
    assert set(best) <= set(confirmed)


def test_a_law_that_ties_all_designs_hides_none() -> None:
    """All cores pass by the fast law; the answers fall from 1 at 2 mm to 0 at 8 mm, and 0.1 is at 7.4 mm."""
    plan = design(THICKNESS, '[[objectives]]\nmeasure = "areal_density"\n', BOUND, SIX)
    thickness = np.linspace(2.0, 8.0, 25)
    law = np.column_stack([7.85 * thickness, np.ones(25)])

    def confirm(place: int, number: int) -> ConfirmedTarget:
        truth = np.array([law[number, 0], 1.0 - number / 24])
        return ConfirmedTarget(np.repeat(truth[:, None], 3, axis=1), ["", ""], None)

    known, _ = confirm_designs(plan, thickness[:, None], law, confirm)
    assert next(iter(known)) == 24
    kept = [number for number, one in known.items() if one.ends[1, 0] <= 0.1]
    assert len(known) <= 6
    assert min(kept) in (22, 23)


def test_over_several_threats_the_worst_counts_in_each_draw() -> None:
    """Of two threats, 600 ± 100 m/s in opposite draws, the worst is 700 in all of them and the mean 600."""
    goals = '[[objectives]]\nmeasure = "mean(residual_velocity)"\n'
    velocities = np.repeat([[500.0], [700.0]] * 8, 4, axis=1)
    one, other = {"": drawn_result(velocities)}, {"": drawn_result(velocities[::-1])}
    for threats, expected in (("worst", 700.0), ("mean", 600.0)):
        plan = design(goals, f'threats = "{threats}"', *THREATS)
        estimate, threat = goal_estimate(plan, plan.goals[0], {}, [one, other])
        assert (estimate.value, estimate.low, estimate.high) == (expected, expected, expected)
        assert (threat == "") == (threats == "mean")


def test_a_verdict_is_one_that_the_interval_carries() -> None:
    ends = [(0.0, 0.05), (0.05, 0.4), (0.2, 0.4), (np.nan, np.nan)]
    verdicts = ["keeps its bound", "open", "breaks its bound", "open"]
    assert [bound_verdict(1, 0.1, *one) for one in ends] == verdicts
    assert [bound_verdict(-1, 0.1, *one) for one in ends] == [*verdicts[:3][::-1], "open"]
