"""Figures and film of one hit's history: the core in the plate and behind it, its loads, and the plate.

The core is drawn to scale in two views: x-y shows the yaw, x-z the pitch. It comes from the left. The plate is cut
through the hit point.
"""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray
from matplotlib import colormaps
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.image import AxesImage
from matplotlib.patches import Polygon
from matplotlib.ticker import MaxNLocator
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from warpimpact.analysis.replay_geometry import POINTS_AROUND, depth_of, largest_in_plate, pressed, slabs
from warpimpact.plotting.cell import draw_hole_edges, struck, words
from warpimpact.plotting.maps import save_all
from warpimpact.plotting.style import BLUE, GREY, STEEL, VERMILION, Figure, finish, in_style
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import passed
from warpimpact.results.files import OutputError
from warpimpact.scene.display import MM
from warpimpact.scene.model import Array

_US = 1e6
_ANGLE_SHOWN = {"y": v.YAW, "z": v.PITCH}
"""Projected angle of the axis that each view shows."""
_COMPONENTS = {"x": "black", "y": BLUE, "z": VERMILION}
_NEAR_FRAME = 0.2
"""Share of the width in which a text would cross the frame."""
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


def poses_in_plate(dataset: xarray.Dataset) -> dict[str, Pose]:
    """Poses of the core at equal intervals of its passage through the plate, by time."""
    steps = np.linspace(0, dataset.sizes["time"] - 1, INSTANTS).round().astype(int)
    return {f"{float(dataset[v.TIME][step]) * _US:.0f} µs": pose_at_step(dataset, step) for step in steps}


def poses_behind(dataset: xarray.Dataset) -> dict[str, Pose]:
    """Poses of the core at the stand-offs behind the target, by distance; empty if it does not pass."""
    standoffs = dataset[v.STANDOFF].values.tolist() if passed(dataset) else []
    return {f"{standoff * MM:g} mm": _pose_at(dataset, standoff) for standoff in standoffs}


def silhouette(dataset: xarray.Dataset, pose: Pose, view: str) -> Array:
    """Outline of the core [m], shape [points, 2]: x, and y or z as `view` says.

    It is the convex hull of the rings; it does not show a groove.
    """
    _, _, (_, right, up) = np.linalg.svd(pose.axis[None, :])  # two directions at right angles to the axis
    station, radius = (dataset[name].values[:, None, None] for name in (v.STATION, v.CORE_RADIUS))
    ring = np.cos(_FULL_TURN)[:, None] * right + np.sin(_FULL_TURN)[:, None] * up
    points = (pose.position + station * pose.axis + radius * ring)[..., [0, "xyz".index(view)]].reshape(-1, 2)
    outline: Array = points[ConvexHull(points).vertices]
    return outline


def pose_at_step(dataset: xarray.Dataset, step: int) -> Pose:
    return Pose(dataset[v.PLATE_POSITION].values[step], dataset[v.CORE_AXIS].values[step])


def _pose_at(dataset: xarray.Dataset, standoff: float) -> Pose:
    """The core when it passes a stand-off [m]: the axis from the projected angles, the position from free flight."""
    there, end = dataset.sel(standoff=standoff), dataset.isel(time=-1)
    axis = _axis_of(*(np.radians(float(there[name])) for name in (v.YAW, v.PITCH)))
    position, velocity = end[v.PLATE_POSITION].values, end[v.VELOCITY].values
    x = depth_of(dataset) + standoff - _ahead(dataset) * axis[0]
    return Pose(position + velocity * ((x - position[0]) / velocity[0]), axis)


def _axis_of(yaw: float, pitch: float) -> Array:
    """The unit vector with these projected angles [rad]."""
    axis = np.sign(np.cos(yaw)) * np.array([1.0, np.tan(yaw), np.tan(pitch)])
    return np.asarray(axis / np.linalg.norm(axis))


def _ahead(dataset: xarray.Dataset) -> float:
    """Distance of the stand-off point ahead of the centre of mass [m]."""
    return float(dataset[v.STATION].max()) if dataset.attrs[attr.STANDOFF_POINT] == "nose" else 0.0


@in_style
def passage(dataset: xarray.Dataset) -> Figure:
    """The core at equal intervals of its passage through the plate (the paper's figs. 7 and 9)."""
    poses = poses_in_plate(dataset)
    figure, views = two_views(dataset, poses.values(), room=5.0)
    colours = colormaps["viridis"](np.linspace(0.0, 0.9, len(poses)))
    for view, axes in views.items():
        for (label, pose), colour in zip(poses.items(), colours, strict=True):
            outline = silhouette(dataset, pose, view) * MM
            axes.add_patch(Polygon(outline, facecolor=(*colour[:3], 0.3), edgecolor=colour, lw=1.4, label=label))
        path = dataset[v.PLATE_POSITION].sel(axis=["x", view]) * MM
        axes.plot(path[:, 0], path[:, 1], color="black", lw=0.8, ls="--", label="centre of mass")
    _finish(figure, dataset, f"passage through the {struck(dataset)}", legend=True)
    return figure


@in_style
def flight(dataset: xarray.Dataset) -> Figure:
    """The core on impact, and at the stand-offs if it passes the plate (the paper's figs. 8 and 10)."""
    poses = {"impact": pose_at_step(dataset, 0), **poses_behind(dataset)}
    figure, views = two_views(dataset, poses.values(), room=15.0)
    for view, axes in views.items():
        for label, pose in poses.items():
            outline = silhouette(dataset, pose, view) * MM
            axes.add_patch(Polygon(outline, facecolor=GREY, edgecolor="black"))
            angle = np.degrees(np.arctan2(pose.axis["xyz".index(view)], pose.axis[0]))
            angle = round(float(angle), 1) + 0.0  # no "-0.0"
            text = f"{label}: {_ANGLE_SHOWN[view]} {angle:.1f}°".replace("-", "−")
            x, side = _within(axes, outline[:, 0])
            axes.text(x, outline[:, 1].max() + 1.0, text, ha=side, va="bottom")
    _finish(figure, dataset, f"on impact and behind the {struck(dataset)}")
    return figure


def _within(axes: Axes, across: np.ndarray) -> tuple[float, str]:
    """Place of a text above a core, and its side there. Near the frame it extends away from the frame."""
    low, high = axes.get_xlim()
    middle = (across.mean() - low) / (high - low)
    if middle < _NEAR_FRAME:
        return float(across.min()), "left"
    return (float(across.max()), "right") if middle > 1.0 - _NEAR_FRAME else (float(across.mean()), "center")


@in_style
def course(dataset: xarray.Dataset) -> Figure:
    """Velocity, attitude, loads and energy against time."""
    figure = Figure(figsize=(10.0, 9.0), layout="constrained")
    panels = figure.subplots(3, 2, sharex=True)
    time, axis = dataset[v.TIME] * _US, dataset[v.CORE_AXIS]
    velocity = dataset[v.VELOCITY]
    _draw_components(panels[0, 0], time, velocity - velocity[0], "change of velocity [m/s]")
    _draw_components(panels[0, 1], time, dataset[v.MARCHED_ANGULAR_VELOCITY] / 1e3, "angular velocity [10³ rad/s]")
    _draw_components(panels[1, 0], time, dataset[v.FORCE] / 1e3, "force [kN]")
    _draw_components(panels[1, 1], time, dataset[v.MOMENT], "moment [N m]")
    _draw_energy(panels[2, 0], time, dataset)
    for view, angle in _ANGLE_SHOWN.items():
        values = np.degrees(np.unwrap(np.arctan2(axis.sel(axis=view), axis.sel(axis="x"))))
        panels[2, 1].plot(time, values, color=_COMPONENTS[view], label=angle)
    panels[2, 1].set_ylabel("angle of the axis [°]")
    panels[2, 1].legend(frameon=False)
    for panel in panels.flat:
        panel.grid(color="0.9")
    for panel in panels[-1]:
        panel.set_xlabel("time [µs]")
    _finish(figure, dataset, f"course through the {struck(dataset)}")
    return figure


@in_style
def plate(dataset: xarray.Dataset) -> Figure:
    """Resistance left in the plate, from the first contact to the end, seen from behind (the paper's fig. 6).

    Each cell of the plate is shown as a share of its initial resistance, which is less for a cell at the edge of a
    hole.
    """
    times = dataset[v.SNAPSHOT].values
    columns = min(3, len(times))
    rows = -(-len(times) // columns)
    along_y, along_z = weakened_ranges(dataset)
    tall = np.ptp(along_z) / np.ptp(along_y)
    figure = Figure(figsize=(3.3 * columns + 1.2, (3.1 * tall + 0.5) * rows + 0.7), layout="constrained")
    panels = figure.subplots(rows, columns, sharex=True, sharey=True, squeeze=False)
    for place, (panel, time) in enumerate(zip(panels.flat, times, strict=False)):
        image = _draw_share(panel, dataset, place)
        panel.set(xlim=along_y, ylim=along_z)
        draw_hole_edges(panel, dataset[v.OUTLINE_Y].values, dataset[v.OUTLINE_Z].values)
        panel.plot(dataset[v.HIT_Y] * MM, dataset[v.HIT_Z] * MM, "+", color=VERMILION, ms=10, mew=2)
        panel.set_title(f"{time * _US:.1f} µs")
    for panel in panels[-1]:
        panel.set_xlabel("y [mm]")
    for panel in panels[:, 0]:
        panel.set_ylabel("z [mm]")
    figure.colorbar(image, ax=panels, label="share of the resistance left; + is the hit point")
    _finish(figure, dataset, "resistance left in the plate, seen from behind")
    return figure


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
    axes.quiver(
        *tails.T, *arrows.T, colors=colours(scale(surface.stress[some])), linewidths=1.2, arrow_length_ratio=0.3
    )
    axes.set(xlabel="x [mm]", ylabel="y [mm]", zlabel="z [mm]", aspect="equal")
    axes.set_box_aspect([np.ptp(axes.get_xlim()), np.ptp(axes.get_ylim()), np.ptp(axes.get_zlim())], zoom=1.3)
    for side in (axes.yaxis, axes.zaxis):
        side.set_major_locator(MaxNLocator(4))
    label = "normal stress, share of the untouched plate's"
    figure.colorbar(ScalarMappable(scale, colours), ax=axes, shrink=0.6, pad=0.1, label=label)
    force, moment = (float(np.linalg.norm(dataset[name][step])) for name in (v.FORCE, v.MOMENT))
    when = f"{force / 1e3:.3g} kN and {moment:.3g} N m at {float(dataset[v.TIME][step]) * _US:.1f} µs"
    _finish(figure, dataset, f"normal stress under the largest force, {when}")
    return figure


FIGURES = (passage, flight, pressure, course, plate)


def save_figures(dataset: xarray.Dataset, folder: Path, stem: str) -> list[Path]:
    """Write the figures of a history as PNG files ``<stem>_<figure>.png`` and return their paths."""
    return save_all({draw.__name__: draw(dataset) for draw in FIGURES}, folder, stem, overwrite=True)


def _finish(figure: Figure, dataset: xarray.Dataset, what: str, *, legend: bool = False) -> None:
    """Write the number of the hit and what a figure shows of it as the title."""
    finish(figure, title=f"hit {dataset.attrs[attr.HIT]}: {what}", result=dataset, legend=legend)


def two_views(dataset: xarray.Dataset, poses: Iterable[Pose], *, room: float) -> tuple[Figure, dict[str, Axes]]:
    """A figure with two views to scale that contain the plate, all poses of the core and a margin `room` [mm]."""
    poses = list(poses)
    corners = {}
    for view in _ANGLE_SHOWN:
        outlines = np.concatenate([silhouette(dataset, pose, view) for pose in poses])
        hit = [depth_of(dataset), float(dataset[v.HIT_POINT[view]])]
        points = np.vstack([outlines, [[0.0, hit[1]], hit]]) * MM
        corners[view] = points.min(axis=0) - room, points.max(axis=0) + room
    heights = [high[1] - low[1] for low, high in corners.values()]
    width = corners["y"][1][0] - corners["y"][0][0]
    inch = min(9.0 / width, 8.0 / sum(heights))  # per mm
    figure = Figure(figsize=(inch * width + 1.0, inch * sum(heights) + 1.2), layout="compressed")
    panels = figure.subplots(2, 1, height_ratios=heights)
    for axes, (view, (low, high)) in zip(panels, corners.items(), strict=True):
        axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]), aspect="equal")
        axes.set(xlabel="x [mm]", ylabel=f"{view} [mm]")
        along = (dataset[v.SECTION] + dataset[v.HIT_POINT[view]]) * MM
        for front, rear, solid in slabs(dataset, view):
            axes.fill_betweenx(along, front * MM, rear * MM, where=solid, step="mid", color=STEEL, ec="none", zorder=0)
        axes.autoscale(False)
    return figure, dict(zip(corners, panels, strict=True))


def _draw_components(axes: Axes, time: xarray.DataArray, values: xarray.DataArray, label: str) -> None:
    for component, colour in _COMPONENTS.items():
        axes.plot(time, values.sel(axis=component), color=colour, label=component)
    axes.set_ylabel(label)
    axes.legend(frameon=False)


def _draw_energy(axes: Axes, time: xarray.DataArray, dataset: xarray.Dataset) -> None:
    """Kinetic energy of translation on the left axis, and the much smaller one of rotation on the right axis."""
    drawn = ((axes, v.TRANSLATIONAL_ENERGY, "black"), (axes.twinx(), v.ROTATIONAL_ENERGY, VERMILION))
    for side, energy, colour in drawn:
        side.plot(time, dataset[energy], color=colour)
        side.set_ylabel(f"{words(energy)} [J]", color=colour)
        side.tick_params(axis="y", colors=colour)


@in_style
def animation(dataset: xarray.Dataset) -> FuncAnimation:
    """Film of a history from the first contact to the end of contact, at constant time intervals.

    Between two steps position and axis are interpolated linearly.
    """
    times = np.linspace(float(dataset[v.TIME][0]), float(dataset[v.TIME][-1]), FRAMES)
    between = dataset[[v.PLATE_POSITION, v.CORE_AXIS, v.VELOCITY]].interp(time=times)
    every = (pose_at_step(between, frame) for frame in range(FRAMES))
    poses = [Pose(pose.position, pose.axis / np.linalg.norm(pose.axis)) for pose in every]
    speeds = np.linalg.norm(between[v.VELOCITY], axis=1)
    figure, panels = two_views(dataset, poses, room=4.0)
    _finish(figure, dataset, "")
    FigureCanvasAgg(figure)
    cores = {view: Polygon(np.zeros((1, 2)), facecolor="0.55", edgecolor="black") for view in panels}
    for view, axes in panels.items():
        axes.add_patch(cores[view])
        axes.plot(*np.array([pose.position[[0, "xyz".index(view)]] for pose in poses]).T * MM, "k--", lw=0.8)
    title = f"hit {dataset.attrs[attr.HIT]}"

    def show(frame: int) -> list[Polygon]:
        for view, core in cores.items():
            core.set_xy(silhouette(dataset, poses[frame], view) * MM)
        tilt = np.degrees(np.arccos(np.clip(poses[frame].axis @ _line_of_fire(dataset), -1.0, 1.0)))
        figure.suptitle(f"{title}: {times[frame] * _US:5.1f} µs, {speeds[frame]:.0f} m/s, tilt {tilt:.1f}°")
        return list(cores.values())

    show(0)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the layout is the same in all frames, and solving it takes most of the time
    return FuncAnimation(figure, show, frames=FRAMES, interval=1e3 / _PER_SECOND)


def save_animation(dataset: xarray.Dataset, path: Path) -> None:
    """Write the film of a history in the format that its name asks for (`writer_for`)."""
    animation(dataset).save(path, writer=writer_for(path), dpi=80)


def writer_for(path: Path) -> AbstractMovieWriter:
    """The writer for the format that the name of a film asks for.

    Raises:
        OutputError: the name ends neither in .gif nor in .mp4, or FFmpeg is missing for an MP4.
    """
    match path.suffix.lower():
        case ".gif":
            return PillowWriter(fps=_PER_SECOND)
        case ".mp4" if FFMpegWriter.isAvailable():
            return FFMpegWriter(fps=_PER_SECOND)
        case ".mp4":
            raise OutputError(f"{path}: an MP4 needs the program ffmpeg, which was not found; a GIF does not need it")
    raise OutputError(f"{path}: the name of a film must end in .gif or .mp4")


def _line_of_fire(dataset: xarray.Dataset) -> np.ndarray:
    obliquity, azimuth = (np.radians(float(dataset[name])) for name in (v.OBLIQUITY, v.AZIMUTH))
    return np.array([np.cos(obliquity), np.sin(obliquity) * np.cos(azimuth), np.sin(obliquity) * np.sin(azimuth)])


def _draw_share(axes: Axes, dataset: xarray.Dataset, snapshot: int) -> AxesImage:
    """Draw the share of its initial resistance that each cell of the plate has at a snapshot."""
    share = dataset[v.RESISTANCE_SHARE].values
    left = np.where(share[0] >= 0.5, share[snapshot] / np.maximum(share[0], 0.5), np.nan)
    extent = (*_edges(dataset[v.CELL_Y].values), *_edges(dataset[v.CELL_Z].values))
    style: dict[str, Any] = {"cmap": "viridis", "vmin": 0.0, "vmax": 1.0, "interpolation": "nearest"}
    return axes.imshow(left.T, origin="lower", extent=extent, **style)


def weakened_ranges(dataset: xarray.Dataset) -> list[tuple[float, float]]:
    """Ranges along y and z [mm] that the core weakened, with a margin; the whole window if it weakened nothing."""
    share, ranges = dataset[v.RESISTANCE_SHARE].values, []
    weaker = share[-1] < share[0]
    for axis, name in enumerate((v.CELL_Y, v.CELL_Z)):
        cells = dataset[name].values
        low, high = _edges(cells)
        there = cells[weaker.any(axis=1 - axis)] * MM
        inside = (max(low, there.min() - _ROOM_ABOUT), min(high, there.max() + _ROOM_ABOUT)) if there.size else None
        ranges.append(inside or (low, high))
    return ranges


def _edges(cells: NDArray[np.float64]) -> tuple[float, float]:
    """Outer edges of evenly spaced cells [mm]."""
    half = 0.5 * (cells[1] - cells[0])
    return float((cells[0] - half) * MM), float((cells[-1] + half) * MM)
