"""Hits by finite elements as a result: all of a campaign or some of a map, resumed, replayed, refused."""

import re
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from warpimpact import Campaign, CampaignError, replay
from warpimpact.analysis.inspection import answer, inspect_view
from warpimpact.cli import main
from warpimpact.continuum import one_hit
from warpimpact.export.paraview import write_vtk
from warpimpact.records import attributes as attr
from warpimpact.results import files
from warpimpact.runs.finite_elements import finite_elements_to_file
from warpimpact.runs.store import Store

from ...options import CPU

CAMPAIGN = """
title = "slots"
core = { shape = "polynomial", coefficients = [3.0e-4, 0.24, -5.29], length = "27.86 mm", mass = "4 g" }
[plate]
thickness = "4 mm"
resistance = "2600 MPa"
pattern = { shape = "slot", length = "12 mm", width = "4 mm", spacing = ["8 mm", "16 mm"], staggered = true }
[impact]
velocity = "825 m/s"
[hits]
count = 4
seed = 1
[numerics]
level = 0
[continuum]
materials = ["ARMOX560T Johnson-Cook"]
spacing = "1 mm"
"""


pytestmark = pytest.mark.usefixtures("coarse_elements")


@pytest.fixture
def campaign_file(tmp_path: Path) -> Path:
    path = tmp_path / "slots.toml"
    path.write_text(CAMPAIGN, encoding="utf-8")
    return path


def computed(path: Path, campaign: Path, hits: tuple[int, ...] | None = None, *, resume: bool = False) -> Path:
    finite_elements_to_file(Campaign.from_toml(campaign), Store(path, resume=resume), numbers=hits, options=CPU)
    return path


def test_hits_chosen_from_a_campaign_are_those_of_all(campaign_file: Path, tmp_path: Path) -> None:
    whole = files.read(computed(tmp_path / "all.nc", campaign_file))
    some = files.read(computed(tmp_path / "some.nc", campaign_file, (1, 3)))
    assert whole.sizes["hit"] == 4
    assert some["hit"].values.tolist() == [1, 3]
    for name in ("residual_velocity", "tilt", "energy_imbalance", "hourglass_share", "eroded_elements", "status"):
        assert np.array_equal(whole[name].values[[1, 3]], some[name].values, equal_nan=True), name
    assert "finite elements, 1 mm, friction 0, ARMOX560T Johnson-Cook" in whole.attrs[attr.NUMERICS]
    assert whole["solid/status"].dims == ()


def test_a_hit_that_is_there_is_not_computed_again(
    campaign_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    output, straight = tmp_path / "cut.nc", files.read(computed(tmp_path / "straight.nc", campaign_file))
    march, calls = one_hit.OneHit.march, []

    def broken_off(self: one_hit.OneHit, *arguments: Any, **more: Any) -> one_hit.HitResult:
        calls.append(self)
        if len(calls) == 3:
            raise KeyboardInterrupt
        return march(self, *arguments, **more)

    monkeypatch.setattr(one_hit.OneHit, "march", broken_off)
    with pytest.raises(KeyboardInterrupt, match="saved"):
        finite_elements_to_file(Campaign.from_toml(campaign_file), Store(output), options=CPU)
    calls[:] = [None] * 3
    computed(output, campaign_file, resume=True)
    assert 3 < len(calls) < 3 + 5  # of four hits and the solid plate
    for name in ("residual_velocity", "tilt", "hourglass_share"):
        assert np.array_equal(files.read(output)[name].values, straight[name].values, equal_nan=True), name


def test_a_hit_is_replayed_bit_by_bit(campaign_file: Path, tmp_path: Path) -> None:
    result = files.read(computed(tmp_path / "all.nc", campaign_file))
    hit = int(result["eroded_elements"].values.argmax())
    assert result["eroded_elements"][hit] > 0
    history = replay(result, hit, snapshots=3)
    assert history.attrs[attr.AGREEMENT] == "bit-identical"
    assert (np.diff(history["time"].values) > 0.0).all()
    assert np.abs(history["force"].values[-1]).max() == 0.0 < np.abs(history["force"].values[0]).max()
    left = history["resistance_share"].values
    assert left.shape[0] == 3
    assert left[-1].sum() < left[0].sum()
    assert float(history["translational_energy"][-1]) < float(history["translational_energy"][0])
    failed = (history["element_left"][0] - history["element_left"][-1]).values.sum()
    assert failed == result["eroded_elements"].values[hit]
    assert float(history["element_strain"][0].max()) == 0.0 < float(history["element_strain"][-1].max())
    corner = history["element_corner"].values
    before, after = (history["node_position"].values[k] for k in (0, -1))
    first, x, y, z = (before[corner[:, k]] for k in (0, 1, 3, 4))
    upright = np.einsum("ij,ij->i", np.cross(x - first, y - first), z - first) > 0.0
    assert upright.mean() > 0.95  # beside a hole a corner may be concave
    assert before[:, 0].min() == pytest.approx(0.0, abs=1e-7)
    assert before[:, 0].max() == pytest.approx(4e-3, abs=1e-7)
    columns = before[corner].mean(axis=1)
    assert Campaign.from_toml(campaign_file).plate.is_solid(columns[:, 1], columns[:, 2]).mean() > 0.98
    assert np.abs(after - before).max() > 1e-3
    for axis in (1, 2):  # the outer edge moves little
        assert np.ptp(after[:, axis]) == pytest.approx(np.ptp(before[:, axis]), abs=5e-4)
    if find_spec("meshio"):
        import meshio

        files_written = write_vtk(history, tmp_path / "vtk")
        assert [file.name for file in files_written] == ["core.pvd", "plate.pvd"]
        meshes = [meshio.read(path) for path in sorted((tmp_path / "vtk").glob("plate_*.vtu"))]
        assert [len(mesh.cells[0].data) for mesh in meshes] == history["element_left"].values.sum(axis=1).tolist()
        assert meshes[-1].cell_data["element_strain"][0].max() > 0.1


def test_the_command_computes_hits_of_a_result(
    campaign_file: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    assert main(["run", str(campaign_file), "-o", "map.nc", "-q"]) == 0
    command = ["continuum", "map.nc", "--hits", "2", "--friction", "0.03", "-o", "map_continuum.nc", "-q"]
    assert main(command) == 0
    result = files.read(tmp_path / "map_continuum.nc")
    assert result.sizes["hit"] == 2
    assert result.attrs[attr.NUMERICS] == "finite elements, 1 mm, friction 0.03, ARMOX560T Johnson-Cook"
    assert "ARMOX560T Johnson-Cook: assumed" in capsys.readouterr().out
    assert main(["inspect", "map_continuum.nc"]) == 0
    assert "The solid plate is 2.61 mm of ARMOX560T Johnson-Cook by finite elements" in capsys.readouterr().out
    assert main(command) == 2
    assert "exists already" in capsys.readouterr().err
    assert main(["compare", "map.nc", "map_continuum.nc", "-o", "both.png"]) == 0
    message = capsys.readouterr().out
    assert "of 2 hits in both" in message
    assert "interval" not in message
    assert {path.name for path in tmp_path.glob("*.png")} == {"both.png", "both_tilt.png"}
    assert main(["compare", "map.nc", "map_continuum.nc", "--measure", "stopped", "-o", "other.png"]) == 2
    assert "compared hit by hit" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ([], "finite elements need one; or give continuum.materials, or --material to warpimpact continuum"),
        (["--material", "ARMOX"], 'did you mean "ARMOX370 Class 1"'),
        (["--material", "ARMOX560T Johnson-Cook", "--hit", "3"], "--hit and --hits are for a result"),
        (
            ["--material", "ARMOX560T Johnson-Cook", "--material", "HARDOX400"],
            "got materials: 2, layers of the target: 1",
        ),
    ],
)
def test_bad_input_gets_a_sentence_and_writes_nothing(
    arguments: list[str],
    sentence: str,
    campaign_file: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
) -> None:
    monkeypatch.chdir(tmp_path)
    campaign_file.write_text(CAMPAIGN[: CAMPAIGN.index("[continuum]")], encoding="utf-8")
    assert main(["continuum", str(campaign_file), *arguments, "-q"]) == 2
    assert sentence in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["slots.toml"]


@pytest.mark.parametrize(
    ("value", "sentence"),
    [
        ('materials = ["ARMOX"]', 'continuum.materials: got "ARMOX", which is not in the catalogue; did you mean'),
        ("friction = 2", "continuum.friction: got 2, but it must be less than or equal to 1"),
    ],
)
def test_the_table_of_a_campaign_is_checked_when_it_is_read(tmp_path: Path, value: str, sentence: str) -> None:
    path = tmp_path / "slots.toml"
    path.write_text(CAMPAIGN[: CAMPAIGN.index("materials")] + value, encoding="utf-8")
    with pytest.raises(CampaignError, match=re.escape(sentence)):
        Campaign.from_toml(path)


@pytest.mark.parametrize(("gap", "touches"), [("0 mm", True), ("10 mm", False)])
def test_layers_that_may_touch_have_a_sentence_in_the_answer(gap: str, touches: bool, tmp_path: Path) -> None:
    layer = f'[[layer]]\nthickness = "4 mm"\nresistance = "2600 MPa"\ngap = "{gap}"\n'
    (tmp_path / "two.toml").write_text(CAMPAIGN.replace("[impact]", layer + "[impact]"), encoding="utf-8")
    result = files.read(computed(tmp_path / "two.nc", tmp_path / "two.toml", (0,)))
    for lines in (answer(result), next(iter(inspect_view(result).values()))):
        assert any("contact of layers" in str(line) for line in lines) == touches
