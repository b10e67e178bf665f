"""Exports hold what the result holds: tables read back, and VTK files."""

from collections.abc import Callable
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import ezdxf
import numpy as np
import pandas as pd
import pytest
import xarray
from ezdxf.path import make_path
from shapely import Polygon

from warpimpact import Campaign, table
from warpimpact.cli import main
from warpimpact.export.drawing import write_drawing
from warpimpact.export.paraview import SIDES, write_vtk
from warpimpact.export.spreadsheet import write_csv
from warpimpact.kernels.status import Status
from warpimpact.measures import estimates
from warpimpact.measures.references import law_of
from warpimpact.records.variables import SHOT_VARIABLES
from warpimpact.results import files
from warpimpact.runs.replay import replay
from warpimpact.runs.run import run
from warpimpact.scene import Plate
from warpimpact.scene.shots import EXPORTED

from ...options import CPU
from ..drawn import with_draws
from ..slotted import slotted, slotted_text

MIXED = [Status.PERFORATED, Status.ARRESTED, Status.RICOCHETED, Status.UNTOUCHED]
ResultMaker = Callable[..., xarray.Dataset]


def test_a_hit_that_where_took_out_has_an_empty_row(make_result: ResultMaker) -> None:
    dataset = make_result(np.tile(MIXED, 5))
    frame = table(dataset.where(dataset.status == Status.PERFORATED))
    assert frame["status"].dropna().tolist() == ["perforated"] * 5
    assert frame["residual_velocity"].isna().tolist() == frame["status"].isna().tolist()


def test_table_has_a_row_per_hit_and_a_column_per_standoff_and_axis(make_result: ResultMaker) -> None:
    dataset = make_result(np.tile(MIXED, 5))
    frame = table(dataset)
    assert list(frame.index) == list(range(20))
    assert frame["status"].tolist() == ["perforated", "arrested", "ricocheted", "untouched"] * 5
    np.testing.assert_array_equal(frame["tilt_130mm"], dataset["tilt"][:, 1])
    np.testing.assert_array_equal(frame["angular_velocity_y"], dataset["angular_velocity"][:, 1])
    np.testing.assert_array_equal(frame["hit_z"], dataset["hit_z"])
    assert frame.shape == (20, 2 + sum(array.size // 20 for array in dataset.data_vars.values() if "hit" in array.dims))
    given = np.concatenate([np.full(10, 30.0), np.linspace(0.1, 50.0, 10)])
    stored = np.degrees(np.radians(given))
    assert stored[0] != 30.0
    angles = table(dataset.assign(obliquity=("hit", stored, {"units": "degree"})))["obliquity"]
    np.testing.assert_array_equal(angles[:10], 30.0)
    np.testing.assert_array_equal(np.degrees(np.radians(angles)), stored)


def test_a_table_of_an_answer_says_what_passes_and_by_which_method(make_result: ResultMaker) -> None:
    frame = table(with_draws(make_result(20), np.arange(4)[:, None] < np.arange(20) % 5, elements=[3, 8]))
    np.testing.assert_allclose(frame["perforated"], np.arange(20) % 5 / 4.0)
    assert np.flatnonzero(frame["by_elements"]).tolist() == [3, 8]
    assert {"angular_velocity_x", "residual_velocity", "tilt_130mm"} <= set(frame)


def test_csv_holds_every_bit_whatever_the_slices(
    make_result: ResultMaker, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    dataset = make_result(np.tile(MIXED, 5))
    files.write(dataset, tmp_path / "a.nc")
    assert main(["export", str(tmp_path / "a.nc")]) == 0
    assert capsys.readouterr().out == f"{tmp_path / 'a.csv'}\n"
    read = pd.read_csv(tmp_path / "a.csv", index_col="hit", dtype=str).replace({"True": "1", "False": "0"})
    assert {"hit_y [m]", "impact_velocity [m/s]", "spin [rad/s]", "tilt_130mm [deg]", "status"} <= set(read)
    frame = table(dataset)
    assert [name.partition(" [")[0] for name in read] == list(frame)
    for written, name in zip(read, frame, strict=True):
        values = read[written] if name == "status" else read[written].astype(float).astype(frame[name].dtype)
        np.testing.assert_array_equal(values, frame[name], err_msg=name)
    monkeypatch.setattr(estimates, "SLICE", 7)
    assert main(["export", str(tmp_path / "a.nc"), "-o", str(tmp_path / "b.csv")]) == 0
    assert (tmp_path / "b.csv").read_bytes() == (tmp_path / "a.csv").read_bytes()
    assert main(["export", str(tmp_path / "a.nc")]) == 2
    assert "a.csv: exists already" in capsys.readouterr().err


def test_an_exported_result_is_a_list_of_hits(tmp_path: Path) -> None:
    result = run(slotted(count=20), options=CPU)
    write_csv(result.isel(hit=[3, 5, 7]), tmp_path / "chosen.csv")
    head, tail = slotted_text().split("[hits]")
    listed = f'{head}[hits]\nsampling = "list"\nfile = "chosen.csv"\n\n[numerics]{tail.split("[numerics]")[1]}'
    again = run(Campaign.from_text(listed, name="b", folder=tmp_path), options=CPU)
    for name in ("hit_y", "hit_z", "impact_velocity"):
        np.testing.assert_array_equal(again[name], result[name][[3, 5, 7]])
    tilts = law_of(again)["tilt"], law_of(result)["tilt"][[3, 5, 7]]
    np.testing.assert_allclose(*tilts, atol=3.0)  # of another resolution
    for variable in SHOT_VARIABLES:
        assert EXPORTED.get(variable, variable) == variable.field


SLOTS = {"shape": "slot", "length": "12 mm", "width": "4 mm", "spacing": ["8 mm", "16 mm"], "staggered": True}
ROUND = {"shape": "circle", "diameter": "5 mm", "spacing": "8 mm", "staggered": True}
ROUNDED = {"shape": "triangle", "side": "9 mm", "corner_radius": "1 mm", "spacing": "12 mm"}
OWN = {"shape": "polygons", "spacing": ["9 mm", "9 mm"], "polygons": [[("-2 mm", 0), ("3 mm", 0), (0, "4 mm")]]}


@pytest.mark.parametrize(
    ("pattern", "kind", "count", "arcs"),
    [(SLOTS, "LWPOLYLINE", 2, 2), (ROUND, "CIRCLE", 2, 0), (ROUNDED, "LWPOLYLINE", 1, 3), (OWN, "LWPOLYLINE", 1, 0)],
)
def test_a_drawing_has_every_hole_of_a_period_once(
    pattern: Any, kind: str, count: int, arcs: int, tmp_path: Path
) -> None:
    plate = Plate(thickness=4e-3, resistance=1e9, pattern=pattern)
    (note,) = write_drawing(plate, tmp_path / "a.dxf")
    assert ("1 hole," if count == 1 else f"{count} holes") in note
    space = ezdxf.readfile(tmp_path / "a.dxf").modelspace()
    holes = space.query('*[layer=="HOLES"]')
    assert [hole.dxftype() for hole in holes] == [kind] * count
    assert len(space.query('*[layer=="PERIOD"]')) == 1
    if kind == "LWPOLYLINE":
        assert [sum(bulge > 0.0 for (bulge,) in hole.get_points("b")) for hole in holes] == [arcs] * count
    area = sum(Polygon([(at.x, at.y) for at in make_path(hole).flattening(1e-4)]).area for hole in holes)
    assert area == pytest.approx(1e6 * plate.open_area * np.prod(plate.pattern.period), rel=1e-3)
    write_drawing(plate, tmp_path / "a.svg")
    path = ElementTree.parse(tmp_path / "a.svg").getroot()[0].attrib["d"]
    assert (path.count("M"), path.count("A")) == (count, 2 * count if kind == "CIRCLE" else arcs * count)


def same_holes(pattern: Any, other: Any) -> None:
    """Equal areas, and edges and ligaments within the chords of an arc (1e-3 of its radius)."""
    y, z = np.random.default_rng(1).uniform(-20e-3, 20e-3, (2, 2000))
    assert pattern.period == pytest.approx(other.period, rel=1e-9)
    assert pattern.open_area == pytest.approx(other.open_area, rel=1e-9)
    np.testing.assert_allclose(pattern.edge_distance(y, z), other.edge_distance(y, z), rtol=0.0, atol=6e-6)
    assert pattern.ligament() == pytest.approx(other.ligament(), abs=6e-6)


@pytest.mark.parametrize("pattern", [SLOTS, ROUND, ROUNDED, OWN], ids=lambda pattern: pattern["shape"])
def test_a_plate_read_from_its_drawing_has_the_same_holes(pattern: Any, tmp_path: Path) -> None:
    plate = Plate(thickness=4e-3, resistance=1e9, pattern=pattern)
    write_drawing(plate, tmp_path / "a.dxf")
    again = plate.model_copy(update={"pattern": {"file": tmp_path / "a.dxf"}})
    same_holes(again.pattern, plate.pattern)
    assert again.areal_density == pytest.approx(plate.areal_density, rel=1e-9)
    drawing = ezdxf.readfile(tmp_path / "a.dxf")
    for entity in drawing.modelspace():  # in inches, and away from the origin
        entity.scale(1 / 25.4, 1 / 25.4, 1 / 25.4).translate(3, 1, 0)
    drawing.units = ezdxf.units.IN
    drawing.saveas(tmp_path / "inches.dxf")
    same_holes(plate.model_copy(update={"pattern": {"file": tmp_path / "inches.dxf"}}).pattern, plate.pattern)


def test_a_finite_plate_is_read_with_a_cell_around_it(tmp_path: Path) -> None:
    plate = Plate(thickness=4e-3, resistance=1e9, pattern=SLOTS, size=["40 mm", "30 mm"])
    write_drawing(plate, tmp_path / "a.dxf")
    drawn = {"file": tmp_path / "a.dxf"}
    with pytest.raises(
        ValueError, match=r'give spacing = \["41 mm", "45 mm"\] here and plate.size = \["40 mm", "30 mm"\]'
    ):
        plate.model_copy(update={"pattern": drawn})
    again = plate.model_copy(update={"pattern": drawn | {"spacing": ["41 mm", "45 mm"]}})
    y, z = np.random.default_rng(1).uniform(-21e-3, 21e-3, (2, 2000))
    np.testing.assert_allclose(again.edge_distance(y, z), plate.edge_distance(y, z), rtol=0.0, atol=6e-6)


@pytest.mark.parametrize(
    ("unit", "entities", "sentence"),
    [
        (0, ["circle"], r"a.dxf has no units \(\$INSUNITS is 0\); set the units of the drawing"),
        (4, ["circle", "line"], "got LINE .* but a hole is a circle or a closed polyline"),
        (4, ["circle", "frame"], r"CIRCLE .* at \(0, 0\) mm: overlaps or touches LWPOLYLINE .* at \(0, 0\) mm"),
        (4, [], "a.dxf has no holes"),
    ],
)
def test_a_drawing_that_cannot_be_read_names_what_to_change(
    unit: int, entities: list[str], sentence: str, tmp_path: Path
) -> None:
    drawing = ezdxf.new()
    drawing.units, space = unit, drawing.modelspace()
    add = {
        "circle": lambda: space.add_circle((0, 0), 2),
        "line": lambda: space.add_line((4, 4), (5, 5)),
        "frame": lambda: space.add_lwpolyline([(-3, -3), (3, -3), (3, 3), (-3, 3)], close=True),
    }
    for entity in entities:
        add[entity]()
    drawing.saveas(tmp_path / "a.dxf")
    pattern = {"file": tmp_path / "a.dxf", "spacing": ["20 mm", "20 mm"]}
    with pytest.raises(ValueError, match=sentence):
        Plate(thickness=4e-3, resistance=1e9, pattern=pattern)


def test_holes_that_the_rim_cuts_are_counted(tmp_path: Path) -> None:
    plate = Plate(thickness=4e-3, resistance=1e9, pattern=SLOTS, size=["40 mm", "30 mm"])
    assert write_drawing(plate, tmp_path / "a.dxf") == [
        "The rim cuts 6 of 13 holes. List whole holes in a cell of this size."
    ]
    space = ezdxf.readfile(tmp_path / "a.dxf").modelspace()
    assert [len(space.query(f'*[layer=="{layer}"]')) for layer in ("HOLES", "RIM")] == [13, 1]
    whole = SLOTS | {"holes": [[0, 0]], "staggered": False, "spacing": ["40 mm", "30 mm"]}
    within = plate.model_copy(update={"pattern": whole})
    assert write_drawing(within, tmp_path / "b.dxf") == []


@pytest.fixture(scope="module")
def history() -> xarray.Dataset:
    return replay(run(slotted(count=2), options=CPU), 1, folder=Path())


def test_vtk_reads_the_core_and_the_plate_back(history: xarray.Dataset, tmp_path: Path) -> None:
    meshio = pytest.importorskip("meshio")
    core, plate = (
        [(float(e.attrib["timestep"]), path.parent / e.attrib["file"]) for e in ElementTree.parse(path).iter("DataSet")]
        for path in write_vtk(history, tmp_path / "hit")
    )
    assert [time for time, _ in core] == history["time"].values.tolist()
    assert [time for time, _ in plate] == history["snapshot"].values.tolist()
    for step in (0, -1):
        surface, now = meshio.read(core[step][1]), history.isel(time=step)
        nose = float(history["station"].max()) * now["core_axis"].values + now["plate_position"].values
        np.testing.assert_allclose(surface.points[:SIDES].mean(axis=0), nose, atol=1e-7)
        stations, radius = history["station"].values, history["core_radius"].values
        polygon = 0.5 * SIDES * np.sin(2.0 * np.pi / SIDES) / np.pi
        cut = (np.diff(-stations) * (radius[1:] ** 2 + radius[1:] * radius[:-1] + radius[:-1] ** 2)).sum() / 3.0
        quads, ends = surface.cells_dict["quad"], surface.cells_dict["triangle"]
        triangles = surface.points[np.concatenate([quads[:, :3], quads[:, [0, 2, 3]], ends])]
        volume = np.linalg.det(triangles).sum() / 6.0
        assert volume == pytest.approx(np.pi * polygon * cut, rel=1e-3)  # closed, normals outwards
        np.testing.assert_allclose(surface.point_data["core_force"][0], now["force"], rtol=1e-12)
        np.testing.assert_allclose(surface.point_data["velocity"].mean(axis=0)[0], float(now["velocity"][0]), rtol=0.02)
    layer = meshio.read(plate[-1][1])
    assert (layer.points[:, 0].min(), layer.points[:, 0].max()) == (0.0, pytest.approx(4e-3))
    centres = layer.points[layer.cells_dict["hexahedron"]].mean(axis=1)
    y, z = (xarray.DataArray(centres[:, axis], dims="cell") for axis in (1, 2))
    share = history["resistance_share"][-1].sel(cell_y=y, cell_z=z, method="nearest")
    np.testing.assert_array_equal(layer.cell_data["resistance_share"][0], share)
