"""The whole search against fronts that are known, and against itself: killed, resumed, with other seeds."""

from pathlib import Path

import numpy as np
import pytest
import xarray
from scipy.stats.mstats import hdquantiles

from warpimpact import Campaign
from warpimpact.analysis.effectiveness import effectiveness
from warpimpact.analysis.numbers import text_of
from warpimpact.campaign.text import CampaignError
from warpimpact.cli import main
from warpimpact.optimisation import search
from warpimpact.optimisation.design import read_design
from warpimpact.optimisation.front_view import front_view
from warpimpact.optimisation.objectives import Candidate, excesses
from warpimpact.optimisation.optimise import folder_of, optimise, optimise_to_file
from warpimpact.optimisation.search import SearchProgress, fresh_seed, front_of
from warpimpact.results import files
from warpimpact.results import front as f
from warpimpact.results.files import OutputError, read
from warpimpact.results.kinds import FRONT

from .conftest import CORE, HOLES, SEARCH, WEIGHT_AND_ENERGY, design

RANGE = '{ low = "4 mm", high = "4 mm" }'
THICKNESS = '[variables]\nthickness = { low = "2 mm", high = "8 mm" }\n'


def test_the_front_of_solid_plates_is_that_of_the_work() -> None:
    """docs/model.md §6.1 without friction: m (v₀² − v²)/2 = Y h πR², so v²/v₀² falls on a line over ρh."""
    found = optimise(design(THICKNESS, WEIGHT_AND_ENERGY, SEARCH))
    density, fraction = found[f.FRESH].values.T
    radius = 3.0e-4 + 0.24**2 / (4 * 5.29)  # the largest of r(s) = c0 + c1 s + c2 s²
    work = 2600e6 * (density / 7850.0) * np.pi * radius**2
    expected = 1.0 - work / (0.5 * 4e-3 * 825.0**2)
    assert fraction == pytest.approx(expected, abs=1e-3)
    assert found.sizes["front"] == found.sizes["design"] == 12  # none beats another
    assert found[f.CONFIRMED].values.all()


@pytest.mark.parametrize("thickness", ["", f"thickness = {RANGE}", 'thickness = ["4 mm"]'])
def test_a_space_of_one_point_returns_it(thickness: str) -> None:
    found = optimise(design("[variables]", thickness, HOLES, WEIGHT_AND_ENERGY, SEARCH))
    assert (found.sizes["design"], found.sizes["front"]) == (1, 1)
    assert 'thickness = "4 mm"' in str(found[f.CAMPAIGN].values[0])


def test_a_space_of_few_points_is_searched_whole() -> None:
    """140 points of 151 break the constraint, more in a row than a search waits for."""
    told: list[SearchProgress] = []
    reference = '[[references]]\nname = "thin"\nplate = { thickness = "3 mm", resistance = "2600 MPa" }\n'
    least = "[constraints]\nsmallest_areal_density = 76.8\n"  # 9.78 mm
    thickness = '[variables]\nthickness = { low = "7 mm", high = "10 mm", step = "0.02 mm" }\n'
    few = SEARCH.replace("designs = 12", "designs = 400").replace("population = 6", "population = 4")
    found = optimise(design(thickness, WEIGHT_AND_ENERGY, least, reference, few), progress=told.append)
    assert (found.sizes["design"], found.sizes["front"], found.attrs[f.REFUSED]) == (11, 11, 140)
    assert all(now.done <= now.total for now in told)
    searching = [now for now in told if not now.what.endswith("fresh hits")]
    assert [now.done for now in searching] == sorted(now.done for now in searching)
    assert searching[-1].done == searching[-1].total == 11
    for what in ("pilots for fresh hits", "fresh hits"):
        of_phase = [now for now in told if now.what == what]
        assert {now.total for now in of_phase} == {12}
        assert {0, 12} <= {now.done for now in of_phase}


SEARCHED = (
    "[variables]",
    'thickness = { low = "2 mm", high = "6 mm" }',
    '"plate.pattern.diameter" = { low = "3 mm", high = "9 mm" }',
    HOLES,
    WEIGHT_AND_ENERGY,
)


def _same(one: xarray.Dataset, other: xarray.Dataset) -> None:
    xarray.testing.assert_identical(one.drop_attrs(), other.drop_attrs())


def test_the_front_has_what_keeps_the_bounds_and_is_not_dominated_beyond_rounding() -> None:
    bound = '[[bounds]]\nmeasure = "areal_density"\nat_most = 30.0\n'
    plan = design(THICKNESS, WEIGHT_AND_ENERGY, bound, SEARCH)

    def candidate(density: float, energy: float) -> Candidate:
        return Candidate(np.zeros(1), {}, {}, results=np.array([density, energy, density]))

    heavier, lighter = candidate(30.0 * (1 + 1e-9), 0.5), candidate(30.0 * (1 - 1e-9), 0.5 + 1e-9)
    assert not excesses(plan, heavier.results).any()
    assert front_of(plan, [heavier, lighter]).tolist() == [0]  # they agree in seven digits
    beyond, unknown, light = candidate(31.0, 0.1), candidate(20.0, np.nan), candidate(10.0, 0.9)
    assert front_of(plan, [beyond, unknown, heavier, light, candidate(20.0, 0.95)]).tolist() == [3, 2]


def test_a_seed_gives_one_search_and_another_seed_another() -> None:
    one, same, other = (optimise(design(*SEARCHED, SEARCH, f"seed = {seed}")) for seed in (1, 1, 2))
    _same(one, same)
    assert not np.array_equal(one[f.VALUE].values, other[f.VALUE].values)


def test_a_campaign_of_the_front_runs_as_it_is(tmp_path: Path) -> None:
    campaigns = optimise_to_file(design(*SEARCHED, SEARCH, folder=tmp_path), tmp_path / "front.nc")
    found = files.read(tmp_path / "front.nc", FRONT)
    assert [path.name for path in campaigns] == list(found[f.FILE].values)
    assert campaigns[0].parent == folder_of(tmp_path / "front.nc")
    assert str(found[f.VALUE].sel(variable="thickness")[f.UNIT].item()) == "mm"  # a value keeps its unit
    for path, density in zip(campaigns, found[f.FRESH].values[:, 0], strict=True):
        assert Campaign.from_toml(path).target.areal_density == pytest.approx(density, rel=1e-9)
    assert "shrinkage" in text_of(front_view(found))


def test_a_folder_with_files_of_somebody_is_left_alone(tmp_path: Path) -> None:
    folder = folder_of(tmp_path / "front.nc")
    folder.mkdir()
    own = folder / "design_00.toml"
    own.write_text("mine")
    with pytest.raises(OutputError, match="front_designs: contains files already"):
        optimise_to_file(design(*SEARCHED, SEARCH), tmp_path / "front.nc")
    with pytest.raises(OutputError, match="front_designs: contains files already"):
        optimise_to_file(design(*SEARCHED, SEARCH), tmp_path / "front.nc", resume=True)
    assert own.read_text() == "mine"
    assert list(tmp_path.iterdir()) == [folder]


def test_a_complete_search_is_resumed_to_its_campaigns(tmp_path: Path) -> None:
    """As after a death between the result and its campaigns; a campaign that was changed is kept."""
    file, output = tmp_path / "d.toml", tmp_path / "front.nc"
    file.write_text("\n".join([CORE, *SEARCHED, SEARCH]))
    command = ["optimise", str(file), "-o", str(output), "-q", "--resume"]
    assert main(command) == 0
    changed, *others = sorted(folder_of(output).iterdir())
    before = [path.read_text() for path in others]
    for path in (*others, output.with_suffix(".png")):
        path.unlink()
    changed.write_text("changed")
    when = output.stat().st_mtime_ns
    with pytest.warns(UserWarning, match=f"{changed.name}: differs from the design of the front and is kept"):
        optimise_to_file(read_design(file), output, resume=True)
    assert main(command) == 0
    assert output.with_suffix(".png").exists()
    assert (output.stat().st_mtime_ns, changed.read_text()) == (when, "changed")
    assert [path.read_text() for path in others] == before
    with pytest.raises(OutputError, match=r"exists already|contains files already"):
        optimise_to_file(read_design(file), output)


def test_no_design_within_the_bounds_is_an_outcome() -> None:
    bound = '[[bounds]]\nmeasure = "P(stopped)"\nat_least = 0.9\n'
    found = optimise(design(*SEARCHED, bound, SEARCH))
    assert found.attrs[f.OUTCOME] == f.NONE_FEASIBLE
    assert (found.sizes["design"], found.sizes["front"]) == (12, 0)
    assert "no design keeps the bounds: P(stopped) >= 0.9" in text_of(front_view(found))


@pytest.mark.parametrize(
    ("constraint", "named"),
    [
        ('smallest_ligament = "6 mm"', "smallest_ligament"),
        ('largest_areal_density = "3 kg/m^2"', "largest_areal_density"),
    ],
)
def test_an_infeasible_space_is_refused_with_what_rules_it_out(constraint: str, named: str) -> None:
    with pytest.raises(CampaignError, match=rf"none of \d+ designs keeps {named}.*the nearest has"):
        optimise(design(*SEARCHED, "[constraints]", constraint, SEARCH))


def test_the_worst_threat_counts() -> None:
    slow, fast = (f'[[threats]]\nname = "{v}"\nimpact = {{ velocity = {v} }}' for v in (600, 900))
    both, alone = (optimise(design(HOLES, WEIGHT_AND_ENERGY, *some, SEARCH)) for some in ([slow, fast], [fast]))
    assert both[f.FRESH].values[0, 1] == pytest.approx(alone[f.FRESH].values[0, 1], rel=1e-6)


@pytest.mark.parametrize("measure", ["mean(limit_velocity)", "mean(limit_areal_density)", "V50"])
def test_a_limit_is_that_of_the_command(measure: str, tmp_path: Path) -> None:
    asked = f'[[objectives]]\nmeasure = "{measure}"\n'
    one = design(HOLES, asked, SEARCH, folder=tmp_path)
    (path,) = optimise_to_file(one, tmp_path / "front.nc")
    found = files.read(tmp_path / "front.nc", FRONT)
    hits = f'[hits]\nsampling = "sobol"\ncount = 64\nirreducible = true\nseed = {fresh_seed(one)}'
    path.write_text(path.read_text().partition("[hits]")[0] + hits)
    quantity = "velocity" if measure in ("mean(limit_velocity)", "V50") else "thickness"
    assert main(["limit", str(path), "--quantity", quantity, "-o", str(tmp_path / "limit.nc"), "-q"]) == 0
    score = effectiveness(read(tmp_path / "limit.nc"), [measure]).iloc[0]
    fresh = float(found[f.FRESH][0, 0])
    if measure == "V50":  # a smooth quantile beside an order statistic
        values = read(tmp_path / "limit.nc")["limit_velocity"].values
        assert abs(fresh - float(hdquantiles(values, [0.5])[0])) < 0.1 * (score.high - score.low)
    else:
        assert fresh == pytest.approx(score.value, rel=1e-6)


def test_a_search_says_which_library_it_needs(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(search, "find_spec", lambda name: None if name == "moocore" else name)
    with pytest.raises(CampaignError, match=r"needs moocore: pip install 'warpimpact\[optimise\]'"):
        optimise(design(HOLES, WEIGHT_AND_ENERGY, SEARCH))
