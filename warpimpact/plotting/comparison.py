"""Figures of a comparison: measures and differences of plates with intervals, and targets against their weight."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby
from textwrap import fill
from typing import Any

from matplotlib.axes import Axes
from matplotlib.layout_engine import ConstrainedLayoutEngine

from warpimpact.analysis.comparison_text import (
    Comparison,
    Difference,
    PlateScore,
    deciding,
    from_best,
    hits_used,
    is_ranked,
)
from warpimpact.analysis.effectiveness import Score, depth_note
from warpimpact.analysis.plate_text import weights_text
from warpimpact.plotting.style import BLUE, GREY, VERMILION, Figure, bars, finish, hide_sides, in_style

# Markers differ for a print in grey.
_AVERAGE = ("mean, or share", "o", BLUE, -0.12)
_STYLES = {  # by the kind of a measure; the last number is the distance from the line of its plate
    **dict.fromkeys(("mean", "share", "probability", "target"), _AVERAGE),
    "quantile": ("quantile", "v", BLUE, 0.0),
    "worst_tenth": ("worst tenth", "s", VERMILION, 0.12),
    "worst_point": ("worst hit", "x", "#000000", 0.12),
}
_WEIGHED = ("mean", "share", "worst_tenth", "worst_point")
"""Kinds of measures that are drawn against the weight."""
_AGAINST_WEIGHT = ("base_perforated", "base_depth", "limit_velocity")
_THICKNESS, _NEEDED = "limit_thickness", "limit_areal_density"
_WIDE = 40
"""Most characters in a line of the weights of a plate."""
_ROW, _MARGIN, _LINE = 0.42, 0.75, 0.15
"""Height of a row, of the margin of a panel, and of a line of the label of a row [inch]."""


@in_style
def comparison_figure(comparison: Comparison, *, every: bool = False) -> Figure:
    """The deciding measure: its value for every plate on the left, and the differences from the best plate on the
    right, with intervals.

    A hollow marker means that the interval of a difference contains 0: the plates cannot be told apart.

    Args:
        every: whether to draw every measure, and the differences of all pairs.
    """
    decides = deciding(comparison)
    quantities = [list(measures) for _, measures in groupby(comparison.plates[0].measures, key=_quantity)]
    if decides is not None and not every:
        quantities = [measures for measures in quantities if _quantity(measures[0]) == _quantity(decides)]
    differences = [
        list(comparison.differences) if every or decides is None else _from_best(comparison, measures)
        for measures in quantities
    ]
    pairs = max((len({(pair.one, pair.other) for pair in shown}) for shown in differences), default=0)
    labels = [f"{plate.name}\n{fill(weights_text(plate.weights), _WIDE)}" for plate in comparison.plates]
    label_height = _LINE * (1 + max(label.count("\n") + 1 for label in labels))
    heights = [
        _MARGIN + max(len(labels) * max(row, label_height), pairs * row)
        for row in (_ROW * (1.5 if len(measures) > 1 else 1.0) for measures in quantities)
    ]
    figure = Figure(figsize=(12.0, sum(heights)), layout=ConstrainedLayoutEngine(h_pad=0.12))
    panels = figure.subplots(len(quantities), 2, squeeze=False, height_ratios=heights)
    for measures, shown, (left, right) in zip(quantities, differences, panels, strict=True):
        _draw_plates(left, comparison, measures)
        _furnish(left, labels)
        _draw_differences(right, comparison, measures, shown)
    title = "Plates compared" if decides is None or every else f"Plates by {decides.measure.label}"
    notes = "95 % intervals; hollow marker: cannot be told apart", *hits_used(comparison)
    finish(figure, *notes, title=title, legend=True, columns=4)
    return figure


def _from_best(comparison: Comparison, measures: Sequence[Score]) -> list[Difference]:
    """Differences from the best plate in each of these measures that ranks plates."""
    names = [measure.name for measure in measures if is_ranked(comparison, measure.name)]
    return [pair for name in names for pair in from_best(comparison, name)]


def _quantity(score: Score) -> tuple[str, bool]:
    """Key of the panel of a measure: its quantity, and whether it is a share."""
    return score.measure.name, score.measure.is_binary


def _draw_plates(axes: Axes, comparison: Comparison, measures: Sequence[Score]) -> None:
    """Draw the measures of one quantity, a line per plate."""
    for line, plate in enumerate(comparison.plates):
        for alike in (measure for measure in plate.measures if _quantity(measure) == _quantity(measures[0])):
            label, marker, colour, offset = _STYLES[alike.measure.kind]
            _draw_interval(axes, line + offset, alike, (marker, colour), label=label)
            if alike.name == measures[0].name and not math.isnan(alike.solid):
                axes.plot(
                    alike.solid,
                    line + offset,
                    "D",
                    color=GREY,
                    fillstyle="none",
                    markersize=10.0,
                    label=f"{comparison.reference} of equal weight",
                )
    measure = measures[0].measure
    axes.set_title(f"{measure.axis}; {measure.better}", fontsize="medium", loc="left")


def _draw_differences(
    axes: Axes, comparison: Comparison, measures: Sequence[Score], differences: Sequence[Difference]
) -> None:
    """Draw the differences in one quantity, a line per pair of plates."""
    names = {measure.name: measure for measure in measures}
    lines: dict[tuple[str, str], int] = {}
    for pair in differences:
        if pair.measure in names:
            line = lines.setdefault((pair.one, pair.other), len(lines))
            _, marker, colour, offset = _STYLES[names[pair.measure].measure.kind]
            hollow = not pair.is_significant
            _draw_interval(axes, line + offset, pair, (marker, colour), hollow=hollow)
    if not lines:
        axes.set_axis_off()
        axes.set_title("not ranked", fontsize="medium", loc="left")
        return
    axes.axvline(0.0, color=GREY, linewidth=1.0)
    _furnish(axes, [f"{first} − {other}" for first, other in lines])
    by_ratio = measures[0].name in (comparison.at_equal_weight or ())
    difference = f"difference of the ratios to the {comparison.reference}s;\n" if by_ratio else "difference; "
    better = measures[0].measure.higher_is_better
    side = "neither is" if better is None else f"{'right' if better else 'left'} of 0 the first plate is"
    axes.set_title(f"{difference}{side} better", fontsize="medium", loc="left")


def _draw_interval(
    axes: Axes,
    line: float,
    number: Score | Difference,
    style: tuple[str, str],
    *,
    label: str | None = None,
    hollow: bool = False,
) -> None:
    """Draw a number with its interval."""
    value, (marker, colour) = number.value, style
    axes.errorbar(
        value,
        line,
        xerr=bars(value, number.low, number.high),
        fmt=marker,
        color=colour,
        markerfacecolor="white" if hollow else colour,
        markersize=6.5,
        capsize=3.0,
        label=label,
        zorder=3,
    )


def _furnish(axes: Axes, lines: Sequence[str]) -> None:
    axes.set_yticks(range(len(lines)), lines, fontsize="small")
    axes.set_ylim(len(lines) - 0.5, -0.5)
    axes.grid(axis="x", color="0.9")
    axes.margins(x=0.08)
    axes.locator_params(axis="x", nbins=5)
    axes.ticklabel_format(axis="x", useOffset=False)
    hide_sides(axes, "top", "right", "left")
    axes.tick_params(axis="y", length=0.0)


@in_style
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
    title = "Targets against their weight; 95 % intervals"
    finish(figure, *_solid_plates(comparison), title=title, legend=True, columns=4)
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
    places: dict[tuple[str, str], list[tuple[PlateScore, float]]] = {}  # plates that a figure shows at one place
    for plate in comparison.plates:
        scores = _scores(plate, name)
        for kind, score in scores.items():
            _draw_point(axes, plate.areal_density, score, _STYLES[kind])
        first = next(iter(scores.values()))
        if not math.isnan(first.solid):
            solid: dict[str, Any] = {"color": GREY, "fillstyle": "none", "markersize": 11.0, "linestyle": "none"}
            axes.plot(plate.areal_density, first.solid, "D", label=f"{plate.reference} of the same weight", **solid)
        places.setdefault((f"{plate.areal_density:.3g}", f"{first.value:.2g}"), []).append((plate, first.value))
    for alike in places.values():
        plate, value = alike[0]
        _name(axes, ", ".join(plate.name for plate, _ in alike), (plate.areal_density, value), middle)
    _furnish_weight(axes, _first(comparison.plates[0], name), "areal density of the whole target [kg/m²]")
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
                _draw_point(axes, density.value, score, _STYLES[kind], across)
        _name(axes, plate.name, (_first(plate, _NEEDED).value, _first(plate, name).value), middle)
    needed = {_first(plate, _NEEDED).solid for plate in comparison.plates}
    for solid in filter(math.isfinite, needed):
        axes.axvline(solid, color=GREY, linestyle="--", label=f"what the {comparison.reference} needs")
    _furnish_weight(axes, _first(comparison.plates[0], name), "areal density that the target needs [kg/m²]")


def _scores(plate: PlateScore, name: str) -> dict[str, Score]:
    """The scores of a plate in a quantity, by the kinds of measures that have a style."""
    scores = {score.measure.kind: score for score in plate.measures if score.measure.name == name}
    return {kind: scores[kind] for kind in _WEIGHED if kind in scores}


def _first(plate: PlateScore, name: str) -> Score:
    """The mean, or the share."""
    return next(iter(_scores(plate, name).values()))


def _draw_point(
    axes: Axes,
    density: float,
    measure: Score,
    style: tuple[str, str, str, float],
    across: tuple[float, float] | None = None,
) -> None:
    """Draw a measure over an areal density, with its interval, and the interval of the density where it follows from
    one."""
    label, marker, colour, _ = style
    ends = bars(measure.value, measure.low, measure.high)
    horizontal = None if across is None else bars(density, *across)
    point: dict[str, Any] = {"color": colour, "markersize": 6.5, "capsize": 3.0, "zorder": 3}
    axes.errorbar(density, measure.value, yerr=ends, xerr=horizontal, fmt=marker, label=label, **point)


def _middle(densities: Sequence[float]) -> float:
    return 0.5 * (min(densities) + max(densities))


def _name(axes: Axes, name: str, place: tuple[float, float], middle: float) -> None:
    """The name of a target beside its point, towards the middle of the figure."""
    left = place[0] <= middle
    side, ha = (7, "left") if left else (-7, "right")
    axes.annotate(name, place, xytext=(side, 6), textcoords="offset points", ha=ha, fontsize="small")


def _furnish_weight(axes: Axes, score: Score, label: str) -> None:
    axes.set(xlabel=label, ylabel=score.measure.axis)
    axes.set_title(score.measure.better, fontsize="medium", loc="left")
    if score.measure.most == 1.0:
        axes.set_ylim(-0.04, 1.04)
    axes.grid(color="0.92")
    axes.margins(x=0.18)
    axes.ticklabel_format(axis="both", useOffset=False)
    hide_sides(axes, "top", "right")
