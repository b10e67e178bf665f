"""Figures of firing tests: of fired shots, and of a simulated test with its target and the plan of a proof."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import xarray
from matplotlib.axes import Axes
from scipy import special

from warpimpact.firing.v50 import V50, Shots
from warpimpact.firing.view import reported_lines, tests_title
from warpimpact.plotting.style import BLUE, GREEN, GREY, VERMILION, Figure, bars, finish, in_style
from warpimpact.results import attributes as attr
from warpimpact.results import firing as f

_ABOVE = (-11, 4, -7)
"""Distances of the names of V50, V05 and V01 above their points [pt]."""
_VELOCITY = "impact velocity [m/s]"


@in_style
def shots_figure(shots: Shots, estimate: V50, title: str) -> Figure:
    """Fired shots, the fitted probability of perforation, and V50 by maximum likelihood and by the standard."""
    figure = Figure(figsize=(7.6, 4.4), layout="constrained")
    axes = figure.subplots()
    margin = 0.15 * max(float(np.ptp(shots.velocity)), 0.02 * float(shots.velocity.max()))
    low, high = float(shots.velocity.min()) - margin, float(shots.velocity.max()) + margin
    if estimate.slowest_perforation < estimate.fastest_stop:
        zone = estimate.slowest_perforation, estimate.fastest_stop
        axes.axvspan(*zone, color="0.92", label="zone of mixed results")
    for perforated, colour, label in ((False, BLUE, "stop"), (True, VERMILION, "perforation")):
        velocity = shots.velocity[shots.perforated == perforated]
        axes.scatter(velocity, np.full(len(velocity), float(perforated)), s=160.0, c=colour, marker="|", label=label)
    if np.isfinite(estimate.spread):
        velocity = np.linspace(low, high, 200)
        curve = special.ndtr((velocity - estimate.value) / estimate.spread)
        axes.plot(velocity, curve, color=GREY, label="probit")
    if np.isfinite(estimate.value):
        ends = bars(estimate.value, *np.clip([estimate.low, estimate.high], low, high))
        label = "V50 with 95 % interval"
        axes.errorbar(estimate.value, 0.5, xerr=ends, fmt="o", color="black", capsize=4, label=label)
    if np.isfinite(estimate.standard):
        axes.axvline(estimate.standard, color=GREEN, linestyle="--", linewidth=1.2, label="V50 by MIL-STD-662F")
    _furnish(axes, xlabel=_VELOCITY, ylabel="probability of perforation", xlim=(low, high), ylim=(-0.08, 1.08))
    finish(figure, *estimate.lines, title=title)
    return figure


@in_style
def firing_figure(dataset: xarray.Dataset) -> Figure:
    """The response of the target, the reported V50 beside the true one, and the operating characteristic of a proof."""
    panels = [_draw_response]
    panels += [_draw_reported] if f.V50 in dataset else []
    panels += [_draw_proof] if f.PASS in dataset else []
    figure = Figure(figsize=(5.4 * len(panels), 4.2), layout="constrained")
    for draw, axes in zip(panels, np.ravel(figure.subplots(1, len(panels), squeeze=False)), strict=True):
        draw(axes, dataset)
    notes = reported_lines(dataset) if f.V50 in dataset else []
    finish(figure, *notes, str(dataset.attrs[f.DISCLAIMER]), title=str(dataset.attrs[attr.TITLE]))
    return figure


def _furnish(axes: Axes, **labels: Any) -> None:
    axes.set(**labels)
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
    handles, _ = axes.get_legend_handles_labels()
    if handles:
        axes.legend(frameon=False, fontsize="small", loc="best")


def _draw_response(axes: Axes, dataset: xarray.Dataset) -> None:
    velocity, low, high = (dataset[name].values for name in (f.VELOCITY, f.SHARE_LOW, f.SHARE_HIGH))
    axes.fill_between(velocity, low, high, color=BLUE, alpha=0.2, linewidth=0, label="95 % interval")
    axes.plot(velocity, dataset[f.SHARE].values, color=BLUE, linewidth=1.5)
    for row, share in enumerate(dataset[f.QUANTILE].values):
        value = float(dataset[f.QUANTILE_VELOCITY][row])
        if np.isfinite(value):
            ends = np.array([float(dataset[name][row]) for name in (f.QUANTILE_LOW, f.QUANTILE_HIGH)])
            if np.isfinite(ends).all():
                axes.plot(ends, [share, share], color=VERMILION, linewidth=4, alpha=0.4, solid_capstyle="butt")
            axes.plot(value, share, "o", color=VERMILION, markersize=5)
            name = f"V{100 * share:02.0f} = {value:.4g} m/s"
            axes.annotate(name, (value, share), xytext=(10, _ABOVE[row]), textcoords="offset points", fontsize="small")
    _furnish(axes, title="target", xlabel=_VELOCITY, ylabel="probability of perforation", ylim=(-0.06, 1.03))


def _draw_reported(axes: Axes, dataset: xarray.Dataset) -> None:
    v50, true = dataset[f.V50].values, float(dataset.attrs[f.TRUE_V50])
    known = v50[np.isfinite(v50)]
    if len(known):
        axes.hist(
            np.clip(known, *np.quantile(known, [0.005, 0.995])), bins=40, color=BLUE, alpha=0.55, label="reported"
        )
    axes.axvline(true, color="black", linewidth=1.5, label=f"true V50, {true:.4g} m/s")
    _furnish(axes, title=tests_title(dataset), xlabel="reported V50 [m/s]", ylabel="tests")


def _draw_proof(axes: Axes, dataset: xarray.Dataset) -> None:
    velocity, proof = dataset[f.VELOCITY].values, json.loads(dataset.attrs[f.SETTINGS])["proof"]
    stop = 1.0 - dataset[f.PROOF_PERFORATION].values
    axes.plot(velocity, stop, color="0.6", linewidth=1.2, label="P(stop) of one shot")
    axes.plot(velocity, dataset[f.PASS].values, color=BLUE, label="plan passes, shots anywhere")
    same = dataset[f.PASS_SAME_PLACE].values
    axes.plot(velocity, same, color=GREEN, linestyle="-.", label="plan passes, all shots at one place")
    axes.axvline(proof["velocity"], color=VERMILION, linestyle="--", linewidth=1.2, label="velocity of the proof")
    title = f"proof: {int(dataset.attrs[f.PROOF_SHOTS])} shots, at most {proof['allowed']} perforate"
    _furnish(axes, title=title, xlabel=_VELOCITY, ylabel="probability", ylim=(-0.03, 1.03))
