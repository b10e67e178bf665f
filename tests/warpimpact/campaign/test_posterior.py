"""Campaigns with a posterior: every shot draws its parameters from it, all together."""

import json
import math
import re
from dataclasses import replace
from pathlib import Path

import netCDF4
import numpy as np
import pytest
import xarray

from warpimpact.analysis.estimates import estimated
from warpimpact.analysis.inspect import inspect_text
from warpimpact.campaign import drawn as drawing
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import CampaignError
from warpimpact.cli import main
from warpimpact.plotting import overview, variable_map
from warpimpact.results import posterior_file
from warpimpact.results.files import read, read_tree, write_tree
from warpimpact.results.measures import Measure
from warpimpact.runs.replay import replay
from warpimpact.runs.run import run
from warpimpact.scene import Interaction, Numerics, Plate, Scene, Shots
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.solver.simulate import simulate
from warpimpact.statistics.intervals import Estimate

DRAWS = 50
CAMPAIGN = """
title = "drawn"
[core]
shape = "ogive"
diameter = "6 mm"
crh = 3
length = "20 mm"
mass = "4 g"
[plate]
thickness = "2 mm"
resistance = "1 GPa"
degradation = 0.8
[plate.pattern]
shape = "circle"
diameter = "8 mm"
spacing = ["12 mm", "12 mm"]
[impact]
velocity = "700 m/s"
[hits]
count = 256
seed = 4
replicates = 8
[numerics]
fidelity = "draft"
time_step = "2 us"
"""


def posterior(folder: Path, interval: str = "degradation_interval", **of_draw: float) -> Path:
    """A posterior of resistance, friction and interval, where each tells the others; `of_draw` scatters others, too."""
    rng = np.random.default_rng(0)
    share = rng.random(DRAWS)
    columns = {
        "resistance": (["plate", "resistance"], 2e9 + 1e9 * share),
        "shear_coefficient": (["plate", "shear_coefficient"], 0.1 * share),
        interval: (["plate", interval], (1e-6 if interval.endswith("interval") else 1e-3) * (1.0 + share)),
        "spacing_y": (["plate", "pattern", "spacing", 0], 0.02 + share),
        "discrepancy_velocity": (["discrepancy", "velocity"], share),
    }
    columns |= {name: ([QUANTITIES[name].table, name], size * (1.0 + share)) for name, size in of_draw.items()}
    draws = xarray.Dataset(
        {
            name: (("chain", "draw"), values[None], {"path": json.dumps(path), "units": "1"})
            for name, (path, values) in columns.items()
        }
    )
    given = {"degradation_distance": "1 mm"} if interval == "degradation_distance" else {}
    material = {
        "plate": Plate(thickness="9 mm", resistance="2 GPa", degradation=0.8, **given).model_dump(exclude={"pattern"}),
        "interaction": Interaction().model_dump(),
        "discrepancy": {"m s-1": 7.0, "degree": 3.0},
    }
    told = {posterior_file.FIT_TEXT: "", posterior_file.MATERIAL: json.dumps(material), "warpimpact_version": "0"}
    groups = {name: xarray.Dataset({"a": 1}) for name in posterior_file.GROUPS} | {"posterior": draws}
    path = folder / "posterior.nc"
    write_tree(xarray.DataTree.from_dict({"/": xarray.Dataset(attrs=told), **groups}), path)
    return path


def campaign(path: Path, *changes: tuple[str, str]) -> Campaign:
    text = CAMPAIGN
    for before, after in changes:
        assert before in text
        text = text.replace(before, after)
    return Campaign.from_text(f"posterior = {json.dumps(str(path))}\n{text}", name="c.toml", folder=path.parent)


def test_parameters_are_drawn_together(tmp_path: Path) -> None:
    shots = campaign(posterior(tmp_path)).sampler().shots(0, 256)
    share = (shots.resistance[:, 0] - 2e9) / 1e9
    assert len(np.unique(share)) > 40
    assert shots.shear_coefficient[:, 0] == pytest.approx(0.1 * share)
    assert np.log(shots.degradation[:, 0]) == pytest.approx(np.log(0.8) / (1.0 + share))  # per interval of the campaign
    assert shots.thickness is None


def test_a_draw_is_a_function_of_the_seed_and_the_number(tmp_path: Path) -> None:
    sampler = campaign(posterior(tmp_path)).sampler()
    whole = sampler.shots(0, 256)
    parts = Shots.joined([sampler.shots(first, count) for first, count in ((0, 7), (7, 100), (107, 149))])
    assert (whole.resistance == parts.resistance).all()
    other = campaign(tmp_path / "posterior.nc", ("seed = 4", "seed = 5")).sampler().shots(0, 256)
    assert (whole.resistance != other.resistance).mean() > 0.9


def test_the_seed_chooses_from_all_draws_and_each_has_as_many_hits(tmp_path: Path, monkeypatch) -> None:
    monkeypatch.setattr(drawing, "MOST_DRAWS", 10)
    path, used = posterior(tmp_path), []
    for seed in ("4", "5"):
        drawn = campaign(path, ("seed = 4", f"seed = {seed}")).sampler().shots(0, 100).posterior_draw
        places, counts = np.unique(drawn, return_counts=True)
        assert counts.tolist() == [10] * 10
        used.append(set(places.tolist()))
    assert used[0] != used[1]
    assert max(used[0]) > 10


def mean_velocity(result: xarray.Dataset) -> Estimate:
    (estimate,) = estimated(result, [Measure.parse("mean(residual_velocity)")]).values()
    return estimate


def test_a_mean_has_an_interval_by_hits_and_one_by_parameters(tmp_path: Path) -> None:
    """Velocities that the draw alone decides: the mean of all hits is certain, that of the true material is not."""
    result = run(campaign(posterior(tmp_path)), device="cpu")
    velocity = 700.0 + result["posterior_draw"].values
    result["residual_velocity"].values[:] = velocity
    low, high = mean_velocity(result).parameters
    assert (low, high) == pytest.approx(np.quantile(np.unique(velocity), [0.025, 0.975]), abs=2.0)
    text = inspect_text(result)
    assert "by hits 7" in text
    assert f", by parameters {low:.2f} to {high:.2f}" in text
    assert "The discrepancy that the fit found, 7 m/s and 3°, does not count in them" in text
    wider = mean_velocity(result.assign_attrs(discrepancy_counts=1)).parameters
    assert wider[1] - wider[0] > high - low + 1.0
    shown = overview(result).axes[0].get_title()
    assert shown.endswith("mean of hits nearby")
    assert variable_map(result, "residual_velocity").axes[3].get_ylabel() == "spread over draws and conditions [m/s]"


@pytest.mark.parametrize("of_draw", [{}, {"degradation_length": 3e-4}], ids=["columns", "tables"])
@pytest.mark.parametrize("hits", ["[hits]", "[hits]\nirreducible = true"], ids=["sobol", "images"])
def test_the_numerics_shift_a_mean_over_draws_too(tmp_path: Path, of_draw: dict[str, float], hits: str) -> None:
    """The pilot's hits have the draws that the run gives them, so a run at the finer level has the same hits."""
    given = campaign(posterior(tmp_path, **of_draw), ("[hits]", hits), ('time_step = "2 us"\n', ""))
    result = run(given, device="cpu")
    level = json.loads(result.attrs["resolution"])["level"] + 2
    finer = run(given.model_copy(update={"numerics": Numerics(level=level)}), device="cpu")
    assert len(np.unique(result["posterior_draw"].values[result["finer_hit"].values])) > 10
    at = finer.isel(hit=result["finer_hit"].values)
    np.testing.assert_array_equal(result["finer_residual_velocity"].values, at["residual_velocity"].values)
    mean = mean_velocity(result)
    assert mean.numerics is not None
    assert 0.0 < mean.numerics < 5.0
    assert abs(float((finer["residual_velocity"] - result["residual_velocity"]).mean())) < mean.numerics
    assert "by parameters" in inspect_text(result)
    assert f", numerics ± {mean.numerics:.2f}" in inspect_text(result)


def test_limits_have_both_intervals_too(tmp_path: Path, monkeypatch, capsys) -> None:
    """Slower cores, that a plate can stop; lengths need a scene for each draw."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(drawing, "MOST_DRAWS", 8)
    path = posterior(tmp_path, interval="degradation_distance", degradation_length=3e-4)
    changed = CAMPAIGN.replace("degradation = 0.8", 'degradation = 0.8\ndegradation_distance = "1 mm"')
    changed = (
        changed.replace("count = 256", "count = 128")  # a quantile needs 16 of each draw
        .replace("replicates = 8", "")
        .replace('"12 mm", "12 mm"', '"60 mm", "60 mm"')
    )
    Path("c.toml").write_text(changed, encoding="utf-8")
    assert main(["limit", "c.toml", "--posterior", path.name, "--tolerance", "20 m/s", "--device", "cpu", "-q"]) == 0
    told = capsys.readouterr().out
    assert re.search(r"V50 +\d+\S*   by hits .* to .*, by parameters \d+.* to ", told)
    assert "those by parameters contain the number for 95 % of the draws" in told


def test_images_share_their_draw(tmp_path: Path) -> None:
    drawn = campaign(posterior(tmp_path), ("[hits]", "[hits]\nirreducible = true"))
    shots, images = drawn.sampler().shots(3, 90), len(drawn.symmetries)
    assert images == 4
    of = (np.arange(3, 93) // images)[:, None] == (np.arange(3, 93) // images)
    assert (shots.resistance == shots.resistance.T)[of].all()


def test_a_result_holds_its_draws_and_replays(tmp_path: Path) -> None:
    result = run(campaign(posterior(tmp_path)), device="cpu")
    draws = read_tree(tmp_path / "posterior.nc", posterior_file.DRAWS)["posterior"]
    which = result["posterior_draw"].values.astype(int)
    assert (result["resistance"].values == draws["resistance"].values[0][which]).all()
    assert replay(result, 17, folder=tmp_path).attrs["agreement"] == "bit-identical"


def with_own(scene: Scene, name: str, value: float) -> Scene:
    """A scene with the value of a draw."""
    if QUANTITIES[name].table == "plate":
        plate = scene.target.layers[0].model_copy(update={name: value})
        return scene.model_copy(update={"target": scene.target.model_copy(update={"layers": (plate,)})})
    return scene.model_copy(update={"interaction": scene.interaction.model_copy(update={name: value})})


@pytest.mark.parametrize(
    ("name", "size", "apart"),
    [
        ("degradation_length", 3e-4, 0.3),  # the tile of a length of its own has finer cells
        ("degradation_depth", 1e-3, 1e-3),
        ("static", 0.8, 1e-3),
        ("quadratic", 0.2, 1e-3),
        ("onset", 4e-3, 1e-3),
    ],
)
def test_shots_of_all_draws_are_computed_together(tmp_path: Path, name: str, size: float, apart: float) -> None:
    path = posterior(tmp_path, **{name: size})
    drawn = campaign(path, ("count = 256", "count = 16"))
    assert drawn.drawn is not None
    shots, result = drawn.sampler().shots(0, 16), run(drawn, device="cpu")
    values = drawn.drawn.values[QUANTITIES[name].table, name]
    for place in (0, 9):
        shot = shots[place : place + 1]
        alone = simulate(drawn.scene, shot, numerics=drawn.numerics, device="cpu")
        assert float(result["residual_velocity"][place]) == float(np.float32(alone.residual_velocity[0]))
        scene = with_own(drawn.scene, name, float(values[int(result["posterior_draw"][place])]))
        own = simulate(scene, replace(shot, **{name: None}), numerics=drawn.numerics, device="cpu")
        assert alone.residual_velocity == pytest.approx(own.residual_velocity, abs=apart)
        assert alone.residual_velocity != pytest.approx(
            simulate(
                drawn.scene, replace(shot, **{name: None}), numerics=drawn.numerics, device="cpu"
            ).residual_velocity,
            abs=1e-2,
        )
    assert replay(result, 9, folder=tmp_path).attrs["agreement"] == "bit-identical"


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (("degradation = 0.8", "degradation = 0.7"), "found with plate.degradation = 0.8, but the campaign has 0.7"),
        (("[impact]", "[interaction]\nonset = 0.01\n[impact]"), "interaction.onset = 0.005, but the campaign has 0.01"),
        (
            ("[impact]", "[interaction.free_surface]\n[impact]"),
            "found with interaction.free_surface = None, but the campaign has",
        ),
        (("degradation = 0.8", 'degradation = 0.8\ndegradation_distance = "1 mm"'), "gives plate.degradation_interval"),
        (
            ('resistance = "1 GPa"', 'resistance = { distribution = "uniform", low = "1 GPa", high = "2 GPa" }'),
            "posterior cannot be combined with a distribution of plate.resistance: the posterior gives it",
        ),
    ],
)
def test_another_material_is_refused(tmp_path: Path, change: tuple[str, str], sentence: str) -> None:
    with pytest.raises(CampaignError) as caught:
        campaign(posterior(tmp_path), change)
    assert sentence in str(caught.value)


@pytest.mark.parametrize("value", [math.nan, math.inf, -1.0, 0.0])
def test_values_that_no_campaign_may_have_are_refused(tmp_path: Path, value: float) -> None:
    path = posterior(tmp_path, degradation_length=3e-4)
    with netCDF4.Dataset(path, "a") as file:
        file["posterior"]["degradation_length"][0, 7] = value
    with pytest.raises(CampaignError, match=r"plate\.degradation_length = \S+, which is not allowed|must not have"):
        campaign(path)


def test_the_option(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    monkeypatch.chdir(tmp_path)
    path = posterior(tmp_path)
    Path("c.toml").write_text(CAMPAIGN, encoding="utf-8")
    assert main(["run", "c.toml", "--posterior", path.name, "--device", "cpu"]) == 0
    assert "posterior_draw" in read(Path("c.nc"))
    assert main(["run", "c.toml", "--posterior", "c.nc", "-o", "d.nc"]) == 2
    assert "c.nc: is a map of hits, as warpimpact run or limit writes, not a posterior" in capsys.readouterr().err
