"""A sweep: every combination computed as it would be alone, joined with a dimension for every input."""

import re
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import Campaign
from warpimpact.analysis.numbers import text_of
from warpimpact.campaign.campaign import CampaignError
from warpimpact.campaign.places import resolved
from warpimpact.cli import main
from warpimpact.errors import OutputError
from warpimpact.measures.estimates import estimated
from warpimpact.measures.measure import Measure
from warpimpact.measures.references import law_of, node_hits, nodes_of, with_nodes
from warpimpact.plotting.studies import sweep_figure
from warpimpact.records.kinds import SWEEP
from warpimpact.results import files
from warpimpact.runs.run import run
from warpimpact.runs.store import Store
from warpimpact.studies import sweep as module
from warpimpact.studies.sweep import joined, points_folder, read_sweep, run_sweep, sweep_table, sweep_view

from ...options import CPU
from ..slotted import slotted_text

TEXT = slotted_text(("4096", "24"))
TWO = '[sweep]\nobliquity = ["0 deg", "30 deg"]\n"plate.pattern.width" = ["3 mm", "4 mm", "5 mm"]\n'


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Holds a sweep of two inputs."""
    folder = tmp_path_factory.mktemp("sweep")
    (folder / "a.toml").write_text(TEXT + TWO, encoding="utf-8")
    run_sweep(read_sweep(folder / "a.toml"), folder / "a.nc", options=CPU)
    return folder


def test_every_point_is_what_its_campaign_gives(folder: Path) -> None:
    sweep = files.read(folder / "a.nc", SWEEP)
    assert dict(sweep.sizes) | {"obliquity": 2, "width": 3, "hit": 24} == dict(sweep.sizes)
    np.testing.assert_allclose(sweep["obliquity"], [0.0, 30.0], rtol=1e-14)
    np.testing.assert_allclose(sweep["width"], [3e-3, 4e-3, 5e-3], rtol=1e-14)
    assert (sweep["obliquity"].attrs["units"], sweep["width"].attrs["units"]) == ("degree", "m")
    for degrees, width in ((30, 3), (0, 5)):
        text = TEXT.replace('width = "4 mm"', f'width = "{width} mm"')
        text = text.replace("[impact]", f'[impact]\nobliquity = "{degrees} deg"')
        alone = run(Campaign.from_text(text, name="a", folder=folder), options=CPU)
        point = sweep.sel(obliquity=degrees, width=width * 1e-3, method="nearest")
        for name in ("status", "residual_velocity", "tilt", "perforated", "law/exit_velocity"):
            np.testing.assert_array_equal(point[name], alone[name], err_msg=name)
        measures = [*map(Measure.parse, module.SHOWN)]
        assert [one.value for one in estimated(point, measures).values()] == pytest.approx(
            [one.value for one in estimated(alone, measures).values()], rel=1e-6
        )
    assert sweep["impact_velocity"].dims == ("hit",)  # which is the same at every point


def test_a_layer_is_swept_by_its_number(tmp_path: Path) -> None:
    layers = '[[layer]]\nthickness = "2 mm"\nresistance = "1 GPa"\n' * 2
    given = '[sweep]\n"layer 2.thickness" = ["3 mm", "5 mm"]\n"layer 1.pattern" = [{ name = "a", shape = "none" }]\n'
    (tmp_path / "a.toml").write_text(TEXT.replace("[hits]", f"{layers}[hits]") + given, encoding="utf-8")
    sweep = read_sweep(tmp_path / "a.toml")
    assert list(sweep.options) == ["layer_2_thickness", "layer_1_pattern"]
    assert [one.layer[1].thickness for one in sweep.campaigns.values()] == [3e-3, 5e-3]
    actual = module.sweep(tmp_path / "a.toml", options=CPU)
    assert actual["layer_2_thickness"].values.tolist() == [3e-3, 5e-3]
    assert actual["layer_2_thickness"].attrs == {"units": "m", "long_name": "layer 2.thickness"}
    (tmp_path / "a.toml").write_text(TEXT + given, encoding="utf-8")
    with pytest.raises(CampaignError, match=r'got "layer 2.thickness", but the campaign has no \[\[layer\]\]'):
        read_sweep(tmp_path / "a.toml")
    (tmp_path / "a.toml").write_text(TEXT + given.replace("layer 2.", "layer.1."), encoding="utf-8")
    with pytest.raises(CampaignError, match=r'got "layer.1.thickness"; write "layer 1" for the first table'):
        read_sweep(tmp_path / "a.toml")
    assert resolved("layer 0.thickness", "a.toml") == "plate.thickness"


def test_a_point_keeps_its_hits_at_two_levels(tmp_path: Path) -> None:
    (tmp_path / "a.toml").write_text(TEXT + '[sweep]\nvelocity = ["700 m/s", "800 m/s"]\n', encoding="utf-8")
    sweep, measure = read_sweep(tmp_path / "a.toml"), Measure.parse("mean(tilt@130mm)")
    points = [run(one, options=CPU) for one in sweep.campaigns.values()]
    files.write(joined(sweep, points), tmp_path / "a.nc")
    actual = files.read(tmp_path / "a.nc", SWEEP)
    for number, point in enumerate(points):
        estimate = estimated(point, [measure])[measure]
        assert estimated(actual.isel(impact_velocity=number), [measure])[measure] == estimate
        assert not np.isnan(estimate.numerics)


def test_a_point_keeps_its_answer(tmp_path: Path) -> None:
    """Draws, hits by elements and the fast law of a point are those of its result, also in a file."""
    (tmp_path / "a.toml").write_text(TEXT + '[sweep]\nvelocity = ["700 m/s", "800 m/s"]\n', encoding="utf-8")
    sweep, points, numbers = read_sweep(tmp_path / "a.toml"), list[xarray.DataTree](), np.random.default_rng(1)
    for seed, campaign in enumerate(sweep.campaigns.values()):
        whole = run(campaign, options=CPU)
        law, hits = whole.to_dataset(), [*range(12), 20 + seed]  # each has another hit by elements
        shifts = numbers.normal(-50.0, 20.0, (8, 1))
        status = np.where(numbers.random((8, 13)) < 0.3, 1, 0).astype(np.int8)
        velocity = law["residual_velocity"].values[hits] + shifts
        columns = {"status": status, "residual_velocity": velocity.astype(np.float32)}
        draws = xarray.Dataset({k: (("draw", "drawn_hit"), of) for k, of in columns.items()}, {"drawn_hit": hits})
        elements = law[["status", "residual_velocity"]].where(law["hit"].isin([3, 20 + seed])).drop_vars("hit")
        nodes = {"draws": draws, "law": law[["status", "residual_velocity"]].drop_vars("hit"), "elements": elements}
        points.append(with_nodes(law, {**nodes, "finer": nodes_of(whole)["finer"]}))
    files.write(joined(sweep, points), tmp_path / "a.nc")
    actual, measures = files.read(tmp_path / "a.nc", SWEEP), [*map(Measure.parse, module.SHOWN[:1] + module.SHOWN[3:])]
    table = sweep_table(actual, measures)
    for number, point in enumerate(points):
        node = point["draws"].to_dataset(inherit=False).isel(drawn_hit=slice(12))
        shared = with_nodes(point.to_dataset(), nodes_of(point) | {"draws": node})
        for measure, alone in estimated(shared, measures).items():
            row = table.iloc[number][measure.text]
            assert [row.value, row.low, row.high] == pytest.approx([alone.value, alone.low, alone.high], rel=1e-4)
        one = actual.isel(impact_velocity=number)
        assert node_hits(one, "elements")["hit"].values.tolist() == [3, 20 + number]
        assert law_of(one)["residual_velocity"].values.tolist() == point["residual_velocity"].values.tolist()
    text = text_of(sweep_view(actual))
    assert "with at most 24 hits and 2 by finite elements each" in text
    assert "By the fast law" not in text


def test_a_point_is_a_result_and_a_sweep_says_that_it_is_one(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    points = sorted(points_folder(folder / "a.nc").glob("*.nc"))
    assert len(points) == 6
    assert main(["replay", str(points[4]), "--hit", "3", "-o", str(folder / "hit.nc")]) == 0
    assert "bit-identical" in capsys.readouterr().out
    assert main(["plot", str(folder / "a.nc")]) == 2
    assert "is a sweep, as warpimpact sweep writes, not a map of hits; warpimpact insp" in capsys.readouterr().err
    files.read(folder / "a.nc", SWEEP).isel(obliquity=1, width=0).to_netcdf(folder / "chosen.nc")
    assert main(["inspect", str(folder / "chosen.nc")]) == 0
    capsys.readouterr()
    assert main(["inspect", str(folder / "a.nc")]) == 0
    table = capsys.readouterr().out.splitlines()
    assert sum(line.strip().startswith(("0 deg", "30 deg")) for line in table) == 6  # one table, a row for each point
    assert len(table) <= 14
    assert main(["run", str(folder / "a.toml")]) == 2
    assert "this takes one; warpimpact sweep" in capsys.readouterr().err


def test_a_sweep_on_a_full_disk_says_what_is_kept_and_continues_with_it(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, folder: Path
) -> None:
    (tmp_path / "a.toml").write_text(TEXT + TWO, encoding="utf-8")
    sweep, computed = read_sweep(tmp_path / "a.toml"), []
    original = module.run_to_file

    def broken(campaign: Campaign, store: Store, **options: object) -> None:
        if len(computed) == 2:
            raise OutputError("the disk is full")
        computed.append(store.path.name)
        original(campaign, store, **options)

    monkeypatch.setattr(module, "run_to_file", broken)
    kept = f"the disk is full; 2 of 6 points complete in {points_folder(tmp_path / 'a.nc')}; continue with"
    with pytest.raises(OutputError, match=re.escape(kept)):
        run_sweep(sweep, tmp_path / "a.nc", options=CPU)
    monkeypatch.setattr(module, "run_to_file", original)
    with pytest.raises(OutputError, match="a_points: exists already; give --resume"):
        run_sweep(sweep, tmp_path / "a.nc", options=CPU)
    first = points_folder(tmp_path / "a.nc") / computed[0]
    before = first.stat().st_mtime_ns
    run_sweep(sweep, Store(tmp_path / "a.nc", resume=True), options=CPU)
    assert first.stat().st_mtime_ns == before
    one, other = files.read(tmp_path / "a.nc", SWEEP), files.read(folder / "a.nc", SWEEP)
    xarray.testing.assert_equal(one, other)


def test_plates_are_swept_as_tables_with_names(tmp_path: Path) -> None:
    head, tail = TEXT.split("[plate]\n")[0], "[impact]" + TEXT.split("[impact]")[1]
    plates = (
        '{ name = "a", thickness = "2 mm", resistance = 2e9 }, { name = "b", thickness = "6 mm", resistance = 2e9 }'
    )
    (tmp_path / "a.toml").write_text(f"{head}{tail}\n[sweep]\nplate = [{plates}]\n", encoding="utf-8")
    sweep = read_sweep(tmp_path / "a.toml", count=8)
    velocity = module.sweep(sweep, options=CPU).residual_velocity.mean("hit")
    assert float(velocity.sel(plate="a")) > float(velocity.sel(plate="b"))


def test_the_figure_shows_means_against_the_input(folder: Path) -> None:
    sweep = files.read(folder / "a.nc", SWEEP)
    panels = sweep_figure(sweep).axes
    assert [axes.get_xlabel() for axes in panels[2:]] == ["obliquity [°]", "obliquity [°]"]
    lines = [container.lines[0] for container in panels[0].containers]
    assert len(lines) == 3
    assert len({(line.get_marker(), line.get_markersize()) for line in lines}) == 3  # none hides another one
    table = sweep_table(sweep, [Measure.parse("mean(residual_velocity)")])
    expected = table[("mean(residual_velocity)", "value")].to_numpy().reshape(2, 3)
    for line, values in zip(lines, expected.T, strict=True):
        np.testing.assert_allclose(line.get_xdata(), [0.0, 30.0])
        np.testing.assert_allclose(line.get_ydata(), values, rtol=1e-6)


def test_a_sweep_is_requested_in_the_language_of_measures(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    sweep = str(folder / "a.nc")
    assert main(["inspect", sweep, "--measure", "quantile(residual_velocity, 0.05)"]) == 0
    shown = capsys.readouterr().out.splitlines()
    assert "residual velocity, 5 % quantile [m/s]" in shown[2]
    point = sorted(points_folder(folder / "a.nc").glob("*.nc"))[4]  # 30°, 4 mm
    assert main(["inspect", str(point), "--measure", "quantile(residual_velocity, 0.05)"]) == 0
    alone = next(line for line in capsys.readouterr().out.splitlines() if "5 % quantile" in line)
    assert shown[7].split()[:5] == ["30", "deg", "4", "mm", alone.split()[6]]
    assert main(["report", sweep, "-o", str(tmp_path / "a.html")]) == 0
    notes = ("By the fast law alone.", "Outside the tested range:", "They do not certify protection.")
    assert all(note in (tmp_path / "a.html").read_text(encoding="utf-8") for note in notes)
    page = (tmp_path / "a.html").read_text(encoding="utf-8")
    assert "P(perforated)" in page
    assert page.count("<img") == 1
    panels = sweep_figure(files.read(folder / "a.nc", SWEEP), ["P(stopped)"]).axes
    assert [axes.get_ylabel() for axes in panels] == ["P(stopped)"]
    for text, reason in {
        "P(broken)": "needs output.bending = true and core.strength (the cores of both published shots stayed whole at",
        "V50": "which warpimpact limit computes",
    }.items():
        assert main(["sweep", str(folder / "a.toml"), "-o", str(tmp_path / "b.nc"), "--measure", text]) == 2
        assert reason in capsys.readouterr().err
        assert not (tmp_path / "b_points").exists()


@pytest.mark.parametrize(
    ("table", "sentence"),
    [
        ("", r"needs a table \[sweep\] of lists"),
        ('[sweep]\nobliqity = ["1 deg"]\n', 'got the unknown input "obliqity"; give one of core'),
        ('[sweep]\nobliquity = ["95 deg"]\n', "obliquity = 95 deg: impact.obliquity"),
    ],
)
def test_what_cannot_be_swept_is_reported(tmp_path: Path, table: str, sentence: str) -> None:
    (tmp_path / "a.toml").write_text(TEXT + table, encoding="utf-8")
    with pytest.raises(CampaignError, match=sentence):
        read_sweep(tmp_path / "a.toml")
