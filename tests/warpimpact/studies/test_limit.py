"""Limits of a campaign: the command, its file, its figure, its solid plate, and what it refuses."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from warpimpact import Campaign
from warpimpact.analysis.comparison import compare
from warpimpact.analysis.effectiveness import effectiveness
from warpimpact.analysis.numbers import text_of
from warpimpact.cli import main
from warpimpact.errors import CampaignError
from warpimpact.kernels.status import Status
from warpimpact.measures.estimates import estimated
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import node_hits
from warpimpact.plotting.studies import limit_figure
from warpimpact.report.report import report_page
from warpimpact.results import files
from warpimpact.runs.compute import compute_hits, limit_of
from warpimpact.runs.replay import replay
from warpimpact.runs.run import run_to_file
from warpimpact.scene import make_shots
from warpimpact.solver.accuracy import PILOT_LIMITS
from warpimpact.solver.device import Worker
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.limit import MOST_RUNS, LimitSpec, limits
from warpimpact.studies.limit import limit, limit_view

from ...options import CPU

CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
TEXT = """\
title = "limits"
core = { shape = "ogive", diameter = "6.17 mm", length = "27 mm", crh = 3.0, mass = "5.25 g" }
[plate]
thickness = "4 mm"
resistance = "2600 MPa"
shear_coefficient = 0.05
pattern = { shape = "circle", diameter = "5 mm", spacing = ["8 mm", "8 mm"] }
[impact]
velocity = "500 m/s"
[hits]
count = 32
[numerics]
fidelity = "draft"
"""
MEAN = Measure.parse("mean(limit_velocity)")
V50, V05 = Measure.parse("V50"), Measure.parse("V05")
PROMISED = '[numerics]\nfidelity = "draft"\n'
GIVEN = '[numerics]\npatches_axial = 14\npatches_around = 16\ntime_step = "0.5 us"\n'


def campaign(text: str = TEXT) -> Campaign:
    return Campaign.from_text(text, name="text", folder=Path())


def test_limits_in_python_are_those_of_the_file(tmp_path: Path) -> None:
    few = TEXT.replace("count = 32", "count = 4").replace('fidelity = "draft"', "level = 0")
    (tmp_path / "a.toml").write_text(few)
    by_file = search(campaign(few), tmp_path / "a.nc")
    xarray.testing.assert_equal(limit(tmp_path / "a.toml", options=CPU).limit_velocity, by_file.limit_velocity)


def search(of: Campaign, path: Path, *how: Any) -> xarray.Dataset:
    run_to_file(of, path, options=CPU, limit=limit_of(of, *how))
    return files.read(path)


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> xarray.Dataset:
    return search(campaign(), tmp_path_factory.mktemp("limit") / "limit.nc")


def test_the_dataset_is_that_of_shots_that_just_pass(result: xarray.Dataset) -> None:
    assert (result["limit_velocity_upper"] - result["limit_velocity_lower"] <= 1.0).all()
    assert (result["limit_velocity"] >= result["limit_velocity_lower"]).all()
    assert (result["limit_velocity"] <= result["limit_velocity_upper"]).all()
    assert (result["impact_velocity"] == result["limit_velocity_upper"]).all()
    assert (result["status"] == Status.PERFORATED).all()
    assert (result["limit_converged"] == 1).all()
    assert int(result["limit_runs"].max()) <= MOST_RUNS
    assert result["limit_velocity"].attrs["units"] == "m s-1"


def test_it_tells_its_error_against_a_finer_level(result: xarray.Dataset) -> None:
    message = result.attrs
    assert message["tolerance_met"] == 1
    assert 0.0 < message["limit_velocity_error"] < 0.02 * float(result["limit_velocity"].median())
    # The error holds: a finer level, whose own error is smaller, gives limits within it.
    scene, shots = campaign().scene, make_shots(campaign().impact, campaign().hits, campaign().plate)
    fine = limits(scene, shots, LimitSpec.of(scene, tolerance=0.5), FastLaw(level=4), Worker("cpu"))
    change = fine.value - result["limit_velocity"].values
    assert np.quantile(np.abs(change), 0.9) <= message["limit_velocity_error"]
    # So does what the numerics may shift a mean or V50 by: some of the hits have their limits at that level.
    finer = node_hits(result, "finer")
    assert finer is not None
    at = finer["hit"].values
    assert len(at) == PILOT_LIMITS
    np.testing.assert_allclose(finer["limit_velocity"].values, fine.value[at], rtol=0, atol=1.5)
    mean, v50 = estimated(result, [MEAN])[MEAN], estimated(result, [V50])[V50]
    assert abs(change.mean()) <= mean.numerics < 2.0
    assert abs(np.quantile(fine.value, 0.5) - v50.value) <= v50.numerics < 3.0
    assert effectiveness(result).iloc[0].numerics == pytest.approx(v50.numerics)
    assert f"numerics ± {v50.numerics:.2g}  " in text_of(limit_view(result))


def test_v50_and_v05_are_quantiles_over_the_hits(result: xarray.Dataset) -> None:
    v50, v05 = estimated(result, [V50, V05]).values()
    value = result["limit_velocity"].values
    assert np.mean(value <= v50.value) == pytest.approx(0.5, abs=0.02)
    assert np.mean(value <= v05.value) == pytest.approx(0.05, abs=0.02)
    assert v50.low < v50.value < v50.high
    line = next(line for line in text_of(limit_view(result)).splitlines() if line.startswith("V50 "))
    assert line.split()[1] == f"{v50.value:.5g}"
    assert v50.value == pytest.approx(float(result["limit_velocity"].quantile(0.5)))  # as xarray has it
    assert text_of(limit_view(result)).startswith(f"measures, by {len(value)} hits\n")
    page = report_page({"limit": result}, folders={"limit": Path()}, trajectories=0)
    assert page.index(f"<p>V50 {v50.value:.5g} m/s") < page.index(f", by {len(value)} hits.</p>") < page.index("<h2>")


def test_a_limit_beyond_reach_makes_a_quantile_infinite_and_no_mean(result: xarray.Dataset) -> None:
    beyond = result.copy(deep=True)
    beyond["limit_velocity"][:20] = np.inf
    v50, v05 = estimated(beyond, [V50, V05]).values()
    assert v50.value == np.inf
    assert np.isfinite(v05.value)
    assert effectiveness(beyond, ["V50"]).iloc[0].value == np.inf
    assert "20 hits without a limit velocity up to 3000 m/s" in text_of(limit_view(beyond))
    limit_figure(beyond)


def test_the_resistance_of_the_catalogue_follows_the_thickness(tmp_path: Path) -> None:
    """The limit thickness is the same from whatever thickness of the campaign it is searched."""
    text = """title = "limits"
core = { threat = ".30 AP M2" }
plate = { material = "HHA Class 1", thickness = "THICKNESS mm" }
impact = { velocity = "800 m/s" }
hits = { count = 1 }
numerics = { level = 0 }
output = { standoffs = ["0.5 m"] }
"""
    actual = [
        search(campaign(text.replace("THICKNESS", thickness)), tmp_path / f"{thickness}.nc", "thickness")
        for thickness in ("5", "10")
    ]
    thin, thick = (float(limit["limit_thickness"][0]) for limit in actual)
    assert thin == pytest.approx(thick, abs=2e-5)
    assert replay(actual[0], 0, folder=Path()).attrs["agreement"] == "bit-identical"


LAYER = '[[layer]]\ngap = "100 mm"\nthickness = "6 mm"\nresistance = "1 GPa"\nshear_coefficient = 0.05\n'


def test_thickness_of_the_base_behind_a_perforated_plate(tmp_path: Path) -> None:
    given = TEXT.replace("count = 32", "count = 4").replace(PROMISED, GIVEN)
    behind = campaign(given + LAYER)
    run_to_file(behind, tmp_path / "base.nc", options=CPU, limit=limit_of(behind, "thickness", layer=1))
    actual = files.read(tmp_path / "base.nc")
    passed = (actual["status"] == Status.PERFORATED).values
    assert passed.any()
    last = actual["layer_thickness"].values[:, 1]
    assert (last[passed] == actual["limit_thickness_lower"].values[passed]).all()
    assert "thickness of layer 1" in text_of(limit_view(actual))
    assert replay(actual, 2, folder=Path()).attrs["agreement"] == "bit-identical"
    with pytest.raises(CampaignError, match=r"got layer 2, but the target has layers 0 \(the plate\) to 1"):
        limit_of(behind, "thickness", layer=2)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (("shear_coefficient", "degradation = 0.8\nshear_coefficient"), "give degradation_distance in its place"),
        (
            ("count = 32", 'count = 32\n[stop]\nquantity = "P(perforated)"\nhalf_width = 0.1\nmax_count = 32'),
            r"leave out the table \[stop\]",
        ),
    ],
)  # fmt: skip
def test_what_has_no_limits_is_refused_in_a_sentence(change: tuple[str, str], sentence: str) -> None:
    with pytest.raises(CampaignError, match=sentence):
        limit_of(campaign(TEXT.replace(*change)))


def test_the_command_writes_a_result_and_a_figure(in_tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    command = ["limit", str(CAMPAIGNS / "limit_velocity.toml"), "--device", "cpu"]
    requested = ["--measure", "quantile(limit_velocity, 0.25)"]
    assert main([*command, *requested]) == 0
    message = capsys.readouterr().out
    assert "run at the V50 with --elements 16; half of the cores should pass." in message
    assert "written to limit_velocity_limit.nc, figure in limit_velocity_limit.png" in message
    assert (in_tmp_path / "limit_velocity_limit.png").stat().st_size > 10_000
    actual = files.read(in_tmp_path / "limit_velocity_limit.nc")
    # Published for the bare core at 0, 15, 30, 45 deg: 514, 535, 597, 723 m/s; the resistance is fitted to the first.
    assert actual["limit_velocity"].values == pytest.approx([514.0, 535.0, 597.0, 723.0], rel=0.06)
    assert actual["limit_velocity"].values[0] == pytest.approx(514.0, abs=1.5)
    ratios = actual["limit_velocity"].values / actual["limit_velocity"].values[0]
    assert ratios == pytest.approx([1.0, 1.036, 1.134, 1.332], abs=0.006)  # as documented
    line = next(line for line in message.splitlines() if line.startswith("quantile(limit_velocity, 0.25)"))
    assert main(["inspect", "limit_velocity_limit.nc", *requested]) == 0
    (same,) = (line for line in capsys.readouterr().out.splitlines() if "25 % quantile" in line)
    assert float(same.split()[6]) == pytest.approx(float(line.split()[2]), rel=1e-3)
    assert main(command) == 2
    assert "exists already; name another file or give --overwrite" in capsys.readouterr().err


def test_limits_do_not_depend_on_the_chunks() -> None:
    of = campaign(TEXT.replace('fidelity = "draft"', "level = 0"))
    limit = limit_of(of)
    whole, *parts = (
        compute_hits(of, np.arange(first, end), of.numerics, limit, worker=Worker("cpu"))["limit_velocity"].values
        for first, end in ((0, 32), (0, 8), (8, 32))
    )
    np.testing.assert_array_equal(np.concatenate(parts), whole)


SHIELD = '[[layer]]\ngap = "60 mm"\nthickness = "2 mm"\nresistance = "2600 MPa"\n'
TEMPLATE = """\
title = "limits"
core = {{ shape = "ogive", diameter = "6.17 mm", length = "27 mm", crh = 3.0, mass = "5.25 g" }}
[plate]
thickness = "4 mm"
resistance = "2600 MPa"
shear_coefficient = 0.05
pattern = {pattern}
{layer}
[impact]
velocity = "500 m/s"
[hits]
count = 16
[numerics]
patches_axial = 14
patches_around = 16
time_step = "0.5 us"
[output]
standoffs = ["50 mm"]
solid_reference = {solid}
"""
HOLES = '{ shape = "circle", diameter = "5 mm", spacing = ["8 mm", "8 mm"] }'
NONE = '{ shape = "none" }'


def searched_limits(path: Path, quantity: str = "velocity", of_layer: int = 0, **given: str) -> xarray.Dataset:
    text = TEMPLATE.format(**{"pattern": HOLES, "layer": "", "solid": "true"} | given)
    of = Campaign.from_text(text, name="text", folder=Path())
    run_to_file(of, path, options=CPU, limit=limit_of(of, quantity, layer=of_layer))
    return files.read(path)


@pytest.fixture(scope="module")
def velocity(tmp_path_factory: pytest.TempPathFactory) -> xarray.Dataset:
    return searched_limits(tmp_path_factory.mktemp("limit") / "velocity.nc")


@pytest.fixture(scope="module")
def thickness(tmp_path_factory: pytest.TempPathFactory) -> xarray.Dataset:
    return searched_limits(tmp_path_factory.mktemp("limit") / "thickness.nc", "thickness", 1, layer=SHIELD)


def solid_limit(result: xarray.DataTree, reference: str = "solid") -> float:
    return float(result[f"{reference}/limit_{result.attrs['limit']}"])


def test_the_base_alone_is_a_plate_of_its_own(tmp_path: Path) -> None:
    with_base = searched_limits(tmp_path / "a.nc", layer=SHIELD)
    text = TEMPLATE.format(pattern=NONE, layer="", solid="true").replace('"4 mm"', '"2 mm"')
    base = Campaign.from_text(text.replace("shear_coefficient = 0.05", ""), name="text", folder=Path(), count=1)
    run_to_file(base, tmp_path / "b.nc", options=CPU, limit=limit_of(base))
    expected = files.read(tmp_path / "b.nc")["limit_velocity"].values
    assert solid_limit(with_base, "base_alone") == pytest.approx(expected.item(), abs=1.0)
    measure = effectiveness(with_base).loc["V50"]
    assert measure.alone == pytest.approx(expected.item() * measure.measure.display.factor, rel=2e-3)
    assert "base alone: limit" in text_of(limit_view(with_base))


def test_a_limit_velocity_has_measures_and_a_ratio(velocity: xarray.Dataset) -> None:
    v50, v05, worst_tenth, worst = effectiveness(velocity).itertuples()
    values, solid = velocity["limit_velocity"].values, solid_limit(velocity)
    assert [one.Index for one in (v50, v05)] == ["V50", "V05"]
    assert v50.value == pytest.approx(np.median(values))
    assert v50.measure.higher_is_better
    assert v50.ratio == pytest.approx(v50.value / solid)
    assert worst.value == values.min() == values[worst.hit]
    assert worst.value <= worst_tenth.value < v50.value
    assert worst_tenth.value == pytest.approx(np.sort(values)[:2].dot([1.0, 0.6]) / 1.6, rel=1e-6)


@pytest.mark.parametrize(("more", "ranks"), [(1.0, [(1, 2), (1, 2)]), (3.0, [(2, 2), (1, 1)])])
def test_limits_within_their_tolerance_are_not_distinguished(
    velocity: xarray.Dataset, more: float, ranks: list[tuple[int, int]]
) -> None:
    """Each limit is known to 1 m/s."""
    other = velocity.assign(limit_velocity=velocity["limit_velocity"] + more)
    actual = compare({"one": velocity, "other": other})
    assert [actual.ranks("V50")[name] for name in ("one", "other")] == ranks


def test_of_a_thickness_it_tells_the_areal_density_that_a_solid_plate_needs(thickness: xarray.Dataset) -> None:
    measures = effectiveness(thickness)
    plate = 7850.0 * 4e-3 * (1.0 - np.pi * 2.5**2 / 64.0)
    solid = plate + 7850.0 * solid_limit(thickness)
    density = measures.loc["quantile(limit_areal_density, 0.5)"]
    assert (density.solid, density.ratio) == (pytest.approx(solid), pytest.approx(density.value / solid))
    assert measures.solid["H50"] == pytest.approx(1e3 * solid_limit(thickness))
    assert f"{solid:.4g} kg/m² (the target as given has" in text_of(limit_view(thickness))
