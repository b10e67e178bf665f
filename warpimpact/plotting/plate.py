"""Figures to scale of a plate, with its holes, unit cell, dimensions and the core's section, and of a core.

From behind, as in the maps, y is to the right and z up; from the front y is to the left.
"""

from collections.abc import Sequence
from itertools import combinations
from typing import Any

import numpy as np
import shapely
from matplotlib.axes import Axes
from matplotlib.colors import to_rgba
from matplotlib.patches import Circle, PathPatch, Rectangle
from matplotlib.path import Path

from warpimpact.analysis.effectiveness import plate_numbers
from warpimpact.plotting.style import BLUE, PURPLE, STEEL, VERMILION, Figure, Fire, draw_fire, finish, fire_of, in_style
from warpimpact.scene import Core, Impact, NoPattern, Plate, Target
from warpimpact.scene.model import Array
from warpimpact.scene.units import MM

_SIDE, _WIDEST, _NARROWEST = 4.2, 12.0, 5.5
"""Longer side of the plate, most width of both views and the section, and least width of a figure [inch]."""
_STATIONS = 2001
"""Stations of a section, and of the profile of a core."""
_UNIT_CELLS = 3
"""Unit cells of an unbounded plate along each side of a drawing."""
_NEAREST_HOLES = 40
"""Number of holes about the middle among which the smallest ligament is searched."""
_EQUALLY_SMALL = 1.01
"""Largest ratio of a ligament to the smallest one at which both count as equally small, because outlines are polygons.
The written length is the exact one of the plate."""
_FROM_SIDE, _FROM_BOTTOM = 0.1, 0.05
"""Distance of the dimensions of a hole from it, in periods."""
_BOX = {"boxstyle": "round,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.75}
"""Around a text on a drawing."""
_CORE_WIDTH = 7.5
"""Width of the figure of a core [inch]."""


@in_style
def plate_figure(
    plate: Plate | Target, core: Core | None = None, title: str = "", impact: Impact | None = None
) -> Figure:
    """Draw a target to one scale: from behind with its dimensions, in its section, and from the front.

    A finite plate is drawn as a whole, another one as three by three cells, with its numbers.

    Args:
        plate: the plate, or the target whose first layer it is.
        core: its largest section is drawn in the middle of the front.
        title: title of the figure.
        impact: its direction of fire is drawn.
    """
    target = plate if isinstance(plate, Target) else Target(layers=(plate,))
    plate, depth = target.layers[0], target.depth * MM
    extent = drawn_extent(plate, core) * MM
    widths = extent[0], depth, extent[0]
    inch = min(_SIDE / extent.max(), _WIDEST / sum(widths))  # per mm
    figure = Figure(figsize=(max(inch * sum(widths) + 1.6, _NARROWEST), inch * extent[1] + 1.3), layout="compressed")
    behind, section, front = figure.subplots(1, 3, sharey=True, width_ratios=widths)
    behind.add_patch(Rectangle((0, 0), 0, 0, facecolor=STEEL, edgecolor="black", label="material"))
    for axes, name in ((behind, "from behind"), (front, "from the front")):
        draw_plate(axes, plate, extent / 2)
        axes.set(xlabel="y [mm]")
        axes.set_title(name, fontsize="medium")
    behind.set_ylabel("z [mm]")
    front.invert_xaxis()
    if not isinstance(plate.pattern, NoPattern):
        y, z = MM * np.array(plate.pattern.period)
        style: dict[str, Any] = {"fill": False, "linewidth": 1.6, "edgecolor": BLUE, "linestyle": "--"}
        behind.add_patch(Rectangle((-y / 2, -z / 2), y, z, label="unit cell", **style))
    if core is not None:
        radius = core.max_radius * MM
        of_core = {"label": f"largest section of the core, \u2300 {2 * radius:.2f} mm", "edgecolor": VERMILION}
        front.add_patch(Circle((0.0, 0.0), radius, facecolor=to_rgba(VERMILION, 0.45), linewidth=1.5, **of_core))
    draw_dimensions(behind, plate)
    if impact is not None:
        along, text = fire_of(impact.obliquity, impact.azimuth)
        draw_fire(behind, Fire(along, text))
        draw_fire(front, Fire((-along[0], along[1]), text.replace("\u2299", "\u2297")))  # the core flies away
    _draw_section(section, target, extent[1] / 2)
    numbers = plate_numbers(plate.open_area, plate.ligament, target.weights)
    parts = (f"{name} {number}".replace(" ", "\u00a0") for name, number in numbers.items())  # no break within a part
    note = "all to one scale, dimensions in mm, smallest ligament in pink; maps of hits are seen from behind"
    return finish(figure, ", ".join(parts), note, title=title, legend=True, columns=2)


def drawn_extent(plate: Plate, core: Core | None) -> Array:
    """Drawn extent along y and z [m]; that of an unbounded plate is at least twice the core's diameter."""
    if plate.size is not None:
        return np.array(plate.size)
    least = 0.0 if core is None else 4.0 * core.max_radius
    return np.asarray(np.maximum(_UNIT_CELLS * np.array(plate.pattern.period), least))


@in_style
def draw_plate(axes: Axes, plate: Plate, half: Sequence[float] | Array) -> None:
    """Draw the part of a plate that reaches as far as `half` along y and z [mm]."""
    axes.set(xlim=(-half[0], half[0]), ylim=(-half[1], half[1]), aspect="equal", facecolor=STEEL)
    draw_holes(axes, plate)


def draw_holes(axes: Axes, plate: Plate, **style: Any) -> None:
    """Draw all holes within axes in mm as one patch, white by default; islands in a hole are left out of it."""
    outlines = plate.pattern.outlines(*(tuple(np.array(ends) / MM) for ends in (axes.get_xlim(), axes.get_ylim())))
    if outlines:
        path = Path.make_compound_path(*(Path(outline * MM, closed=True) for outline in outlines))
        drawn = {"facecolor": "white", "edgecolor": "black", "linewidth": 0.8, "label": "hole"} | style
        axes.add_patch(PathPatch(path, **drawn))


def _draw_section(axes: Axes, target: Target, up: float) -> None:
    """Draw the layers in the section y = 0, up to a height [mm], with the names of their materials."""
    z = np.linspace(-up, up, _STATIONS)
    text: dict[str, Any] = {"rotation": 90.0, "ha": "center", "va": "center", "fontsize": "small", "bbox": _BOX}
    for number, (place, layer) in enumerate(target.named):
        front, rear = target.faces[number] * MM
        at_y, at_z = (target.value(f"offset_{axis}", number) for axis in "yz")
        solid = layer.is_solid(np.array(-at_y), z / MM - at_z)
        axes.fill_betweenx(z, front, rear, where=solid, color=STEEL, step="mid")
        name = place if layer.material is None else f"{place}: {layer.material}"
        axes.text(0.5 * (front + rear), 0.0, f"{name}, {layer.thickness * MM:g} mm", **text)
    faces = np.unique(target.faces.round(6)) * MM
    axes.set(xlabel="x [mm]", aspect="equal", xlim=(0.0, faces[-1]), xticks=faces)
    axes.set_title("section y = 0", fontsize="medium")


Dimension = tuple[Array, Array, str]
"""Ends (y, z) [m] of a length, and its text [mm]."""


def hole_dimensions(plate: Plate, ligament: Dimension | None) -> list[Dimension]:
    """Width and height of the hole that is nearest to the middle, away from the smallest ligament, and the periods of
    the pattern."""
    if isinstance(plate.pattern, NoPattern) or not (holes := _holes(plate)):
        return []
    low_y, low_z, high_y, high_z = holes[0].bounds
    period_y, period_z = plate.pattern.period
    on_the_right = ligament is not None and ligament[0][0] + ligament[1][0] < 0.0  # where the ligament is not
    upright = high_y + _FROM_SIDE * period_y if on_the_right else low_y - _FROM_SIDE * period_y
    below, corner = low_z - _FROM_BOTTOM * period_z, (-period_y / 2, period_z / 2)
    ends = (
        ((low_y, below), (high_y, below)),
        ((upright, low_z), (upright, high_z)),
        (corner, (period_y / 2, period_z / 2)),
        ((-period_y / 2, -period_z / 2), corner),
    )
    return [(start, end, f"{MM * np.linalg.norm(end - start):.3g}") for start, end in map(np.array, ends)]


def smallest_ligament(plate: Plate) -> Dimension | None:
    """The smallest ligament between two holes that lies nearest to the middle; None if there is none."""
    pairs = list(combinations(_holes(plate), 2))
    lengths = np.array([first.distance(other) for first, other in pairs])
    if not pairs or not lengths.min() > 0.0:
        return None
    small = np.flatnonzero(lengths <= _EQUALLY_SMALL * lengths.min())
    lines = [shapely.shortest_line(*pairs[place]) for place in small]
    line = min(lines, key=lambda line: line.distance(shapely.Point(0.0, 0.0)))
    start, end = np.asarray(line.coords)
    length = plate.ligament if lengths.min() <= _EQUALLY_SMALL * plate.ligament else line.length
    return start, end, f"{MM * length:.3g}"


def _holes(plate: Plate) -> list[shapely.Polygon]:
    """Holes within the rim, the nearest to the middle first."""
    cell = np.array(plate.pattern.period)
    reach = 1.5 * cell if plate.size is None else np.minimum(1.5 * cell, 0.5 * np.array(plate.size))
    outlines = plate.pattern.outlines((-reach[0], reach[0]), (-reach[1], reach[1]))
    holes = [shapely.Polygon(outline) for outline in outlines if len(outline) > 3]
    return sorted(holes, key=lambda hole: hole.centroid.distance(shapely.Point(0.0, 0.0)))[:_NEAREST_HOLES]


def draw_dimensions(axes: Axes, plate: Plate) -> None:
    """Draw the dimensions on axes in mm, each a line with arrows and its length [mm] beside the middle."""
    ligament = smallest_ligament(plate)
    coloured = [(dimension, BLUE) for dimension in hole_dimensions(plate, ligament)]
    left = -0.49 * plate.pattern.period[0]
    text: dict[str, Any] = {"textcoords": "offset points", "fontsize": "small", "zorder": 6, "bbox": _BOX}
    for (start, end, length), colour in [*coloured, *([] if ligament is None else [(ligament, PURPLE)])]:
        arrow = {"arrowstyle": "<->", "color": colour, "linewidth": 1.2, "shrinkA": 0.0, "shrinkB": 0.0}
        axes.annotate("", tuple(end * MM), tuple(start * MM), arrowprops=arrow, zorder=5)
        offset, ha, va = (0.0, 3.0), "center", "bottom"
        if abs(end[1] - start[1]) > abs(end[0] - start[0]):
            offset, ha, va = ((-4.0, 0.0), "right", "center") if start[0] < left else ((4.0, 0.0), "left", "center")
        axes.annotate(length, tuple(0.5 * (start + end) * MM), offset, ha=ha, va=va, color=colour, **text)


@in_style
def core_figure(core: Core, title: str, evidence: str) -> Figure:
    """Draw a core in its section, nose to the left, with its evidence below."""
    s = np.linspace(0.0, core.length, _STATIONS)
    r, properties = core.radius(s), core.mass_properties
    height = 0.95 * _CORE_WIDTH * 2.0 * core.max_radius / core.length + 0.7
    figure = Figure(figsize=(_CORE_WIDTH, height), layout="compressed")
    axes = figure.subplots()
    axes.fill_between(s * MM, -r * MM, r * MM, facecolor="0.8", edgecolor="black", linewidth=1.0)
    centre = properties.centre_of_mass * MM, 0.0
    axes.plot(*centre, "+", color=VERMILION, ms=12, mew=2)
    axes.annotate("centre of mass", centre, (10.0, 0.0), textcoords="offset points", va="center")
    axes.set(aspect="equal", xlabel="behind the nose [mm]", ylabel="radius [mm]")
    numbers = f"{core.length * MM:.4g} mm, \u2300 {2 * core.max_radius * MM:.4g} mm, {properties.mass * 1e3:.4g} g"
    return finish(figure, evidence, title=f"{title}: {numbers}")
