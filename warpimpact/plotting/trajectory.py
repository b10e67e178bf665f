"""Figures and film of one hit's history: the core in the plate and behind it, its loads, and the plate.

The core is drawn to scale in two views: x-y shows the yaw, x-z the pitch. It comes from the left. The plate is cut
through the hit point.
"""

from collections.abc import Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

import numpy as np
import xarray
from matplotlib import colormaps
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.patches import Polygon
from scipy.spatial import ConvexHull

from warpimpact.analysis.replay_geometry import POINTS_AROUND, largest_in_plate, pressed, slabs
from warpimpact.errors import OutputError
from warpimpact.measures.hits import passed
from warpimpact.plotting.cell import draw_hole_edges, target_word, words
from warpimpact.plotting.maps import save_all
from warpimpact.plotting.style import BLUE, GREY, STEEL, VERMILION, Figure, finish, furnish, in_style, sheet
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.results.files import atomic_path
from warpimpact.scene.model import Array
from warpimpact.scene.units import MM

_US = 1e6
"""Microseconds in a second."""
_ANGLE_SHOWN = {"y": v.YAW, "z": v.PITCH}
"""Projected angle of the axis that each view shows."""
_COMPONENTS = {"x": "black", "y": BLUE, "z": VERMILION}
INSTANTS = 5
"""Number of drawn poses of the core within the plate."""
_FULL_TURN = np.linspace(0.0, 2.0 * np.pi, 73)
_LONGEST_STRESS = 5.0
"""Length of the arrow of the largest stress [mm]."""
_EVERY = 3
"""Every third section and azimuth gets an arrow."""
_ROOM_ABOUT = 2.0
"""Margin about the part that the core weakened [mm]."""
FRAMES, _PER_SECOND = 50, 20
"""Frames of a film, and frames shown in a second."""


class Pose(NamedTuple):
    """Position of the centre of mass in the plate's frame [m], and unit vector towards the nose, both of shape [3]."""

    position: Array
    axis: Array


def _pose_at(dataset: xarray.Dataset, step: int) -> Pose:
    return Pose(dataset["plate_position"].values[step], dataset["core_axis"].values[step])


def poses_in_plate(dataset: xarray.Dataset) -> dict[str, Pose]:
    """Poses of the core at equal intervals of its passage through the plate, by time."""
    steps = np.linspace(0, dataset.sizes["time"] - 1, INSTANTS).round().astype(int)
    return {f"{float(dataset.time[step]) * _US:.0f} µs": _pose_at(dataset, step) for step in steps}


def poses_behind(dataset: xarray.Dataset) -> dict[str, Pose]:
    """Poses of the core at the stand-offs behind the target, by distance; empty if it does not pass.

    The axis follows from the projected angles, the position from free flight.
    """
    end, poses = dataset.isel(time=-1), {}
    position, velocity = end["plate_position"].values, end["velocity"].values
    ahead = float(dataset["station"].max()) if dataset.attrs[attr.STANDOFF_POINT] == "nose" else 0.0
    for standoff in dataset[v.STANDOFF].values.tolist() if passed(dataset) else []:
        there = dataset.sel(standoff=standoff)
        yaw, pitch = (np.radians(float(there[name])) for name in (v.YAW, v.PITCH))
        axis = np.sign(np.cos(yaw)) * np.array([1.0, np.tan(yaw), np.tan(pitch)])
        axis /= np.linalg.norm(axis)
        x = slabs(dataset, "y")[-1].rear + standoff - ahead * axis[0]
        poses[f"{standoff * MM:g} mm"] = Pose(position + velocity * ((x - position[0]) / velocity[0]), axis)
    return poses


def silhouette(dataset: xarray.Dataset, pose: Pose, view: str) -> Array:
    """Outline of the core [m], shape [points, 2]: x, and y or z as `view` says.

    It is the convex hull of the rings; it does not show a groove.
    """
    _, _, (_, right, up) = np.linalg.svd(pose.axis[None, :])  # two directions at right angles to the axis
    station, radius = (dataset[name].values[:, None, None] for name in ("station", "core_radius"))
    ring = np.cos(_FULL_TURN)[:, None] * right + np.sin(_FULL_TURN)[:, None] * up
    points = (pose.position + station * pose.axis + radius * ring)[..., [0, "xyz".index(view)]].reshape(-1, 2)
    outline: Array = points[ConvexHull(points).vertices]
    return outline


def _two_views(
    dataset: xarray.Dataset, poses: Sequence[Pose], *, room: float, path: Array | None = None
) -> tuple[Figure, dict[str, Axes]]:
    """A figure with two views to scale of the plate, with room for poses of the core and a margin [mm].

    Args:
        path: positions of the centre of mass that are drawn as a line [m], shape [steps, 3].
    """
    corners = {}
    for view in _ANGLE_SHOWN:
        outlines = np.concatenate([silhouette(dataset, pose, view) for pose in poses])
        hit = [slabs(dataset, "y")[-1].rear, float(dataset[f"hit_{view}"])]
        points = np.vstack([outlines, [[0.0, hit[1]], hit]]) * MM
        corners[view] = np.stack([points.min(axis=0) - room, points.max(axis=0) + room], axis=1)
    heights = [np.ptp(up) for _, up in corners.values()]
    width = np.ptp(corners["y"][0])
    inch = min(9.0 / width, 8.0 / sum(heights))  # per mm
    figure = Figure(figsize=(inch * width + 1.0, inch * sum(heights) + 1.2), layout="compressed")
    panels = dict(zip(corners, figure.subplots(2, 1, height_ratios=heights), strict=True))
    for view, axes in panels.items():
        across, up = corners[view]
        axes.set(xlim=across, ylim=up, aspect="equal", xlabel="x [mm]", ylabel=f"{view} [mm]")
        axes.autoscale(False)
        along = (dataset["section"] + dataset[f"hit_{view}"]) * MM
        for front, rear, solid in slabs(dataset, view):
            style: dict[str, Any] = {"where": solid, "step": "mid", "color": STEEL, "ec": "none", "zorder": 0}
            axes.fill_betweenx(along, front * MM, rear * MM, **style)
        if path is not None:
            label = "centre of mass"
            axes.plot(*path[:, [0, "xyz".index(view)]].T * MM, color="black", lw=0.8, ls="--", label=label, zorder=2)
    return figure, panels


def _draw_core(axes: Axes, dataset: xarray.Dataset, pose: Pose, view: str, **style: Any) -> Polygon:
    core = Polygon(silhouette(dataset, pose, view) * MM, **{"facecolor": GREY, "edgecolor": "black"} | style)
    axes.add_patch(core)
    return core


def _finish(figure: Figure, dataset: xarray.Dataset, what: str, *, legend: bool = False) -> Figure:
    """Write the number of the hit and what a figure shows of it as the title, and by which method."""
    method = "by finite elements" if "node_position" in dataset else "a replay by the fast law"
    return finish(figure, method, title=f"hit {dataset.attrs[attr.HIT]}: {what}", result=dataset, legend=legend)


@in_style
def passage(dataset: xarray.Dataset) -> Figure:
    """The core at equal intervals of its passage through the plate (the paper's figs. 7 and 9)."""
    poses = poses_in_plate(dataset)
    figure, views = _two_views(dataset, [*poses.values()], room=5.0, path=dataset["plate_position"].values)
    colours = colormaps["viridis"](np.linspace(0.0, 0.9, len(poses)))
    for view, axes in views.items():
        for (label, pose), colour in zip(poses.items(), colours, strict=True):
            style: dict[str, Any] = {"facecolor": (*colour[:3], 0.3), "edgecolor": colour, "lw": 1.4, "label": label}
            _draw_core(axes, dataset, pose, view, **style)
    return _finish(figure, dataset, f"passage through the {target_word(dataset)}", legend=True)


@in_style
def flight(dataset: xarray.Dataset) -> Figure:
    """The core on impact, and at the stand-offs if it passes the plate (the paper's figs. 8 and 10)."""
    poses = {"impact": _pose_at(dataset, 0), **poses_behind(dataset)}
    figure, views = _two_views(dataset, [*poses.values()], room=15.0)
    for view, axes in views.items():
        for label, pose in poses.items():
            outline = _draw_core(axes, dataset, pose, view).get_xy()
            angle = np.degrees(np.arctan2(pose.axis["xyz".index(view)], pose.axis[0]))
            text = f"{label}: {_ANGLE_SHOWN[view]} {round(float(angle), 1) + 0.0:.1f}°".replace("-", "−")  # no "-0.0"
            axes.text(outline[:, 0].mean(), outline[:, 1].max() + 1.0, text, ha="center", va="bottom")
    return _finish(figure, dataset, f"on impact and behind the {target_word(dataset)}")


@in_style
def course(dataset: xarray.Dataset) -> Figure:
    """Velocity, attitude, loads and energy against time."""
    figure = Figure(figsize=(10.0, 9.0), layout="constrained")
    panels = figure.subplots(3, 2, sharex=True)
    time, velocity, axis = dataset["time"] * _US, dataset["velocity"], dataset["core_axis"]
    by_axis = {
        "change of velocity [m/s]": velocity - velocity[0],
        "angular velocity [10³ rad/s]": dataset["angular_velocity"] / 1e3,
        "force [kN]": dataset["force"] / 1e3,
        "moment [N m]": dataset["moment"],
    }
    energies, angles = panels[-1]
    for panel, (label, values) in zip(panels.flat, by_axis.items(), strict=False):
        for component, colour in _COMPONENTS.items():
            panel.plot(time, values.sel(axis=component), color=colour, label=component)
        furnish(panel, ylabel=label)
    for view, angle in _ANGLE_SHOWN.items():
        turned = np.unwrap(np.arctan2(axis.sel(axis=view), axis.sel(axis="x")))
        angles.plot(time, np.degrees(turned), color=_COMPONENTS[view], label=angle)
    furnish(angles, xlabel="time [µs]", ylabel="angle of the axis [°]")
    furnish(energies, xlabel="time [µs]")
    sides = {"translational_energy": (energies, "black"), "rotational_energy": (energies.twinx(), VERMILION)}
    for energy, (side, colour) in sides.items():
        side.plot(time, dataset[energy], color=colour)
        side.set_ylabel(f"{words(energy)} [J]", color=colour)
        side.tick_params(axis="y", colors=colour)
    return _finish(figure, dataset, f"course through the {target_word(dataset)}")


@in_style
def plate(dataset: xarray.Dataset) -> Figure:
    """Resistance left in the plate, from the first contact to the end, seen from behind (the paper's fig. 6).

    Each cell of the plate is shown as a share of its initial resistance, which is less for a cell at the edge of a
    hole.
    """
    share = dataset["resistance_share"]
    left = (share / share[0]).where(share[0] >= 0.5)
    left = left.assign_coords({name: left[name] * MM for name in ("cell_y", "cell_z")})
    weaker = left.where(left[-1] < left[0], drop=True)
    weaker = weaker if weaker.size else left
    ranges = [weaker[name].values[[0, -1]] + [-_ROOM_ABOUT, _ROOM_ABOUT] for name in ("cell_y", "cell_z")]
    figure, panels = sheet(len(left), 3, (3.6, 0.8 + 3.1 * np.ptp(ranges[1]) / np.ptp(ranges[0])))
    style: dict[str, Any] = {"cmap": "viridis", "vmin": 0.0, "vmax": 1.0, "add_colorbar": False, "add_labels": False}
    for panel, image in zip(panels, left, strict=True):
        drawn = image.plot.imshow(x="cell_y", y="cell_z", ax=panel, **style)
        panel.set(xlim=ranges[0], ylim=ranges[1], aspect="equal", xlabel="y [mm]", ylabel="z [mm]")
        panel.label_outer()
        panel.autoscale(False)
        draw_hole_edges(panel, dataset["outline_y"].values, dataset["outline_z"].values)
        panel.plot(dataset[v.HIT_Y] * MM, dataset[v.HIT_Z] * MM, "+", color=VERMILION, ms=10, mew=2)
        panel.set_title(f"{float(image.snapshot) * _US:.1f} µs")
    figure.colorbar(drawn, ax=panels, label="share of the resistance left; + is the hit point")
    return _finish(figure, dataset, "resistance left in the plate, seen from behind")


@in_style
def pressure(dataset: xarray.Dataset) -> Figure:
    """The core at its largest force; arrows into its surface show the normal stress.

    Colour and length show the stress as a share of that of the untouched plate at rest (`replay_geometry.pressed`).
    """
    step = largest_in_plate(dataset)
    surface = pressed(dataset, step)
    figure = Figure(figsize=(9.0, 6.0), layout="constrained")
    axes = figure.add_subplot(projection="3d")
    x, y, z = np.moveaxis(np.concatenate([surface.point, surface.point[:, :1]], axis=1) * MM, -1, 0)
    axes.plot_wireframe(x, y, z, rcount=24, ccount=POINTS_AROUND // _EVERY, color="0.75", linewidth=0.5)
    some = np.zeros(surface.stress.shape, dtype=bool)
    some[::_EVERY, ::_EVERY] = True
    some &= surface.stress > 0.0
    scale, colours = Normalize(0.0, 1.0), colormaps["viridis"]
    arrows = -surface.normal[some] * surface.stress[some][:, None] * _LONGEST_STRESS
    tails = surface.point[some] * MM - arrows
    style: dict[str, Any] = {"linewidths": 1.2, "arrow_length_ratio": 0.3}
    axes.quiver(*tails.T, *arrows.T, colors=colours(scale(surface.stress[some])), **style)
    axes.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]", aspect="equal")
    axes.set_box_aspect([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()), np.ptp(axes.get_zlim())], zoom=1.3)
    axes.locator_params(nbins=4)
    label = "normal stress, share of the untouched plate's"
    figure.colorbar(ScalarMappable(scale, colours), ax=axes, shrink=0.6, pad=0.1, label=label)
    force, moment = (float(np.linalg.norm(dataset[name][step])) for name in ("force", "moment"))
    when = f"{force / 1e3:.3g} kN and {moment:.3g} N m at {float(dataset.time[step]) * _US:.1f} µs"
    return _finish(figure, dataset, f"normal stress under the largest force, {when}")


FIGURES = (passage, flight, pressure, course, plate)


def save_figures(dataset: xarray.Dataset, folder: Path, stem: str) -> list[Path]:
    """Write the figures of a history as PNG files ``<stem>_<figure>.png`` and return their paths."""
    return save_all({draw.__name__: draw(dataset) for draw in FIGURES}, folder, stem, overwrite=True)


@in_style
def animation(dataset: xarray.Dataset) -> FuncAnimation:
    """Film of a history from the first contact to the end of contact, at constant time intervals.

    Between two steps position and axis are interpolated linearly.
    """
    times = np.linspace(float(dataset["time"][0]), float(dataset["time"][-1]), FRAMES)
    between = dataset[["plate_position", "core_axis", "velocity"]].interp(time=times)
    positions, axes, velocities = (between[name].values for name in between)
    poses = [*map(Pose, positions, axes / np.linalg.norm(axes, axis=1, keepdims=True))]
    speeds = np.linalg.norm(velocities, axis=1)
    figure, views = _two_views(dataset, poses, room=4.0, path=positions)
    _finish(figure, dataset, "")
    FigureCanvasAgg(figure)
    cores = {view: _draw_core(panel, dataset, poses[0], view) for view, panel in views.items()}

    def show(frame: int) -> list[Polygon]:
        for view, core in cores.items():
            core.set_xy(silhouette(dataset, poses[frame], view) * MM)
        tilt = np.degrees(np.arccos(np.clip(poses[frame].axis @ velocities[0] / speeds[0], -1.0, 1.0)))
        title = f"{times[frame] * _US:5.1f} µs, {speeds[frame]:.0f} m/s, tilt {tilt:.1f}°"
        figure.suptitle(f"hit {dataset.attrs[attr.HIT]}: {title}")
        return list(cores.values())

    show(0)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the layout is the same in all frames, and solving it takes most of the time
    return FuncAnimation(figure, show, frames=FRAMES, interval=1e3 / _PER_SECOND)


def save_animation(dataset: xarray.Dataset, path: Path) -> None:
    """Write the film of a history in the format that its name asks for (`writer_for`), whole or not at all."""
    with TemporaryDirectory(dir=path.parent) as folder, atomic_path(path) as file:
        film = Path(folder) / path.name  # its suffix says the format
        animation(dataset).save(film, writer=writer_for(path), dpi=80)
        film.rename(file)


def writer_for(path: Path) -> AbstractMovieWriter:
    """The writer for the format that the name of a film asks for.

    Raises:
        OutputError: the name ends neither in .gif nor in .mp4, or FFmpeg is missing for an MP4.
    """
    suffix = path.suffix.lower()
    if suffix not in (".gif", ".mp4"):
        raise OutputError(f"{path}: the name of a film must end in .gif or .mp4")
    if suffix == ".mp4" and not FFMpegWriter.isAvailable():
        raise OutputError(f"{path}: an MP4 needs the program ffmpeg, which was not found; a GIF does not need it")
    return PillowWriter(fps=_PER_SECOND) if suffix == ".gif" else FFMpegWriter(fps=_PER_SECOND)
