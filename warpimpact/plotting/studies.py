"""Figures of studies: limits, sweeps, sensitivity, firing tests, and posteriors."""

import json
from collections.abc import Sequence
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
import pandas as pd
import xarray
from matplotlib.axes import Axes
from scipy import special

from warpimpact.analysis.effectiveness import reference_name
from warpimpact.analysis.hit_map import hit_points
from warpimpact.firing.simulate import report_lines, tests_title
from warpimpact.firing.v50 import V50, Shots
from warpimpact.identification.fit import fit_from
from warpimpact.identification.identify import parameters_of
from warpimpact.measures.estimates import estimated, measures_named
from warpimpact.measures.measure import NAMES, Measure
from warpimpact.measures.references import Result, as_dataset, reference
from warpimpact.plotting.cell import draw_map, map_and_curve, map_field, words
from warpimpact.plotting.plate import draw_plate
from warpimpact.plotting.style import (
    BLUE,
    GREEN,
    GREY,
    PALETTE,
    VERMILION,
    Figure,
    bars,
    distinct_marks,
    finish,
    furnish,
    in_style,
    sheet,
)
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.scene.model import Array
from warpimpact.scene.units import MM, STORED, count_text
from warpimpact.studies.limit import UNITS, accuracy_line, inclination
from warpimpact.studies.sweep import SHOWN, inputs_of, sweep_table

_CURVE = {
    "velocity": ("impact velocity", "share of the cores that pass"),
    "thickness": ("thickness of {}", "share of the hits whose limit is thinner"),
}
_MOST_LINES = 12
"""Most lines in a panel of a sweep."""
_PANEL = (5.0, 3.75)
"""Width and height of a panel on paper [inch]."""
_ROW, _MEASURE, _CHANGES = 0.24, 2.6, 2.4
"""Of a sensitivity: height of a row, and widths of a panel and of the names of the changes [inch]."""
_VELOCITY = "impact velocity [m/s]"
_POINTS, _PRIOR_GREY = 600, "0.6"
"""Most draws of a posterior in a panel, and colour of its prior."""
_MOST_CELLS = 5.0
"""Most cells of holes that a figure shows on either side of the middle. A fit searches hits in the first."""


@in_style
def limit_figure(result: Result) -> Figure:
    """The map of the limits beside their cumulative distribution, with V50 and V05 and their 95 % intervals. For hits
    at one place, the limits against the obliquity."""
    dataset = as_dataset(result)
    if len(dataset[v.OBLIQUITY]) > 1 and not np.ptp(hit_points(dataset), axis=0).any():
        figure = Figure(figsize=(7.4, 4.6), layout="constrained")
        _draw_over_obliquity(figure.subplots(), result)
    else:
        column = map_field(dataset, v.LIMITS[dataset.attrs[attr.LIMIT]].value)
        column = column._replace(values=np.where(np.isinf(column.values), np.nan, column.values), title="")
        figure, (at, curve) = map_and_curve(dataset)
        figure.colorbar(draw_map(at, dataset, column), ax=at, label=column.label)
        _draw_curve(curve, result)
    return finish(figure, f"{count_text(dataset.sizes['hit'], 'hit')}, {accuracy_line(dataset)}", result=dataset)


def _draw_over_obliquity(axes: Axes, result: Result) -> None:
    """Draw the limits of hits at one place against the obliquity, beside the secant law through the least oblique hit.
    If all hits have one obliquity, draw them against the inclination of the core."""
    dataset = as_dataset(result)
    quantity = dataset.attrs[attr.LIMIT]
    unit, factor = UNITS[quantity]
    value, along = factor * dataset[v.LIMITS[quantity].value].values, dataset[v.OBLIQUITY].values
    across, first = "obliquity", int(np.argmin(along))
    if np.ptp(along) == 0.0:
        across, along = "between axis and line of fire on impact", np.degrees(inclination(dataset))
    elif np.isfinite(value[first]):
        angles = np.linspace(along.min(), along.max())
        growth = np.cos(np.radians(along[first])) / np.cos(np.radians(angles))
        law, label = (growth, "as 1/cos") if quantity == "velocity" else (1.0 / growth, "as cos")
        axes.plot(angles, value[first] * law, color="0.5", linewidth=1.0, label=f"{label}(obliquity)")
    axes.plot(along, value, "o", color=BLUE, label=f"limit {quantity}")
    if (of_solid := reference(result, "solid")) is not None:
        solid = np.broadcast_to(factor * of_solid[v.LIMITS[quantity].value].values, value.shape)
        axes.plot(along, solid, "D", color=GREY, fillstyle="none", label=_solid_label(result))
    furnish(axes, xlabel=f"{across} [°]", ylabel=f"limit {quantity} [{unit}]")


def _solid_label(result: Result) -> str:
    """Label of the solid reference."""
    dataset = as_dataset(result)
    if dataset.attrs[attr.LIMIT] == "thickness":
        return "with the solid add-on" if attr.ADD_ON_DENSITY in dataset.attrs else "solid plate"
    solid = reference(result, "solid")
    several = ", mean" if solid is not None and solid.sizes["hit"] > 1 else ""
    return f"{reference_name(dataset)} of equal areal density{several}"


def _draw_curve(axes: Axes, result: Result) -> None:
    """Draw the cumulative share of the limits, with the references and measures. Limits beyond the largest value tried
    keep it below 1."""
    dataset = as_dataset(result)
    quantity, layer = dataset.attrs[attr.LIMIT], int(dataset.attrs[attr.LIMIT_LAYER])
    unit, factor = UNITS[quantity]
    values = dataset[v.LIMITS[quantity].value].values
    values = factor * np.sort(values[~np.isnan(values)])
    finite = values[np.isfinite(values)]
    if len(finite):
        share = np.arange(len(finite) + 1) / len(values)
        axes.step([finite[0], *finite], share, where="post", color=BLUE, linewidth=1.5)
    for name, label, style in (("solid", _solid_label(result), "--"), ("base_alone", "base alone", "-.")):
        known = reference(result, name)
        mean = np.nan if known is None else factor * float(np.nanmean(known[v.LIMITS[quantity].value].values))
        if np.isfinite(mean):
            axes.axvline(mean, linewidth=1.2, color=GREY, linestyle=style, label=label)
    for measure, estimate in estimated(result, measures_named(dataset, (), [*NAMES])).items():
        if np.isfinite(estimate.value):
            _mark_quantile(axes, measure.text, unit, measure.share, estimate.value, estimate.low, estimate.high)
    whose, share_label = _CURVE[quantity]
    whose = whose.format(f"layer {layer}" if layer else "the plate")
    furnish(axes, xlabel=f"{whose} [{unit}]", ylabel=share_label, ylim=(0.0, 1.02))


def _mark_quantile(axes: Axes, text: str, unit: str, share: float, value: float, low: float, high: float) -> None:
    """Mark a quantile with its interval on a cumulative curve, its name above it or, where there is no room, below."""
    axes.plot([low, high], [share, share], color=VERMILION, linewidth=4, alpha=0.4, solid_capstyle="butt")
    axes.plot(value, share, "o", color=VERMILION, markersize=5)
    on_right = value < 0.5 * sum(axes.get_xlim())
    above = not on_right or 0.03 < share < 0.15  # V01 and V05 are often close together
    offset = (8 if on_right else -8, 5 if above else -12)
    style: dict[str, Any] = {"textcoords": "offset points", "ha": "left" if on_right else "right"}
    axes.annotate(f"{text} = {value:.4g} {unit}", (value, share), offset, **style)


@in_style
def sweep_figure(result: Result, texts: Sequence[str] = ()) -> Figure:
    """A panel for every measure, with 95 % intervals, against the first input that is a number; a line for every
    combination of the others. Without texts of measures they are those of `studies.sweep.SHOWN`.

    Raises:
        ResultError: a text is no measure, or the sweep lacks what it needs.
    """
    sweep = as_dataset(result)
    measures, inputs = measures_named(sweep, texts, SHOWN), list(inputs_of(sweep))
    along = next((name for name in inputs if sweep[name].dtype.kind == "f"), inputs[0])
    table, others = sweep_table(result, measures), [name for name in inputs if name != along]
    lines = {"": table}
    if others:
        groups = table.groupby(others, sort=False)
        lines = {", ".join(map("{} {}".format, map(words, others), label)): line for label, line in groups}
    unit = STORED[sweep[along].attrs.get("units", "1")].shown
    across = f"{words(along)} [{unit}]" if unit else words(along)
    figure, panels = sheet(len(measures), 2, _PANEL, "constrained")
    for axes, measure in zip(panels, measures, strict=True):
        drawn = list(lines.items())[:_MOST_LINES]
        for number, ((label, line), marks) in enumerate(zip(drawn, distinct_marks(len(drawn)), strict=True)):
            style = {"color": PALETTE[number % len(PALETTE)], "label": label, **marks}
            _draw_line(axes, measure, sweep[along], line, style)
        furnish(axes, legend=False, xlabel=across, ylabel=fill(measure.title, 45))
        if measure.is_binary:
            axes.set_ylim(-0.03, 1.03)
    counted = "number beside a point: the share of the hits that count, if not all"
    more = len(lines) - _MOST_LINES
    note = f"{count_text(sweep.sizes['hit'], 'hit')} at every point, 95 % intervals; {counted}"
    note += f"; without {count_text(more, 'more combination')}" if more > 0 else ""
    return finish(figure, note, result=sweep, legend=len(inputs) > 1, columns=3)


def _draw_line(
    axes: Axes, measure: Measure, places: xarray.DataArray, line: pd.DataFrame, style: dict[str, Any]
) -> None:
    """Draw a line with its intervals, and beside a value the share of the hits that it counts if that is not all."""
    value, low, high, share = line[measure.text][["value", "low", "high", "share"]].to_numpy().T
    is_number = places.dtype.kind == "f"
    x = places.values * STORED[places.attrs["units"]].factor if is_number else np.arange(len(line))
    axes.errorbar(x, value, yerr=bars(value, low, high), **style)
    if not is_number:
        axes.set_xticks(x, places.values)
    of_text: dict[str, Any] = {"textcoords": "offset points", "fontsize": "x-small", "color": style["color"]}
    for at, height, counted in zip(x, value, share, strict=True):
        if 0.0 < counted < 1.0:
            axes.annotate(f"{counted:.0%}", (at, height), (4.0, 4.0), **of_text)


@in_style
def sensitivity_figure(table: pd.DataFrame, title: str = "", hits: int = 0) -> Figure:
    """Draw a bar for each change from the value as given, with a panel for each measure.

    Args:
        table: table of `sensitivity`.
        title: title of the campaign.
        hits: number of hits of each row, for the note.
    """
    figure = Figure(figsize=(_CHANGES + _MEASURE * len(table.columns), 0.9 + _ROW * len(table)), layout="constrained")
    panels = figure.subplots(1, len(table.columns), sharey=True, squeeze=False)[0]
    rows = np.arange(1, len(table))
    for axes, (name, values) in zip(panels, table.items(), strict=True):
        given = float(values.iloc[0])
        moves = values.iloc[1:].to_numpy(float) - given
        axes.barh(rows, moves, left=given, color=np.where(moves > 0.0, VERMILION, BLUE), height=0.7)
        axes.axvline(given, color="0.2", linewidth=1.0)
        axes.set_title(fill(str(name), 28), fontsize="medium")
        axes.set_yticks(rows, table.index[1:])
        axes.tick_params(axis="y", length=0)
        furnish(axes, along="x", legend=False)
        axes.margins(x=0.08)
        axes.spines[["top", "right", "left"]].set_visible(False)
    panels[0].invert_yaxis()
    note = f"{count_text(hits, 'hit')}, the same with every change. " if hits else ""
    return finish(figure, f"{note}A bar begins at the value of the campaign as given.", title=title or "sensitivity")


@in_style
def shots_figure(shots: Shots, estimate: V50, title: str) -> Figure:
    """Fired shots, the fitted probability that a core passes, and V50 by maximum likelihood and by the standard."""
    figure, (axes,) = sheet(1, 1, (7.6, 4.4), "constrained")
    margin = 0.15 * max(float(np.ptp(shots.velocity)), 0.02 * float(shots.velocity.max()))
    low, high = float(shots.velocity.min()) - margin, float(shots.velocity.max()) + margin
    if estimate.slowest_perforation < estimate.fastest_stop:
        axes.axvspan(estimate.slowest_perforation, estimate.fastest_stop, color="0.92", label="zone of mixed results")
    for perforated, colour, label in ((False, BLUE, "stopped"), (True, VERMILION, "passed")):
        velocity = shots.velocity[shots.perforated == perforated]
        axes.scatter(velocity, np.full(len(velocity), float(perforated)), s=160.0, c=colour, marker="|", label=label)
    if np.isfinite(estimate.spread):
        velocity = np.linspace(low, high, 200)
        curve = special.ndtr((velocity - estimate.value) / estimate.spread)
        axes.plot(velocity, curve, color=GREY, label="probit")
    if np.isfinite(estimate.value):
        ends = bars(estimate.value, *np.clip([estimate.low, estimate.high], low, high))
        axes.errorbar(estimate.value, 0.5, xerr=ends, fmt="o", color="k", capsize=4, label="V50 with 95 % interval")
    if np.isfinite(estimate.standard):
        axes.axvline(estimate.standard, color=GREEN, linestyle="--", linewidth=1.2, label="V50 by MIL-STD-662F")
    furnish(axes, xlabel=_VELOCITY, ylabel="probability that a core passes", xlim=(low, high), ylim=(-0.08, 1.08))
    return finish(figure, *estimate.lines, title=title)


@in_style
def firing_figure(dataset: xarray.Dataset) -> Figure:
    """The response of the target, the reported V50 beside the true one, and the operating characteristic of a proof."""
    parts = {"velocity": _draw_response, "reported_v50": _draw_reported, "pass_probability": _draw_proof}
    draws = [draw for name, draw in parts.items() if name in dataset]
    figure, panels = sheet(len(draws), len(draws), (5.4, 4.2), "constrained")
    for draw, axes in zip(draws, panels, strict=True):
        draw(axes, dataset)
    notes = report_lines(dataset) if "reported_v50" in dataset else []
    return finish(figure, *notes, str(dataset.attrs["disclaimer"]), title=str(dataset.attrs[attr.TITLE]))


def _draw_response(axes: Axes, dataset: xarray.Dataset) -> None:
    velocity, low = dataset.velocity.values, dataset.perforation_probability_low.values
    high = dataset.perforation_probability_high.values
    axes.fill_between(velocity, low, high, color=BLUE, alpha=0.2, linewidth=0, label="95 % interval")
    axes.plot(velocity, dataset.perforation_probability.values, color=BLUE, linewidth=1.5)
    furnish(axes, title="target", xlabel=_VELOCITY, ylabel="probability that a core passes", ylim=(-0.06, 1.03))
    columns = ("quantile", "quantile_velocity", "quantile_velocity_low", "quantile_velocity_high")
    for share, *quantile in zip(*(dataset[name].values.tolist() for name in columns), strict=True):
        if np.isfinite(quantile[0]):
            _mark_quantile(axes, f"V{100 * share:02.0f}", "m/s", share, *quantile)


def _draw_reported(axes: Axes, dataset: xarray.Dataset) -> None:
    v50, true = dataset.reported_v50.values, float(dataset.attrs["true_v50"])
    known = v50[np.isfinite(v50)]
    if len(known):
        shown_values = np.clip(known, *np.quantile(known, [0.005, 0.995]))
        axes.hist(shown_values, bins=40, color=BLUE, alpha=0.55, label="reported")
    axes.axvline(true, color="black", linewidth=1.5, label=f"true V50, {true:.4g} m/s")
    furnish(axes, title=tests_title(dataset), xlabel="reported V50 [m/s]", ylabel="tests")


def _draw_proof(axes: Axes, dataset: xarray.Dataset) -> None:
    velocity, proof = dataset.velocity.values, json.loads(dataset.attrs["firing_test_settings"])["proof"]
    stop = 1.0 - dataset.proof_perforation_probability.values
    axes.plot(velocity, stop, color="0.6", linewidth=1.2, label="P(stop) of one shot")
    axes.plot(velocity, dataset.pass_probability.values, color=BLUE, label="plan accepts, shots anywhere")
    same = dataset.pass_probability_same_place.values
    axes.plot(velocity, same, color=GREEN, linestyle="-.", label="plan accepts, all shots at one place")
    axes.axvline(proof["velocity"], color=VERMILION, linestyle="--", linewidth=1.2, label="velocity of the proof")
    title = f"proof: {count_text(int(dataset.proof_shots), 'shot')}, complete penetrations ≤ {proof['allowed']}"
    furnish(axes, title=title, xlabel=_VELOCITY, ylabel="probability", ylim=(-0.03, 1.03))


@in_style
def pairs_figure(posterior: xarray.Dataset) -> Figure:
    """Every two parameters against each other, and each beside its prior."""
    names = parameters_of(posterior)
    size = max(4.5, 1.75 * len(names))
    figure = Figure(figsize=(size + 1.2, size), layout="constrained")
    panels = figure.subplots(len(names), len(names), squeeze=False)
    drawn = [_draws(posterior, name) for name in names]
    for (row, column), axes in np.ndenumerate(panels):
        (x, prior, limits, label), (y, prior_below, limits_below, label_below) = drawn[column], drawn[row]
        if row == column:
            bins = np.linspace(limits[0], limits[1], 31).tolist()
            for values, colour in ((prior, _PRIOR_GREY), (x, BLUE)):
                axes.hist(values, bins=bins, density=True, color=colour, alpha=0.55)
            axes.set_title(posterior[names[row]].attrs["verdict"].replace(" by these shots", ""), fontsize="x-small")
            axes.set(yticks=[], xlim=limits)
        else:
            some = slice(None, None, max(1, len(x) // _POINTS))
            axes.scatter(prior[some], prior_below[some], s=2, color=_PRIOR_GREY, alpha=0.25, lw=0)
            axes.scatter(x[some], y[some], s=4, color=BLUE, alpha=0.45, lw=0)
            axes.set(xlim=limits, ylim=limits_below)
            axes.set_ylabel(label_below, fontsize="small")
        axes.set_xlabel(label, fontsize="small")
        axes.tick_params(labelsize="x-small")
        axes.label_outer()
        if column > row:
            axes.remove()
    return finish(figure, f"posterior (blue) and prior (grey); {_worth(posterior)}", result=posterior)


def _draws(posterior: xarray.Dataset, name: str) -> tuple[Array, Array, Array, str]:
    """Draws of a parameter and of its prior in its display unit, limits of their axis, and its label."""
    unit = STORED[posterior[name].attrs["units"]]
    values, prior = unit.factor * posterior[name].values, unit.factor * posterior[name].attrs["prior"]
    prior = np.random.default_rng(len(name)).choice(prior, values.size)
    ends = np.quantile(np.concatenate([prior, values]), [0.002, 0.998])
    label = words(name) + (f"\n[{unit.shown}]" if unit.shown else "")
    return values, prior, ends + np.ptp(ends) * np.array([-0.03, 0.03]), label


def _worth(posterior: xarray.Dataset) -> str:
    ended = "" if posterior.attrs["converged"] else ", NOT CONVERGED"
    return f"effective sample size {posterior.effective_sample_size:.0f}{ended}"


@in_style
def hits_figure(posterior: xarray.Dataset) -> Figure:
    """Where each shot hit, on the plate: draws of the posterior.

    The plate is drawn at the posterior's medians; where the spacing of its holes is unknown, so are their places.
    """
    fit = fit_from(str(posterior.attrs["fit"]), "the fit of this posterior", Path())
    medians = {
        one.place: float(np.median(posterior[one.name])) for one in fit.scene_parameters if one.quantity.unit != "rad"
    }
    figure, panels = sheet(len(fit.shots), 3, (4.5, 4.6))
    for place, (axes, shot) in enumerate(zip(panels, fit.shots, strict=True)):
        plate = fit.scene_of(shot, medians).target.layers[0]
        hits = MM * np.stack([posterior[name].values[:, place] for name in ("hit_y", "hit_z")])
        cell, far = MM * np.array(plate.sampled_cell), 1.05 * np.abs(hits).max(axis=1)
        draw_plate(axes, plate, np.minimum(np.maximum(0.55 * cell, far), _MOST_CELLS * cell))
        axes.scatter(hits[0], hits[1], s=5, color=BLUE, alpha=0.35, lw=0)
        axes.set(xlabel="y [mm]", ylabel="z [mm]", title=str(posterior["shot"].values[place]))
    return finish(figure, f"where the shots hit, {_worth(posterior)}", result=posterior)
