"""What figures share: style, colours, title with notes and legend, the direction of fire, and the bars of an interval.

A function that draws is decorated with `in_style`, and its figure is a `Figure` of this module: both keep the settings
of a matplotlibrc out. `finish` is the last call on a figure.
"""

import math
from base64 import b64encode
from collections.abc import Callable, Sequence
from functools import wraps
from io import BytesIO
from itertools import cycle
from pathlib import Path
from textwrap import wrap
from typing import Any, Literal, NamedTuple, ParamSpec, TypeVar

import numpy as np
import xarray
from matplotlib import style
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.figure import Figure as PlainFigure
from matplotlib.patheffects import withStroke

from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.results.files import atomic_path
from warpimpact.scene.model import Array

_STYLE: Any = ["default", {"text.parse_math": False}]
"""The style of all figures: the defaults of Matplotlib, and "$" is a character of a title."""
PALETTE = ("#0072B2", "#D55E00", "#009E73", "#CC79A7", "#E69F00", "#56B4E9", "#000000")
"""Colours of Okabe and Ito: they differ in every kind of colour blindness."""
BLUE, VERMILION, GREEN, PURPLE, *_ = PALETTE
GREY = "0.55"
STEEL = "0.75"
_TITLE_LETTERS, _NOTE_LETTERS = 9.0, 15.0
"""Average number of letters in an inch of a title, and of a note."""
_TITLE_LINE, _NOTE_LINE, _LEGEND_LINE = 0.25, 0.15, 0.22
"""Height of a line of a title, of a note, and of a legend [inch]."""
_FIRE_LENGTH, _FIRE_CORNER = 30.0, (0.92, 0.08)
"""Length of the arrow [points], and the place of its end in the axes, as shares of their sides."""
_ONE_DIRECTION = 1e-3
"""Largest difference of angles that are one direction [rad]."""

P = ParamSpec("P")
T = TypeVar("T")


def in_style(draw: Callable[P, T]) -> Callable[P, T]:
    """Make a function draw in the style of this module, whatever a user's matplotlibrc says."""

    @wraps(draw)
    def drawn(*args: P.args, **kwargs: P.kwargs) -> T:
        with style.context(_STYLE):
            return draw(*args, **kwargs)

    return drawn


class Figure(PlainFigure):
    """A figure that is laid out, drawn and saved in the style of this module."""

    draw = in_style(PlainFigure.draw)
    draw_without_rendering = in_style(PlainFigure.draw_without_rendering)

    @in_style
    def savefig(self, fname: Any, **options: Any) -> None:
        """Save the figure; a file is written whole or not at all."""
        if not isinstance(fname, str | Path):
            super().savefig(fname, **options)
            return
        path = Path(fname)
        with atomic_path(path) as file:
            super().savefig(file, **{"format": path.suffix[1:].lower() or "png"} | options)

    def _repr_png_(self) -> bytes:
        """The figure in a notebook."""
        picture = BytesIO()
        self.savefig(picture, format="png")
        return picture.getvalue()


def sheet(
    count: int, columns: int, size: Sequence[float], layout: Literal["compressed", "constrained"] = "compressed"
) -> tuple[Figure, list[Axes]]:
    """A figure with a number of panels, row by row, each with its room of a size [inch]."""
    columns = min(columns, count)
    rows = -(-count // columns)
    figure = Figure(figsize=(columns * size[0], rows * size[1]), layout=layout)
    panels = list(figure.subplots(rows, columns, squeeze=False).flat)
    for axes in panels[count:]:
        axes.remove()
    return figure, panels[:count]


def data_url(figure: PlainFigure, dpi: int = 110) -> str:
    """A figure as a PNG picture in an address, for a page."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=dpi)
    return f"data:image/png;base64,{b64encode(buffer.getvalue()).decode()}"


def finish(
    figure: Figure,
    *notes: str,
    title: str = "",
    result: xarray.Dataset | None = None,
    legend: bool = False,
    columns: int | None = None,
) -> Figure:
    """Write title, notes and a shared legend outside all panels; return the figure.

    The figure grows by their height, so panels keep their size.

    Args:
        notes: below the panels, each on lines of its own.
        title: above the panels; by default the title of the result, which otherwise is the first note.
        result: its names of the catalogue, with how well each is known, are further notes.
        legend: whether the labels of all panels stand below the notes, each once.
        columns: of the legend; by default all entries stand in one row.
    """
    attributes, width = {} if result is None else result.attrs, figure.get_figwidth()
    of_result = str(attributes.get(attr.TITLE, ""))
    texts = [of_result if title else "", *notes, *attributes.get(attr.CATALOGUE_NAMES, "").splitlines()]
    lines = [line for text in texts for line in wrap(text, int(_NOTE_LETTERS * width))]
    heading = wrap(title or of_result, int(_TITLE_LETTERS * width))
    if heading:
        figure.suptitle("\n".join(heading))
    entries: dict[str, Artist] = {}
    for axes in figure.axes if legend else ():
        for handle, label in zip(*axes.get_legend_handles_labels(), strict=True):
            entries.setdefault(label, handle)
    columns = columns or max(1, len(entries))
    rows = -(-len(entries) // columns)
    height = figure.get_figheight() + _TITLE_LINE * len(heading) + _NOTE_LINE * len(lines) + _LEGEND_LINE * rows
    figure.set_figheight(height)
    if entries or lines:
        below = figure.legend(
            entries.values(), entries, loc="outside lower center", ncols=columns, frameon=False, title="\n".join(lines)
        )
        below.get_title().set(color="0.3", size="small", multialignment="center")
    return figure


def furnish(axes: Axes, *, along: Literal["x", "y", "both"] = "both", legend: bool = True, **labels: Any) -> None:
    """Set labels and limits of a panel; add grid lines, and a legend if anything has a label."""
    axes.set(**labels)
    axes.grid(axis=along, color="0.9")
    axes.set_axisbelow(True)
    if legend and axes.get_legend_handles_labels()[0]:
        axes.legend(fontsize="small", framealpha=0.9, edgecolor="none")


def distinct_marks(count: int) -> list[dict[str, Any]]:
    """Hollow marks of different shape and size, as `errorbar` takes them: none hides another one at the same place."""
    sizes = np.linspace(11.0, 5.0, count).tolist()
    return [
        {"marker": mark, "markersize": size, "capsize": size / 2, "fillstyle": "none"}
        for mark, size in zip(cycle("osD^v"), sizes, strict=False)
    ]


def bars(value: Any, low: Any, high: Any) -> Array | None:
    """The bars of intervals about values, as `errorbar` takes them; no bar where an end is NaN."""
    ends = np.maximum(0.0, [np.atleast_1d(value - low), np.atleast_1d(high - value)])
    return None if np.isnan(ends).all() else ends


class Fire(NamedTuple):
    """Direction of flight in the plane of the plate, seen from behind it: unit vector (y, z), and words. Along the
    normal, shots fly at the reader, and `along` is (0, 0)."""

    along: tuple[float, float]
    text: str


def common_fire(dataset: xarray.Dataset) -> Fire | None:
    """The direction of fire of the shots of a result; None where they differ."""
    angles = [np.radians(np.asarray(dataset[name].values, dtype=float)) for name in (v.OBLIQUITY, v.AZIMUTH)]
    if any(np.ptp(angle) > _ONE_DIRECTION for angle in angles):
        return None
    return fire_of(float(angles[0].flat[0]), float(angles[1].flat[0]))


def fire_of(obliquity: float, azimuth: float) -> Fire:
    """The direction of fire for a drawing; angles in radians."""
    if abs(math.sin(obliquity)) < _ONE_DIRECTION:
        return Fire((0.0, 0.0), "⊙ fire")
    sign = math.copysign(1.0, obliquity)
    return Fire((sign * math.cos(azimuth), sign * math.sin(azimuth)), f"fire {math.degrees(abs(obliquity)):.3g}°")


def draw_fire(axes: Axes, fire: Fire) -> None:
    """Draw an arrow with its angle, or along the normal a point in a circle."""
    corner: dict[str, Any] = {"xy": _FIRE_CORNER, "xycoords": "axes fraction", "annotation_clip": False, "zorder": 6}
    outline = [withStroke(linewidth=2.5, foreground="white")]
    text: dict[str, Any] = {"ha": "center", "va": "center"}
    if any(fire.along):
        text = {"xytext": (6.0, 9.0), "textcoords": "offset points", "ha": "right", "va": "bottom"}
        out = fire.along[0] >= fire.along[1]  # the head is nearer to the corner than the tail
        end = tuple((-_FIRE_LENGTH if out else _FIRE_LENGTH) * np.array(fire.along))
        arrow = {"arrowstyle": "-|>" if out else "<|-", "color": "black", "linewidth": 1.5, "path_effects": outline}
        axes.annotate("", xytext=end, textcoords="offset points", arrowprops=arrow, **corner)
    axes.annotate(fire.text, fontsize="small", path_effects=outline, **text, **corner)
