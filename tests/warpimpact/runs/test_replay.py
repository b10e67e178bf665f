"""A replayed hit ends with the bits of the stored one, and its history is consistent with that end."""

import re
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import xarray

from warpimpact import Campaign, CirclePattern, FastLaw, Hits, Impact, Plate
from warpimpact.campaign.inputs import first_difference
from warpimpact.campaign.tables import Output
from warpimpact.cli import main
from warpimpact.errors import CampaignError, OutputError, ResultError
from warpimpact.kernels.status import Status
from warpimpact.measures.references import law_of
from warpimpact.records.variables import EXIT_VARIABLES, OUTCOME_VARIABLES
from warpimpact.results import files
from warpimpact.runs.compute import manifest
from warpimpact.runs.replay import replay
from warpimpact.runs.run import run, run_to_file
from warpimpact.runs.store import Store
from warpimpact.scene import Interaction, Layer, NoPattern, PolynomialCore, Scatter, Shots

from ...options import CPU
from ..slotted import slotted, slotted_text

NOWHERE = Path("nowhere")
CORE = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, mass=4e-3)
HOLES = Plate(
    thickness=4e-3,
    resistance=2.6e9,
    shear_coefficient=0.05,
    degradation=0.8,
    pattern=CirclePattern(diameter=5e-3, spacing=(8e-3, 8e-3)),
)
STRAIGHT, SLANTED = Impact(velocity=825.0), Impact(velocity=600.0, obliquity=17, azimuth=40, yaw=6, spin=1e4)
DRAFT = FastLaw(level=0)


def campaign(**changes: Any) -> Campaign:
    """A few hits on round holes, with `changes`."""
    usual: dict[str, Any] = {"title": "a test", "core": CORE, "plate": HOLES, "impact": STRAIGHT, "hits": Hits(count=3)}
    usual |= {"interaction": Interaction(static=1.1), "numerics": DRAFT, "output": Output(standoff_point="nose")}
    return Campaign(**usual | changes)


def stored(result: xarray.Dataset, path: Path) -> xarray.Dataset:
    """The result after a round trip through a file."""
    files.write(result, path)
    return files.read(path)


@pytest.mark.parametrize(
    ("impact", "numerics", "plate", "status"),
    [
        (STRAIGHT, DRAFT, HOLES, Status.PERFORATED),
        (SLANTED, DRAFT, HOLES, Status.PERFORATED),
        (SLANTED, FastLaw(level=0, precision="double"), HOLES, Status.PERFORATED),
        (SLANTED, FastLaw(scheme="nodal", grid_spacing=5e-5), HOLES, Status.PERFORATED),
        (STRAIGHT, DRAFT, HOLES.model_copy(update={"resistance": 1e11}), Status.ARRESTED),
        (Impact(velocity=300.0, obliquity=75), DRAFT, HOLES, Status.RICOCHETED),
    ],
    ids=["straight", "slanted", "double", "nodal", "arrested", "grazing"],
)
def test_replay_ends_with_the_bits_of_the_stored_outcome(
    impact: Impact, numerics: FastLaw, plate: Plate, status: Status, tmp_path: Path
) -> None:
    result = stored(run(campaign(impact=impact, numerics=numerics, plate=plate), options=CPU), tmp_path / "a.nc")
    result = law_of(result).to_dataset()
    assert (result["status"] == status).any()
    for hit in range(3):
        history = replay(result, hit, folder=NOWHERE)
        assert history.attrs["agreement"] == "bit-identical"
        for name in (*OUTCOME_VARIABLES, *EXIT_VARIABLES):
            end = "residual_angular_velocity" if name == "angular_velocity" else name
            np.testing.assert_array_equal(history[end], result[name][hit])


@pytest.fixture(scope="module")
def result() -> xarray.Dataset:
    """Slanted hits in double precision, computed on the CPU."""
    numerics = FastLaw(level=0, precision="double")
    return run(campaign(impact=SLANTED, numerics=numerics), options=CPU)


@pytest.fixture(scope="module")
def history(result: xarray.Dataset) -> xarray.Dataset:
    return replay(result, 1, folder=NOWHERE)


def test_history_leads_to_its_end(history: xarray.Dataset) -> None:
    last, body = history.isel(time=-1), CORE.mass_properties
    assert float(np.linalg.norm(last["velocity"])) == pytest.approx(float(history["residual_velocity"]), rel=1e-14)
    np.testing.assert_allclose(last["angular_velocity"], history["residual_angular_velocity"], rtol=1e-12)
    for along, end in (("velocity", "exit_velocity"), ("core_axis", "exit_axis"), ("plate_position", "exit_position")):
        np.testing.assert_allclose(last[along], history[end], rtol=1e-12, atol=1e-12, err_msg=end)
    impact = 0.5 * (body.mass * SLANTED.velocity**2 + body.inertia_axial * SLANTED.spin**2)
    end = float(last["translational_energy"] + last["rotational_energy"])
    assert impact - end == pytest.approx(float(history["energy_loss"]), rel=1e-12)
    energy = history["translational_energy"] + history["rotational_energy"]
    assert (np.diff(energy) <= 1e-12 * impact).all()


def test_history_tells_where_the_core_is(history: xarray.Dataset, result: xarray.Dataset) -> None:
    moved = history["plate_position"] - history["position"]
    hit = [0.0, result["hit_y"][1], result["hit_z"][1]]
    np.testing.assert_allclose(moved, np.broadcast_to(hit, moved.shape), atol=1e-18)
    np.testing.assert_allclose(np.linalg.norm(history["attitude"], axis=1), 1.0, rtol=1e-14)
    x, y, z, w = history["attitude"].values.T
    axis = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y + z * w), 2 * (x * z - y * w)], axis=1)
    np.testing.assert_allclose(history["core_axis"], axis, atol=1e-14)
    assert dict(history.sizes)["quaternion"] == 4
    for variable in ("time", "station", "plate_position", "angular_velocity", "resistance_share", "solid_along_y"):
        assert {"units", "long_name"} == history[variable].attrs.keys()


def test_plate_starts_whole_and_weakens_where_the_core_goes(history: xarray.Dataset) -> None:
    share = history["resistance_share"]
    y, z = np.meshgrid(history["cell_y"], history["cell_z"], indexing="ij")
    points = (np.arange(16) - 7.5) / 16 * float(history["cell_y"][1] - history["cell_y"][0])
    solid = HOLES.is_solid(y[..., None, None] + points[:, None], z[..., None, None] + points).mean(axis=(2, 3))
    np.testing.assert_allclose(share[0], solid, atol=2 / 256)  # points on an edge may fall on either side
    assert (np.diff(share, axis=0) <= 0.0).all()
    weakened = (share[-1] < 0.9 * share[0]).values
    distance = np.hypot(y - float(history["hit_y"]), z - float(history["hit_z"]))
    assert 3e-3 < distance[weakened].max() < CORE.bounding_radius
    assert weakened[(solid == 1.0) & (distance < 1e-3)].all()


def test_plate_has_been_exposed_by_the_area_that_advanced_for_as_long_as_it_did() -> None:
    # Straight through a solid plate: exposure over the plate is the section πR² times the time h/v of its passage.
    solid = HOLES.model_copy(update={"pattern": NoPattern()})
    history = replay(run(campaign(plate=solid, hits=Hits(count=1)), options=CPU), 0, folder=NOWHERE)
    assert (history["resistance_share"][0] == 1.0).all()
    exposure = np.log(history["resistance_share"][-1]) / np.log(solid.degradation) * solid.degradation_unit
    cell = float(np.diff(history["cell_y"])[0] * np.diff(history["cell_z"])[0])
    swept = np.pi * CORE.max_radius**2 * solid.thickness / (float(exposure.sum()) * cell)
    assert float(history["residual_velocity"]) < swept < 825.0


def test_snapshots_go_from_the_first_touch_to_the_end(history: xarray.Dataset) -> None:
    assert history["snapshot"][0] == 0.0
    assert history.sizes["snapshot"] == 6
    step = float(history["time"][1] - history["time"][0])
    assert float(history["snapshot"][-1]) == pytest.approx(float(history["time"][-1]) - 0.5 * step)


def test_count_of_the_command_line_counts(tmp_path: Path) -> None:
    result = run(slotted(('"sobol"', '"grid"'), ("seed = 1\n", ""), count=7), options=CPU)
    assert result.sizes["hit"] == 6
    result = stored(result, tmp_path / "a.nc")
    assert replay(result, 5, folder=NOWHERE).attrs["agreement"] == "bit-identical"


def test_another_end_is_reported(result: xarray.Dataset) -> None:
    law = law_of(result).to_dataset()
    for error, agreement in ((0.0, "bit-identical"), (1e-3, "within rounding"), (1.0, "different")):
        other = law.assign(residual_velocity=law["residual_velocity"] + error)
        assert replay(other, 0, folder=NOWHERE).attrs["agreement"] == agreement
    status, loss = law["status"] * 0 + Status.RICOCHETED, law["energy_loss"] * np.nan
    for changed in ({"status": status}, {"energy_loss": loss}):
        assert replay(law.assign(changed), 0, folder=NOWHERE).attrs["agreement"] == "different"


def test_what_cannot_be_replayed_is_refused(result: xarray.Dataset) -> None:
    for hit in (-1, 3):
        with pytest.raises(ResultError, match=f"hit: got {hit}, but the result has hits 0 to 2"):
            replay(result, hit, folder=NOWHERE)
    moved = result.to_dataset().assign_coords(hit_y=result["hit_y"] + 1e-6)
    with pytest.raises(ResultError, match=r"hit 0: hit_y is .* in the result, but the campaign and the files it names"):
        replay(moved, 0, folder=NOWHERE)
    anonymous = result.to_dataset().drop_attrs()
    with pytest.raises(ResultError, match="does not contain its campaign"):
        replay(anonymous, 0, folder=NOWHERE)


def test_files_of_the_campaign_are_looked_for_in_the_folder(tmp_path: Path) -> None:
    head, tail = slotted_text().split("[hits]")
    tail = "[numerics]" + tail.split("[numerics]")[1]
    (tmp_path / "a.toml").write_text(f'{head}[hits]\nsampling = "list"\nfile = "hits.csv"\n\n{tail}')
    (tmp_path / "hits.csv").write_text("hit_y,hit_z\n0.001,0.002\n")
    result = run(Campaign.from_toml(tmp_path / "a.toml"), options=CPU)
    assert replay(result, 0, folder=tmp_path).attrs["agreement"] == "bit-identical"
    with pytest.raises(CampaignError, match=r"the campaign in the result: hits\.file: .* no file nowhere/hits\.csv"):
        replay(result, 0, folder=NOWHERE)
    (tmp_path / "hits.csv").write_text("hit_y,hit_z\n0.002,0.002\n")
    with pytest.raises(ResultError, match=r"after the run: hits.file: hits.csv has other contents now; put it back"):
        replay(result, 0, folder=tmp_path)
    (tmp_path / "hits.csv").write_text("hit_y,hit_z\n0.001,0.002\n")
    with pytest.raises(ResultError, match="hit: got 4, but the last one of the campaign and the files it names is 0"):
        replay(result.to_dataset().assign_coords(hit=[4]), 4, folder=tmp_path)


OTHER_INPUTS = {  # the campaign, its file before and after the run, and what the sentence names
    "list": (
        'sampling = "list"\nfile = "a.csv"\n',
        "hit_y,hit_z,velocity\n0.001,0.002,{}\n",
        825,
        660,
        "hits.file: a.csv",
    ),
    "core": ("count = 6\n", "s,r\n0,0\n0.01,{0}\n0.02,{0}\n", 3e-3, 2e-3, r"core.r: was \[0.0, 0.003, .* by a.csv"),
}


@pytest.mark.parametrize("changed", OTHER_INPUTS)
def test_a_file_that_changed_after_the_run_is_named_by_every_command(
    changed: str, in_tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    hits, table, before, after, sentence = OTHER_INPUTS[changed]
    core = '[core]\nshape = "profile"\nfile = "a.csv"\ndensity = "7850 kg/m^3"\n'
    head, _, tail = slotted_text(('fidelity = "draft"', "level = 0")).partition("[hits]")
    head = head if changed == "list" else head[: head.index("[core]")] + core + head[head.index("[plate]") :]
    text = f"{head}[hits]\n{hits}[numerics]{tail.partition('[numerics]')[2]}"
    (in_tmp_path / "a.toml").write_text(text)
    (in_tmp_path / "a.csv").write_text(table.format(before))
    assert main(["run", "a.toml", "-q"]) == 0
    (in_tmp_path / "a.csv").write_text(table.format(after))
    capsys.readouterr()
    for command in (["continuum", "--hits", "5"], ["continuum", "--hit", "0"], ["replay", "--hit", "0"], ["report"]):
        assert main([command[0], "a.nc", *command[1:]]) == 2
        assert re.search(f"the campaign changed after the run: {sentence}", capsys.readouterr().err), command
    assert {path.name for path in in_tmp_path.iterdir()} == {"a.toml", "a.csv", "a.nc"}


def test_shots_changed_in_python_are_neither_replayed_nor_joined_with_others(tmp_path: Path) -> None:
    given, output = campaign(), tmp_path / "a.nc"
    slower, slowest = (given.with_shots(partial(with_velocity, velocity)) for velocity in (700.0, 600.0))
    run_to_file(slower, output, options=CPU)
    assert float(files.read(output)["impact_velocity"][0]) == 700.0
    with pytest.raises(ResultError, match=r"shots that were changed in Python \(with_shots\)"):
        replay(files.read(output), 0)
    run_to_file(slower, Store(output, resume=True), options=CPU)
    for other in (given, slowest):
        with pytest.raises(OutputError, match="exists already"):
            run_to_file(other, Store(output, resume=True), options=CPU)
    with pytest.raises(CampaignError, match="change the values of a campaign first"):
        slower.model_copy(update={"title": "another"})


def with_velocity(velocity: float, shots: Shots) -> Shots:
    return replace(shots, velocity=0.0 * shots.velocity + velocity)


@pytest.mark.parametrize("name", ["solid", "base_alone"])
def test_a_result_of_a_reference_is_replayed(name: str) -> None:
    """Its text gives the shots of the campaign that it belongs to, whose cell and thicknesses are others."""
    thickness = {"distribution": "uniform", "low": 3e-3, "high": 5e-3}
    base = Layer(thickness=2e-3, resistance=1e9, gap=20e-3)
    scattered = campaign(layer=(base,), scatter=Scatter(thickness=(thickness, {**thickness, "high": 4e-3})))
    reference = scattered.references[name]
    result = run(reference, options=CPU)
    for hit in range(3):
        assert replay(result, hit).attrs["agreement"] == "bit-identical"
    again = Campaign.from_text(reference.text, name="reference", folder=NOWHERE)
    shots = again.sampler().shots(0, 3)
    np.testing.assert_array_equal(shots.hit_y, scattered.sampler().shots(0, 3).hit_y)


def test_references_of_two_patterns_differ_in_their_fingerprint() -> None:
    """Their plates and hits are equal, but the cells of the patterns that they stand for are not."""
    wide = HOLES.model_copy(update={"pattern": CirclePattern(diameter=10e-3, spacing=(16e-3, 16e-3))})
    one, other = (campaign(plate=plate).solid() for plate in (HOLES, wide))
    assert one.plate.areal_density == pytest.approx(other.plate.areal_density)
    contents = (manifest(reference) for reference in (one, other))
    assert first_difference(*contents)[0].startswith("reference_of.plate.pattern")


def test_command_writes_history_and_figures(
    result: xarray.Dataset, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    files.write(result, tmp_path / "a.nc")
    command = ["replay", str(tmp_path / "a.nc"), "--hit", "2"]
    assert main(command) == 0
    shown = capsys.readouterr().out
    law = law_of(result)
    assert f"residual velocity  {float(law['residual_velocity'][2]):6.1f} m/s\n" in shown
    assert "The end is bit-identical to the stored outcome.\n" in shown
    with xarray.open_dataset(tmp_path / "a_hit2.nc") as history:
        assert history.attrs["hit"] == 2
        np.testing.assert_array_equal(history["tilt"], law["tilt"][2])
    figures = {"passage", "flight", "pressure", "course", "plate"}
    assert {path.name for path in tmp_path.glob("*.png")} == {f"a_hit2_{figure}.png" for figure in figures}
    for again, sentence in (
        (command, "a_hit2.nc: exists already"),
        ([*command[:-1], "9"], "hit: got 9, but the result has hits 0 to 2"),
        (["replay", str(tmp_path / "a_hit2.nc"), "--hit", "0"], "is the history of a hit, as warpimpact replay writes"),
    ):
        assert main(again) == 2
        assert sentence in capsys.readouterr().err
    assert not (tmp_path / "a_hit9.nc").exists()
