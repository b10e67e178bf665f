"""What figures share: colours, title and notes, the direction of fire, and the bars of an interval."""

from __future__ import annotations

import math
from base64 import b64encode
from collections.abc import Sequence
from io import BytesIO
from textwrap import wrap
from typing import Any, NamedTuple

import numpy as np
import xarray
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.font_manager import FontProperties
from matplotlib.patheffects import withStroke

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.scene.model import Array

BLUE, VERMILION, GREEN = "#0072B2", "#D55E00", "#009E73"
"""Colours of Okabe and Ito: they differ in every kind of colour blindness."""
GREY = "0.55"
MAP_SIDE = 4.2
"""Longer side of a map on paper [inch]."""
_FROM_EDGE = 0.12
"""Distance of title and notes from the edge of a figure without layout engine [inch]."""
_TITLE_SIZE, _SMALLEST_TITLE = 12.0, 9.0
"""Font sizes of a title [pt]: the usual one, and the smallest for a long title."""
_TITLE_LETTERS, _NOTE_LETTERS = 10.0, 15
"""Average number of letters in an inch of a title of the first size, and of a note."""
LINE = 0.15
"""Height of a line of a note [inch]."""
_FIRE_LENGTH, _FIRE_CORNER = 30.0, (0.92, 0.08)
"""Length of the arrow [points], and the place of its head in the axes, as shares of their sides."""
_ONE_DIRECTION = 1e-3
"""Largest difference of angles that are one direction [rad]."""


def data_url(figure: Figure, dpi: int = 110) -> str:
    """A figure as a PNG picture in an address, for a page."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    return f"data:image/png;base64,{b64encode(buffer.getvalue()).decode()}"


def hide_sides(axes: Axes, *sides: str) -> None:
    """Hide sides of the frame of a panel: "top", "right", "left"."""
    for side in sides:
        axes.spines[side].set_visible(False)


def bars(value: float, low: float, high: float) -> list[list[float]] | None:
    """The two bars of an interval about a value, as `errorbar` takes them; None where there is no interval."""
    if math.isnan(low) or math.isnan(high):
        return None
    return [[max(0.0, value - low)], [max(0.0, high - value)]]


def all_bars(values: Array, low: Array, high: Array) -> Array:
    """The bars of many intervals, shape [2, points]; 0 where there is no interval."""
    return np.asarray(np.nan_to_num([values - low, high - values]).clip(0.0))


def add_heading(figure: Figure, title: str, *notes: str) -> None:
    """Write a title in one line at the top of a figure, and each note from a line of its own below the figure.

    A long title is written smaller. A title that is still wider than the figure is cut, and stands whole before the
    notes.
    """
    line, size = _in_one_line(title, figure.get_figwidth())
    placed = figure.get_layout_engine() is None
    top = {"y": 1.0 - _FROM_EDGE / figure.get_figheight(), "va": "top"} if placed else {}
    figure.suptitle(line, fontsize=size, **top)
    lines = note_lines(figure.get_figwidth(), title, notes)
    if lines:
        _write_notes(figure, "\n".join(lines))


def inscribe(figure: Figure, dataset: xarray.Dataset, *notes: str, title: str = "") -> None:
    """Write the title of a result, or another title, over a figure; below it the notes and the names of the
    catalogue."""
    run_title = str(dataset.attrs.get(attr.TITLE, ""))
    add_heading(figure, title or run_title, *([run_title] if title else []), *notes, *names(dataset))


def inscribe_hit(figure: Figure, history: xarray.Dataset, what: str) -> None:
    """Write the number of a replayed hit and what is shown of it over a figure, its result's title and names below."""
    inscribe(figure, history, title=f"hit {history.attrs[attr.HIT]}: {what}")


def legend_below(figure: Figure, columns: int | None = None) -> None:
    """Add one legend of all panels, each label once, below a figure with a layout engine; in one row without a number
    of columns. Notes of the figure become its title, because nothing else keeps both apart."""
    entries: dict[str, Artist] = {}
    for axes in figure.axes:
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    columns = columns or len(entries)
    figure.legend(entries.values(), entries, loc="outside lower center", ncols=columns, frameon=False)
    if notes := figure.get_supxlabel():
        figure.supxlabel("")
        _write_notes(figure, notes)


def note_lines(width: float, title: str, notes: Sequence[str]) -> list[str]:
    """Lines of the notes below a figure of this width [inch]."""
    cut = [title] if _in_one_line(title, width)[0] != title else []
    return [line for note in [*cut, *notes] for line in wrap(note, int(_NOTE_LETTERS * width))]


def names(dataset: xarray.Dataset) -> list[str]:
    """A line for each name of the catalogue that a result has, with how well it is known."""
    return list(dataset.attrs.get(attr.CATALOGUE_NAMES, "").splitlines())


def _in_one_line(title: str, width: float) -> tuple[str, float]:
    """A title that fits into a width [inch], and its font size [pt]."""
    line, letters = " ".join(title.split()), _TITLE_LETTERS * width
    size = max(_SMALLEST_TITLE, min(_TITLE_SIZE, _TITLE_SIZE * letters / max(len(line), 1)))
    most = int(letters * _TITLE_SIZE / size)
    return (line if len(line) <= most else line[: most - 1].rstrip() + "…"), size


def _write_notes(figure: Figure, text: str) -> None:
    """Write the notes below all else; over the legend where a layout engine has placed one there."""
    if figure.get_layout_engine() is None:
        place = {"y": _FROM_EDGE / figure.get_figheight(), "va": "bottom"}
        figure.supxlabel(text, fontsize="small", color="0.3", **place)
    elif figure.legends:
        (legend,) = figure.legends
        legend.set_title(text, prop=FontProperties(size="small"))
        legend.get_title().set_color("0.3")
    else:
        figure.supxlabel(text, fontsize="small", color="0.3")


def common_fire(dataset: xarray.Dataset) -> Fire | None:
    """The direction of fire of the shots of a result; None where they differ."""
    angles = [np.radians(np.asarray(dataset[name].values, dtype=float)) for name in (v.OBLIQUITY, v.AZIMUTH)]
    if any(np.ptp(angle) > _ONE_DIRECTION for angle in angles):
        return None
    return fire_of(float(angles[0].flat[0]), float(angles[1].flat[0]))


class Fire(NamedTuple):
    """Direction of flight in the plane of the plate, seen from behind it: unit vector (y, z), and words. Along the
    normal, shots fly at the reader, and `along` is (0, 0)."""

    along: tuple[float, float]
    text: str


def fire_of(obliquity: float, azimuth: float) -> Fire:
    """The direction of fire for a drawing; angles in radians."""
    if abs(math.sin(obliquity)) < _ONE_DIRECTION:
        return Fire((0.0, 0.0), "⊙ fire")
    sign = math.copysign(1.0, obliquity)
    along = sign * math.cos(azimuth), sign * math.sin(azimuth)
    return Fire(along, f"fire {math.degrees(abs(obliquity)):.3g}°")


def draw_fire(axes: Axes, fire: Fire) -> None:
    """Draw an arrow with its angle, or along the normal a point in a circle."""
    middle: dict[str, Any] = {"xy": _FIRE_CORNER, "xycoords": "axes fraction", "annotation_clip": False, "zorder": 6}
    outline = [withStroke(linewidth=2.5, foreground="white")]
    if fire.along == (0.0, 0.0):
        axes.annotate(fire.text, ha="center", va="center", fontsize="small", path_effects=outline, **middle)
        return
    tail = tuple(-_FIRE_LENGTH * np.array(fire.along))
    arrow = {"arrowstyle": "-|>", "color": "black", "linewidth": 1.5, "path_effects": outline}
    axes.annotate("", xytext=tail, textcoords="offset points", arrowprops=arrow, **middle)
    above: dict[str, Any] = {"xytext": (6.0, 9.0), "textcoords": "offset points", "ha": "right", "va": "bottom"}
    axes.annotate(fire.text, fontsize="small", path_effects=outline, **above, **middle)
