"""Pictures of a hit and of a plate: to scale, the core and the holes where they are."""

from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
import pytest
import xarray
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import to_rgb
from matplotlib.figure import Figure
from matplotlib.patches import Polygon
from PIL import Image

from warpimpact import Campaign, Plate, catalogue
from warpimpact.cli import main
from warpimpact.errors import OutputError
from warpimpact.plotting import plate_figure, style, trajectory
from warpimpact.plotting.trajectory import INSTANTS, Pose, silhouette
from warpimpact.runs.replay import replay
from warpimpact.runs.run import run
from warpimpact.scene import ConeCore, Impact, Layer, SlotPattern, Target

from ...options import CPU

CAMPAIGN = Path(__file__).parents[3] / "campaigns" / "oblique_shot.toml"
LENGTH, CENTRE, THICKNESS = 27.86e-3, 18.05e-3, 4e-3


def history_of(standoff_point: str = "centre_of_mass") -> xarray.Dataset:
    """One slanted hit of a slotted plate."""
    output = {"standoffs": (0.05, 0.13), "standoff_point": standoff_point}
    changes = {"numerics": {"level": 0}, "output": output}
    campaign = Campaign.from_toml(CAMPAIGN, count=2).model_copy(update=changes)
    return replay(run(campaign, options=CPU), 1, folder=Path())


@pytest.fixture(scope="module")
def history() -> xarray.Dataset:
    return history_of()


def cores(figure: Figure, view: int) -> list[np.ndarray]:
    """Outlines of the cores in a view [mm]."""
    return [np.array(patch.get_xy()) for patch in figure.axes[view].patches if isinstance(patch, Polygon)]


@pytest.mark.parametrize(("view", "component"), [("y", 1), ("z", 2)])
def test_silhouette_is_that_of_the_turned_core(history: xarray.Dataset, view: str, component: int) -> None:
    place, width = np.array([1e-3, 2e-3, -3e-3]), 2.0 * 3.022e-3
    for axis, extent in (
        ([1.0, 0.0, 0.0], (LENGTH, width)),
        ([0.0, 1.0, 0.0], (width, LENGTH if view == "y" else width)),
        ([0.0, 0.0, -1.0], (width, LENGTH if view == "z" else width)),
    ):
        outline = silhouette(history, Pose(place, np.array(axis)), view)
        np.testing.assert_allclose(np.ptp(outline, axis=0), extent, rtol=2e-3)
    ahead = silhouette(history, Pose(place, np.array([1.0, 0.0, 0.0])), view)
    assert ahead[:, 0].max() == pytest.approx(place[0] + CENTRE, rel=1e-3)
    assert ahead[:, 1].mean() == pytest.approx(place[component], abs=1e-4)


def test_passage_shows_the_core_from_first_touch_to_the_end(history: xarray.Dataset) -> None:
    figure = trajectory.passage(history)
    for view, axis in enumerate("yz"):
        outlines = cores(figure, view)
        assert len(outlines) == INSTANTS
        for outline, step in ((outlines[0], 0), (outlines[-1], -1)):
            pose = Pose(history["plate_position"].values[step], history["core_axis"].values[step])
            np.testing.assert_allclose(outline[:-1], silhouette(history, pose, axis) * 1e3)
        low, high = figure.axes[view].get_ylim()
        assert all((low < outline[:, 1]).all() and (outline[:, 1] < high).all() for outline in outlines)
        assert figure.axes[view].get_aspect() == 1.0


def test_plate_is_cut_through_the_hit_point(history: xarray.Dataset) -> None:
    plate, pieces = Campaign.from_toml(CAMPAIGN).plate, []
    for axes, fixed in zip(trajectory.passage(history).axes[:2], ("hit_z", "hit_y"), strict=True):
        (cut,) = axes.collections
        polygons = [polygon for path in cut.get_paths() for polygon in path.to_polygons()]
        pieces.append(len(polygons))
        for x, along in (polygon.T for polygon in polygons):
            assert (x.min(), x.max()) == (0.0, 1e3 * THICKNESS)
            middle = 1e-3 * np.linspace(along.min() + 0.1, along.max() - 0.1, 101)
            across = np.full(101, float(history[fixed]))
            assert plate.is_solid(*((middle, across) if fixed == "hit_z" else (across, middle))).all()
    assert max(pieces) > 4


@pytest.mark.parametrize("standoff_point", ["centre_of_mass", "nose"])
def test_flight_shows_the_core_at_the_standoffs(standoff_point: str) -> None:
    history = history_of(standoff_point)
    figure = trajectory.flight(history)
    for view, angle in enumerate(("yaw", "pitch")):
        assert len(cores(figure, view)) == 3
        texts = [text.get_text() for text in figure.axes[view].texts]
        for text, shown, standoff in zip(texts[1:], history[angle].values, (50, 130), strict=True):
            assert text == f"{standoff} mm: {angle} {shown:.1f}°".replace("-", "−")
    for outline, standoff in zip(cores(figure, 0)[1:], history["standoff"].values, strict=True):
        yaw, pitch = (np.radians(float(history[a].sel(standoff=standoff))) for a in ("yaw", "pitch"))
        along = 1.0 / np.sqrt(1.0 + np.tan(yaw) ** 2 + np.tan(pitch) ** 2)
        nose, base = CENTRE * along, (CENTRE - LENGTH) * along
        ahead = 0.0 if standoff_point == "centre_of_mass" else nose
        middle = (THICKNESS + standoff - ahead + 0.5 * (nose + base)) * 1e3
        assert 0.5 * (outline[:, 0].min() + outline[:, 0].max()) == pytest.approx(middle, abs=3.0)


def test_film_moves_the_core(history: xarray.Dataset, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(trajectory, "FRAMES", 6)
    trajectory.save_animation(history, tmp_path / "a.gif")
    places = []
    with Image.open(tmp_path / "a.gif") as image:
        for number in range(image.n_frames):
            image.seek(number)
            frame = np.asarray(image.convert("L"), dtype=float)
            places.append(np.mean(np.nonzero((frame > 120) & (frame < 160))[1]))  # columns of the grey core
    assert len(places) == 6
    assert places == sorted(places)
    with pytest.raises(OutputError, match=r"a\.avi: the name of a film must end in \.gif or \.mp4"):
        trajectory.writer_for(Path("a.avi"))


CAMPAIGNS = Path(__file__).parents[3] / "campaigns"
MM = 1e-3
SLOTS = SlotPattern(length="12 mm", width="4 mm", spacing=["8 mm", "16 mm"], staggered=True)
CORE = ConeCore(diameter="6 mm", length="20 mm", mass="4 g")
STEEL, HOLE = to_rgb(style.STEEL), (1.0, 1.0, 1.0)


def plate(**changes: object) -> Plate:
    return Plate(**{"thickness": "4 mm", "resistance": "2 GPa", "pattern": SLOTS} | changes)


def colours(figure: plt.Figure, *points: tuple[float, float], view: int = 0) -> np.ndarray:
    """Colours of a picture at points y, z [mm] of its plate, shape [points, 3]; view 2 is from the front."""
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    pixels = np.asarray(canvas.buffer_rgba())[..., :3] / 255
    across, up = figure.axes[view].transData.transform(points).round().astype(int).T
    return pixels[-1 - up, across]


def test_holes_are_where_they_are_and_to_scale() -> None:
    figure = plate_figure(plate())
    shown = colours(figure, (0, 5), (0, 7), (9, 9), (9, 0), (1.5, 0), (2.6, 0), (-16, 21), (20, 1))
    np.testing.assert_allclose(shown, [HOLE, STEEL, HOLE, STEEL, HOLE, STEEL, HOLE, STEEL], atol=0.01)
    axes = figure.axes[0]
    assert axes.get_xlim() == pytest.approx((-24, 24))
    box = axes.get_window_extent()
    assert box.width / 48 == pytest.approx(box.height / np.ptp(axes.get_ylim()), rel=1e-3)


def test_a_target_is_drawn_with_its_layers() -> None:
    base = Layer(thickness="10 mm", gap="20 mm", resistance="2 GPa")
    figure = plate_figure(Target(layers=(plate(), base)))
    behind, section, _ = figure.axes
    assert [text.get_text() for text in section.texts] == ["plate, 4 mm", "layer 1, 10 mm"]
    figure.draw_without_rendering()
    scales = [np.diff(axes.transData.transform([(0, 0), (1, 1)]), axis=0).ravel() for axes in (behind, section)]
    np.testing.assert_allclose(scales, scales[0][0], rtol=1e-3)
    holed, solid = (collection.get_paths() for collection in section.collections)
    assert len(holed) > len(solid) == 1
    np.testing.assert_allclose(solid[0].get_extents().get_points(), [[24, -24], [34, 24]])
    named = catalogue.plate("HHA Class 1", ".30 AP M2", 0.0, thickness="6 mm")
    assert [text.get_text() for text in plate_figure(named).axes[1].texts] == ["plate: HHA Class 1, 6 mm"]


def test_the_front_is_the_mirror_image_of_the_back() -> None:
    turned = plate(pattern=SLOTS.model_copy(update={"rotation": "30 deg"}))
    figure = plate_figure(turned, impact=Impact(velocity=800.0, obliquity="30 deg"))
    behind, _, front = figure.axes
    assert (*front.get_xlim(),) == (*reversed(behind.get_xlim()),)
    points = (-2.0, 3.5), (2.0, 3.5), (0.0, 0.0)
    np.testing.assert_allclose(colours(figure, *points), colours(figure, *points, view=2), atol=0.01)


@pytest.mark.usefixtures("in_tmp_path")
def test_the_command_draws_a_plate_and_prints_its_numbers(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plate", str(CAMPAIGNS / "slotted_plate.toml")]) == 0
    title, thickness, area, smallest, density, picture = capsys.readouterr().out.splitlines()
    assert title == Campaign.from_toml(CAMPAIGNS / "slotted_plate.toml").title
    assert (thickness.split()[1:], smallest.split("ligament")[1].strip()) == (["4", "mm"], "4.00 mm")
    share = float(area.split()[-1].rstrip("%")) / 100
    assert float(density.split()[-2]) == pytest.approx(31.4 * (1 - share), abs=0.07)  # of 31.4 kg/m² of steel
    assert plt.imread(picture).shape[2] == 4
