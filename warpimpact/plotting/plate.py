"""Figure of a plate to scale: its holes, its unit cell, and the largest section of the core.

The view is that of the maps: against the line of fire, y to the right, z up.
"""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import fill
from typing import TYPE_CHECKING, Any

import numpy as np
from matplotlib.colors import to_rgba
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Patch, PathPatch, Rectangle
from matplotlib.path import Path

from warpimpact.analysis.plate_text import plate_numbers
from warpimpact.plotting.dimensions import draw_dimensions
from warpimpact.plotting.fire import draw_fire, fire_of
from warpimpact.plotting.heading import add_heading
from warpimpact.scene import NoPattern, Target
from warpimpact.scene.display import MM
from warpimpact.scene.notebook import UNIT_CELLS

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from numpy.typing import NDArray

    from warpimpact.scene import Core, Impact, Plate

_PLATE_SIDE = 5.0  # of the plate on paper [inch], without axes, title and legend
_ROOM_ACROSS, _BELOW, _ABOVE = 1.5, 1.7, 0.85
_NARROWEST = 6.0
_SECTION = 4.2  # of a target on paper [inch]
_FIGURE_SECTION = 2001
_STEEL, _CORE_COLOUR = "0.72", "#D55E00"


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


def drawn_extent(plate: Plate, core: Core | None) -> NDArray[np.float64]:
    """Drawn extent along y and z [m]; that of an unbounded plate is at least twice the core's diameter."""
    if plate.size is not None:
        return np.array(plate.size)
    least = 0.0 if core is None else 4.0 * core.max_radius
    return np.asarray(np.maximum(UNIT_CELLS * np.array(plate.pattern.unit_cell), least))


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


def _sheet(extent: NDArray[np.float64], beside: float) -> tuple[Figure, Axes]:
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
        (0.0, 0.0), radius, facecolor=to_rgba(_CORE_COLOUR, 0.45), edgecolor=_CORE_COLOUR, linewidth=1.5, label=label
    )
