"""Film of one hit: the core passes through the plate, in the two views of `plotting.trajectory`."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import xarray
from matplotlib.animation import AbstractMovieWriter, FFMpegWriter, FuncAnimation, PillowWriter
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.patches import Polygon

from warpimpact.plotting.poses import Pose, pose_at_step, silhouette
from warpimpact.plotting.trajectory import two_views
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.files import OutputError

FRAMES = 50
_PER_SECOND = 20
_MM, _US = 1e3, 1e6


def animation(dataset: xarray.Dataset) -> FuncAnimation:
    """Film of a history from the first contact to the end of contact, at constant time intervals.

    Between two steps position and axis are interpolated linearly.
    """
    times = np.linspace(float(dataset[v.TIME][0]), float(dataset[v.TIME][-1]), FRAMES)
    between = dataset[[v.PLATE_POSITION, v.CORE_AXIS, v.VELOCITY]].interp(time=times)
    every = (pose_at_step(between, frame) for frame in range(FRAMES))
    poses = [Pose(pose.position, pose.axis / np.linalg.norm(pose.axis)) for pose in every]
    speeds = np.linalg.norm(between[v.VELOCITY], axis=1)
    figure, panels = two_views(dataset, poses, "", room=4.0)
    FigureCanvasAgg(figure)
    cores = {view: Polygon(np.zeros((1, 2)), facecolor="0.55", edgecolor="black") for view in panels}
    for view, axes in panels.items():
        axes.add_patch(cores[view])
        axes.plot(*np.array([pose.position[[0, "xyz".index(view)]] for pose in poses]).T * _MM, "k--", lw=0.8)
    title = f"hit {dataset.attrs[attr.HIT]}"

    def show(frame: int) -> list[Polygon]:
        for view, core in cores.items():
            core.set_xy(silhouette(dataset, poses[frame], view) * _MM)
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
