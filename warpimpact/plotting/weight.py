"""Figure of targets against their weight: the load on the base behind the plate, beside the solid reference of the same
weight."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from warpimpact.analysis.comparison import Comparison
from warpimpact.analysis.contestants import Contestant
from warpimpact.analysis.effectiveness import Score, depth_note
from warpimpact.plotting.style import BLUE, GREY, VERMILION, add_heading, bars, hide_sides, legend_below

_MARKERS = {
    "mean": ("mean, or share", "o", BLUE),
    "share": ("mean, or share", "o", BLUE),
    "worst_tenth": ("worst tenth", "s", VERMILION),
    "worst_point": ("worst hit", "x", "#000000"),
}
_AGAINST_WEIGHT = ("base_perforated", "base_depth", "limit_velocity")
_THICKNESS, _NEEDED = "limit_thickness", "limit_areal_density"


def weight_figure(comparison: Comparison) -> Figure | None:
    """Measures of the base, or limits, against the areal density of the whole target, with their 95 % intervals; None
    if the plates have none of them.

    A limit thickness is drawn at the areal density that the target then has. A hollow diamond is the solid reference of
    the same areal density; a line is the need of a target with it."""
    known = {score.measure.name for score in comparison.plates[0].measures if score.measure.kind in ("mean", "share")}
    wanted = [name for name in (*_AGAINST_WEIGHT, _THICKNESS) if name in known]
    if _NEEDED not in known:
        wanted = [name for name in wanted if name != _THICKNESS]
    if not wanted:
        return None
    figure = Figure(figsize=(1.2 + 5.2 * len(wanted), 5.4), layout="constrained")
    for axes, name in zip(figure.subplots(1, len(wanted), squeeze=False)[0], wanted, strict=True):
        (_draw_needed if name == _THICKNESS else _draw_against_weight)(axes, comparison, name)
    legend_below(figure, 4)
    add_heading(figure, "Targets against their weight; 95 % intervals", *_solid_plates(comparison))
    return figure


def _solid_plates(comparison: Comparison) -> list[str]:
    """Descriptions of the solid plates, a line for each material."""
    solids = [plate.solid.partition(" mm of ") for plate in comparison.plates if plate.solid]
    thicknesses = {
        material: ", ".join(thickness for thickness, _, of in solids if of == material) for _, _, material in solids
    }
    return [f"{comparison.reference}s: {thickness} mm of {material}" for material, thickness in thicknesses.items()]


def _draw_against_weight(axes: Axes, comparison: Comparison, name: str) -> None:
    """One effect of every target, over its areal density."""
    middle = _middle([plate.areal_density for plate in comparison.plates])
    places: dict[tuple[str, str], list[tuple[Contestant, float]]] = {}  # plates that a figure shows at one place
    for plate in comparison.plates:
        scores = _scores(plate, name)
        for kind, score in scores.items():
            _draw_point(axes, plate.areal_density, score, _MARKERS[kind])
        first = next(iter(scores.values()))
        if not math.isnan(first.solid):
            solid: dict[str, Any] = {"color": GREY, "fillstyle": "none", "markersize": 11.0, "linestyle": "none"}
            axes.plot(plate.areal_density, first.solid, "D", label=f"{plate.reference} of the same weight", **solid)
        places.setdefault((f"{plate.areal_density:.3g}", f"{first.value:.2g}"), []).append((plate, first.value))
    for alike in places.values():
        plate, value = alike[0]
        _name(axes, ", ".join(plate.name for plate, _ in alike), (plate.areal_density, value), middle)
    _furnish(axes, _first(comparison.plates[0], name), "areal density of the whole target [kg/m²]")
    if name == "base_depth" and any(depth_note(plate.measures) for plate in comparison.plates):
        axes.set_title("lower bounds: cores pierce a base, and count with its thickness", fontsize="medium", loc="left")


def _draw_needed(axes: Axes, comparison: Comparison, name: str) -> None:
    """Draw the limit thickness over the resulting areal density of the target, and the need of a solid plate."""
    middle = _middle([_first(plate, _NEEDED).value for plate in comparison.plates])
    for plate in comparison.plates:
        densities = _scores(plate, _NEEDED)
        for kind, score in _scores(plate, name).items():
            if (density := densities.get(kind)) is not None:
                across = None if math.isnan(density.low) else (density.low, density.high)
                _draw_point(axes, density.value, score, _MARKERS[kind], across)
        _name(axes, plate.name, (_first(plate, _NEEDED).value, _first(plate, name).value), middle)
    needed = {_first(plate, _NEEDED).solid for plate in comparison.plates}
    for solid in filter(math.isfinite, needed):
        axes.axvline(solid, color=GREY, linestyle="--", label=f"what the {comparison.reference} needs")
    _furnish(axes, _first(comparison.plates[0], name), "areal density that the target needs [kg/m²]")


def _scores(plate: Contestant, name: str) -> dict[str, Score]:
    """The scores of a plate in a quantity, by the kinds of measures that have a style."""
    scores = {score.measure.kind: score for score in plate.measures if score.measure.name == name}
    return {kind: scores[kind] for kind in _MARKERS if kind in scores}


def _first(plate: Contestant, name: str) -> Score:
    """The mean, or the share."""
    return next(iter(_scores(plate, name).values()))


def _draw_point(
    axes: Axes,
    density: float,
    measure: Score,
    style: tuple[str, str, str],
    across: tuple[float, float] | None = None,
) -> None:
    """Draw a measure over an areal density, with its interval, and the interval of the density where it follows from
    one."""
    label, marker, colour = style
    ends = bars(measure.value, measure.low, measure.high)
    beside = None if across is None else bars(density, *across)
    point: dict[str, Any] = {"color": colour, "markersize": 6.5, "capsize": 3.0, "zorder": 3}
    axes.errorbar(density, measure.value, yerr=ends, xerr=beside, fmt=marker, label=label, **point)


def _middle(densities: Sequence[float]) -> float:
    return 0.5 * (min(densities) + max(densities))


def _name(axes: Axes, name: str, place: tuple[float, float], middle: float) -> None:
    """The name of a target beside its point, towards the middle of the figure."""
    left = place[0] <= middle
    side, ha = (7, "left") if left else (-7, "right")
    axes.annotate(name, place, xytext=(side, 6), textcoords="offset points", ha=ha, fontsize="small")


def _furnish(axes: Axes, score: Score, label: str) -> None:
    axes.set(xlabel=label, ylabel=score.measure.axis)
    axes.set_title(score.measure.better, fontsize="medium", loc="left")
    if score.measure.most == 1.0:
        axes.set_ylim(-0.04, 1.04)
    axes.grid(color="0.92")
    axes.margins(x=0.18)
    axes.ticklabel_format(axis="both", useOffset=False)
    hide_sides(axes, "top", "right")
