"""Figures to scale of a plate, with its holes, unit cell, dimensions and the core's section, and of a core.

The view is that of the maps: against the line of fire, y to the right, z up.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from textwrap import fill
from typing import Any, NamedTuple

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, PathPatch, Rectangle
from matplotlib.path import Path

from warpimpact.analysis.plate_text import plate_numbers
from warpimpact.plotting.style import VERMILION, add_heading, draw_fire, fire_of, note_lines
from warpimpact.scene import Core, Impact, NoPattern, Plate, Target
from warpimpact.scene.display import MM
from warpimpact.scene.model import Array

_PLATE_SIDE = 5.0  # of the plate on paper [inch], without axes, title and legend
_ROOM_ACROSS, _BELOW, _ABOVE = 1.5, 1.7, 0.85
_NARROWEST = 6.0
_SECTION = 4.2  # of a target on paper [inch]
_FIGURE_SECTION = 2001
_STEEL = "0.72"
_UNIT_CELLS = 3
"""Unit cells of an unbounded plate along each side of a drawing."""
_NEAREST_HOLES = 40
"""Number of holes about the middle among which the smallest ligament is searched."""
_EQUALLY_SMALL = 1.01
"""Largest ratio of a ligament to the smallest one at which both count as equally small, because outlines are polygons.
The written length is the exact one of the plate."""
_BESIDE_HOLE, _BELOW_HOLE = 0.1, 0.05
"""Distance of the dimensions of a hole from it, in periods."""
_DIMENSION_COLOUR = "#0072B2"
_LIGAMENT_COLOUR = "#CC79A7"
_PROFILE_STATIONS, _CORE_WIDTH = 801, 7.5
"""Stations of the drawn profile of a core, and width of its figure [inch]."""


def plate_figure(
    plate: Plate | Target, core: Core | None = None, title: str = "", impact: Impact | None = None
) -> Figure:
    """Draw a finite plate as a whole, another one as three by three cells, with its numbers; beside it a section of the
    target, if layers stand behind the plate.

    Args:
        plate: the plate, or the target whose first layer it is.
        core: its largest section is drawn in the middle of the plate.
        title: title of the figure.
        impact: its direction of fire is drawn.
    """
    target = plate if isinstance(plate, Target) else Target(layers=(plate,))
    plate, layered = target.layers[0], len(target.layers) > 1
    figure, axes = _sheet(drawn_extent(plate, core) * MM, beside=_SECTION if layered else 0.0)
    if layered:
        _draw_section(figure, axes, target)
    patches = [*hole_patches(plate, axes), *_frames(plate), *([] if core is None else [_section(core)])]
    for patch in patches:
        axes.add_patch(patch)
    draw_dimensions(axes, plate)
    if impact is not None:
        draw_fire(axes, fire_of(impact.obliquity, impact.azimuth))
    steel = Patch(facecolor=_STEEL, edgecolor="black", label=f"plate, {plate.thickness * MM:g} mm thick")
    numbers = plate_numbers(plate.open_area, plate.ligament, target.weights)
    parts = (f"{name} {number}".replace(" ", "\u00a0") for name, number in numbers.items())  # no break within a part
    axes.set_title(fill(", ".join(parts), 70), fontsize="medium")
    inch = 1.0 / figure.get_figheight()
    add_heading(figure, title)
    figure.legend(
        handles=[steel, *patches],
        loc="lower center",
        bbox_to_anchor=(0.5, 0.35 * inch),
        ncols=2,
        frameon=False,
    )
    note = "to scale, dimensions in mm, smallest ligament in pink; seen from behind the plate"
    figure.supxlabel(note, y=0.12 * inch, va="bottom", fontsize="small", color="0.3")
    return figure


def drawn_extent(plate: Plate, core: Core | None) -> Array:
    """Drawn extent along y and z [m]; that of an unbounded plate is at least twice the core's diameter."""
    if plate.size is not None:
        return np.array(plate.size)
    least = 0.0 if core is None else 4.0 * core.max_radius
    return np.asarray(np.maximum(_UNIT_CELLS * np.array(plate.pattern.unit_cell), least))


def _draw_section(figure: Figure, plane: Axes, target: Target) -> None:
    """Draw the layers in the section y = 0, beside the plate and equally high; x and z have different scales."""
    width, place = figure.get_figwidth(), plane.get_position()
    box = (1.0 - (_SECTION - 0.3) / width, place.y0, (_SECTION - 0.6) / width, place.height)
    axes = figure.add_axes(box, sharey=plane, facecolor="white", xlabel="x [mm]")
    z = np.linspace(*plane.get_ylim(), _FIGURE_SECTION) / MM
    for number, (layer, (front, rear)) in enumerate(zip(target.layers, target.faces * MM, strict=True)):
        at_y, at_z = (target.value(f"offset_{axis}", number) for axis in "yz")
        solid = layer.is_solid(np.array(-at_y), z - at_z)
        axes.fill_betweenx(z * MM, front, rear, where=solid, color=_STEEL, step="mid")
        label = f"{'plate' if number == 0 else f'layer {number}'}, {layer.thickness * MM:g} mm"
        at, side, ha = (front, -3.0, "right") if number else (rear, 3.0, "left")
        style: dict[str, Any] = {"textcoords": "offset points", "rotation": 90.0, "ha": ha, "va": "center"}
        axes.annotate(label, (at, 0.0), (side, 0.0), fontsize="small", **style)
    axes.margins(x=0.08)
    axes.set_title("section at y = 0", fontsize="medium")
    axes.tick_params(labelleft=False)


def _sheet(extent: Array, beside: float) -> tuple[Figure, Axes]:
    """Figure with axes to scale, centred on the origin; extent in mm, and room beside it [inch]."""
    across, up = _PLATE_SIDE * extent / extent.max()
    width, height = max(across + _ROOM_ACROSS, _NARROWEST) + beside, up + _BELOW + _ABOVE
    figure = Figure(figsize=(width, height))
    axes = figure.add_axes(
        ((width - beside - across) / 2 / width, _BELOW / height, across / width, up / height),
        xlim=(-extent[0] / 2, extent[0] / 2),
        ylim=(-extent[1] / 2, extent[1] / 2),
        aspect="equal",
        facecolor=_STEEL,
        xlabel="y [mm]",
        ylabel="z [mm]",
    )
    return figure, axes


def hole_patches(plate: Plate, axes: Axes) -> list[Patch]:
    """All holes within the axes as one patch; islands in a hole stay steel."""
    ranges = (np.array(ends) / MM for ends in (axes.get_xlim(), axes.get_ylim()))
    outlines = plate.pattern.outlines(*((low, high) for low, high in ranges))
    if not outlines:
        return []
    path = Path.make_compound_path(*(Path(outline * MM, closed=True) for outline in outlines))
    return [PathPatch(path, facecolor="white", edgecolor="black", linewidth=0.8, label="hole")]


def _frames(plate: Plate) -> list[Patch]:
    """Unit cell and margin."""
    frames = []
    if not isinstance(plate.pattern, NoPattern):
        frames.append(_frame(plate.pattern.unit_cell, label="unit cell", edgecolor="#0072B2", linestyle="--"))
    if plate.size is not None and plate.margin is not None:
        inner = [side - 2.0 * plate.margin for side in plate.size]
        frames.append(_frame(inner, label=f"margin, {plate.margin * MM:g} mm", edgecolor="0.35", linestyle=":"))
    return frames


def _frame(extent: Sequence[float], **style: Any) -> Patch:
    """Rectangle of an extent [m], centred on the origin."""
    along_y, along_z = (side * MM for side in extent)
    return Rectangle((-along_y / 2, -along_z / 2), along_y, along_z, fill=False, linewidth=1.6, **style)


def _section(core: Core) -> Patch:
    """The largest section of the core, centred on the origin."""
    radius = core.max_radius * MM
    label = f"largest section of the core, \u2300 {2 * radius:.2f} mm"
    return Circle(
        (0.0, 0.0), radius, facecolor=to_rgba(VERMILION, 0.45), edgecolor=VERMILION, linewidth=1.5, label=label
    )


class Dimension(NamedTuple):
    """A length between two points (y, z) [m]. The text of an upright one stands on its right, or on its left."""

    start: Array
    end: Array
    text: str
    on_left: bool = False


def hole_dimensions(plate: Plate, ligament: Dimension | None) -> list[Dimension]:
    """Width and height of the hole that is nearest to the middle, away from the smallest ligament, and the periods of
    the pattern."""
    if isinstance(plate.pattern, NoPattern) or not (holes := _holes(plate)):
        return []
    low_y, low_z, high_y, high_z = holes[0].bounds
    period_y, period_z = plate.pattern.unit_cell
    on_the_right = ligament is not None and ligament.start[0] + ligament.end[0] < 0.0  # where the ligament is not
    beside = high_y + _BESIDE_HOLE * period_y if on_the_right else low_y - _BESIDE_HOLE * period_y
    below = low_z - _BELOW_HOLE * period_z
    return [
        _dimension((low_y, below), (high_y, below)),
        _dimension((beside, low_z), (beside, high_z)),
        _dimension((-period_y / 2, period_z / 2), (period_y / 2, period_z / 2)),
        _dimension((-period_y / 2, -period_z / 2), (-period_y / 2, period_z / 2))._replace(on_left=True),
    ]


def smallest_ligament(plate: Plate) -> Dimension | None:
    """The smallest ligament between two holes that lies nearest to the middle; None if there is none."""
    pairs = list(combinations(_holes(plate), 2))
    if not pairs:
        return None
    lengths = np.array([first.distance(other) for first, other in pairs])
    if not lengths.min() > 0.0:
        return None
    lines = [
        shapely.shortest_line(*pairs[place]) for place in np.flatnonzero(lengths <= _EQUALLY_SMALL * lengths.min())
    ]
    line = min(lines, key=lambda line: line.distance(shapely.Point(0.0, 0.0)))
    start, end = np.asarray(line.coords)
    smallest = plate.ligament
    return _dimension(start, end, smallest if lengths.min() <= _EQUALLY_SMALL * smallest else None)


def draw_dimensions(axes: Axes, plate: Plate) -> None:
    """Draw the dimensions on axes in mm."""
    ligament = smallest_ligament(plate)
    for dimension in hole_dimensions(plate, ligament):
        _draw_dimension(axes, dimension, _DIMENSION_COLOUR)
    if ligament is not None:
        _draw_dimension(axes, ligament, _LIGAMENT_COLOUR)


def _dimension(
    start: tuple[float, float] | Array, end: tuple[float, float] | Array, length: float | None = None
) -> Dimension:
    """A dimension; `length` [m] replaces the distance of its ends if it is known better."""
    start, end = np.asarray(start), np.asarray(end)
    return Dimension(start, end, f"{(float(np.linalg.norm(end - start)) if length is None else length) * MM:.3g}")


def _holes(plate: Plate) -> list[shapely.Polygon]:
    """Holes within the rim, the nearest to the middle first."""
    cell = np.array(plate.pattern.unit_cell)
    reach = 1.5 * cell if plate.size is None else np.minimum(1.5 * cell, 0.5 * np.array(plate.size))
    outlines = plate.pattern.outlines((-reach[0], reach[0]), (-reach[1], reach[1]))
    holes = [shapely.Polygon(outline) for outline in outlines if len(outline) > 3]
    return sorted(holes, key=lambda hole: hole.centroid.distance(shapely.Point(0.0, 0.0)))[:_NEAREST_HOLES]


def _draw_dimension(axes: Axes, dimension: Dimension, colour: str) -> None:
    """Draw a line with an arrow at each end, and its length [mm] beside the middle."""
    start, end = dimension.start * MM, dimension.end * MM
    style = {"arrowstyle": "<->", "color": colour, "linewidth": 1.2, "shrinkA": 0.0, "shrinkB": 0.0}
    axes.annotate("", tuple(end), tuple(start), arrowprops=style, zorder=5)
    along_z = abs(end[1] - start[1]) > abs(end[0] - start[0])
    middle = 0.5 * (start + end)
    axes.annotate(
        dimension.text,
        tuple(middle),
        ((-4.0, 0.0) if dimension.on_left else (4.0, 0.0)) if along_z else (0.0, 3.0),
        textcoords="offset points",
        ha=("right" if dimension.on_left else "left") if along_z else "center",
        va="center" if along_z else "bottom",
        color=colour,
        fontsize="small",
        zorder=6,
        bbox={"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.75},
    )


def core_figure(core: Core, title: str, evidence: str) -> Figure:
    """Draw a core in its section, nose to the left, with its evidence below."""
    lines = note_lines(_CORE_WIDTH, "", [evidence])
    s = np.linspace(0.0, core.length, _PROFILE_STATIONS)
    r = core.radius(s)
    height = 0.95 * _CORE_WIDTH * 2.0 * core.max_radius / core.length + 1.1 + 0.2 * len(lines)
    figure = Figure(figsize=(_CORE_WIDTH, height), layout="constrained")
    axes = figure.subplots()
    outline_s, outline_r = np.concatenate([s, s[::-1]]), np.concatenate([r, -r[::-1]])
    axes.fill(outline_s * MM, outline_r * MM, facecolor="0.8", edgecolor="black", linewidth=1.0)
    properties = core.mass_properties
    axes.plot(properties.centre_of_mass * MM, 0.0, "+", color=VERMILION, ms=12, mew=2)
    axes.annotate(
        "centre of mass", (properties.centre_of_mass * MM, 0.0), (10.0, 0.0), textcoords="offset points", va="center"
    )
    axes.set(aspect="equal", xlabel="behind the nose [mm]", ylabel="radius [mm]")
    numbers = f"{core.length * MM:.4g} mm, \u2300 {2 * core.max_radius * MM:.4g} mm, {properties.mass * 1e3:.4g} g"
    add_heading(figure, f"{title}: {numbers}", evidence)
    return figure
