"""Figure of a simulated firing test: the target's response, the reported V50, and the plan of a proof."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray
from matplotlib.figure import Figure
from matplotlib.layout_engine import ConstrainedLayoutEngine

from warpimpact.firing.firing_view import verdict
from warpimpact.plotting.heading import add_heading
from warpimpact.plotting.style import BLUE, GREEN, VERMILION
from warpimpact.results import attributes as attr
from warpimpact.results import firing as f
from warpimpact.scene.display import MM

if TYPE_CHECKING:
    from matplotlib.axes import Axes

_ABOVE = (-11, 4, -7)
"""Distances of the names of V50, V05 and V01 above their points [pt]."""
_Settings = Mapping[str, Any]


def firing_figure(dataset: xarray.Dataset) -> Figure:
    """The response of the target with V50, V05 and V01, the map of limits with its weakest places, the distribution of
    the reported V50 beside the true one, shots against precision, and the operating characteristic of a proof; each if
    the file has it."""
    settings = json.loads(dataset.attrs[f.SETTINGS])
    panels: list[Callable[[Axes, xarray.Dataset, _Settings], None]] = [_draw_response]
    panels += [_draw_map] if f.CHANGES in dataset else []
    panels += [_draw_reported] if f.V50 in dataset else []
    panels += [_draw_sizes] if f.SIZE in dataset else []
    panels += [_draw_proof] if f.PASS in dataset else []
    columns = min(2, len(panels))
    rows = -(-len(panels) // columns)
    figure = Figure(figsize=(6.1 * columns, 4.3 * rows + 0.8), layout="constrained")
    axes = np.ravel(figure.subplots(rows, columns, squeeze=False))
    for draw, panel in zip(panels, axes, strict=False):
        draw(panel, dataset, settings)
    for empty in axes[len(panels) :]:
        empty.set_axis_off()
    add_heading(figure, str(dataset.attrs[attr.TITLE]), str(dataset.attrs[f.DISCLAIMER]))
    return figure


def _furnish(axes: Axes, **labels: Any) -> None:
    axes.set(**labels)
    axes.grid(color="0.9")
    axes.set_axisbelow(True)
    handles, _ = axes.get_legend_handles_labels()
    if handles:
        axes.legend(frameon=False, fontsize="small", loc="best")


def _draw_response(axes: Axes, dataset: xarray.Dataset, settings: _Settings) -> None:
    velocity = dataset[f.VELOCITY].values
    low, high = dataset[f.SHARE_LOW].values, dataset[f.SHARE_HIGH].values
    if np.isfinite(low).any():
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
    _furnish(
        axes, title="target", xlabel="impact velocity [m/s]", ylabel="probability of perforation", ylim=(-0.06, 1.03)
    )


def _draw_map(axes: Axes, dataset: xarray.Dataset, settings: _Settings) -> None:
    """The lowest limit of every place; rings mark the weakest twentieth and, filled, the weakest hundredth."""
    first = dataset[f.CHANGES].values[:, 0]
    y, z = MM * dataset[f.HIT_Y].values, MM * dataset[f.HIT_Z].values
    shown = np.where(np.isfinite(first), first, np.nan)
    size = float(np.clip(9000.0 / len(first), 4.0, 40.0))
    artist = axes.scatter(y, z, c=shown, s=size, cmap="viridis", plotnonfinite=True)
    axes.figure.colorbar(artist, ax=axes, label="limit velocity [m/s]")
    order = np.argsort(first)
    for share, face in ((0.05, "none"), (0.01, VERMILION)):
        weakest = order[: max(1, round(share * len(first)))]
        label = f"weakest {100 * share:g} % of the hits"
        axes.scatter(
            y[weakest], z[weakest], s=2.2 * size, edgecolors=VERMILION, linewidths=1.2, label=label, facecolors=face
        )
    axes.plot(MM * dataset[f.OUTLINE_Y].values, MM * dataset[f.OUTLINE_Z].values, color="black", linewidth=1.0)
    half = 0.5 * MM * np.asarray(dataset.attrs[f.CELL])
    limits = {
        "xlim": (min(-half[0], y.min()), max(half[0], y.max())),
        "ylim": (min(-half[1], z.min()), max(half[1], z.max())),
    }
    axes.set(title="where it is weak", xlabel="hit y [mm]", ylabel="hit z [mm]", aspect="equal", **limits)
    axes.legend(frameon=False, fontsize="small", loc="upper center", bbox_to_anchor=(0.5, -0.16), ncols=2)


def _draw_reported(axes: Axes, dataset: xarray.Dataset, settings: _Settings) -> None:
    required = settings.get("required") or {}
    answer = verdict(dataset, required.get("v50"), required.get("by", "v50"))
    v50, true = dataset[f.V50].values, float(dataset.attrs[f.TRUE_V50])
    known = v50[np.isfinite(v50)]
    if not len(known) or answer is None:
        axes.text(0.5, 0.5, "no test reports a V50", ha="center", transform=axes.transAxes)
        return
    ends = np.quantile(known, [0.005, 0.995])
    axes.hist(np.clip(known, *ends), bins=40, color=BLUE, alpha=0.55, label="reported V50")
    axes.axvline(true, color="black", linewidth=1.5, label=f"true V50, {true:.4g} m/s")
    if required:
        axes.axvline(required["v50"], color=VERMILION, linestyle="--", linewidth=1.5, label="required V50")
    lines = [
        f"{answer.bias:+.2g} m/s off, standard deviation {answer.deviation:.3g} m/s",
        f"reported spread {answer.spread:.3g} m/s (median), true {float(dataset.attrs[f.TRUE_SPREAD]):.3g} m/s",
    ]
    if answer.coverage is not None:
        confidence = 100 * float((settings.get("estimator") or {}).get("confidence", 0.95))
        lines.append(f"reported {confidence:g} % intervals with the true V50: {100 * answer.coverage.value:.3g} %")
    if answer.known.value < 1.0:
        lines.append(f"tests without a V50: {100 * (1.0 - answer.known.value):.3g} %")
    if answer.passed is not None:
        lines.append(f"tests that report the required V50: {100 * answer.passed.value:.3g} %")
    shots = dataset[f.SHOTS].values
    number = f"{shots.min()}" if np.ptp(shots) == 0 else f"{shots.min()} to {shots.max()}"
    title = f"{len(v50)} tests by {settings['procedure']['name']}, {number} shots each"
    _furnish(axes, title=title, xlabel="reported V50 [m/s]\n" + "\n".join(lines), ylabel="tests")


def _draw_sizes(axes: Axes, dataset: xarray.Dataset, settings: _Settings) -> None:
    precision, shots = settings["precision"], dataset[f.SIZE_SHOTS].values
    within, share = float(precision["within"]), float(precision["share"])
    axes.plot(shots, dataset[f.SIZE_WITHIN].values, "o-", color=BLUE, label=f"within ± {within:g} m/s")
    axes.axhline(share, color=VERMILION, linestyle="--", linewidth=1.2, label=f"asked: {100 * share:g} % of the tests")
    labels = {"xlabel": "shots of a test", "ylabel": "share of the tests", "ylim": (0.0, 1.03)}
    _furnish(axes, title="how many shots a precision takes", **labels)


def _draw_proof(axes: Axes, dataset: xarray.Dataset, settings: _Settings) -> None:
    velocity, shots = dataset[f.VELOCITY].values, int(dataset.attrs[f.PROOF_SHOTS])
    axes.plot(
        velocity, 1.0 - dataset[f.PROOF_PERFORATION].values, color="0.6", linewidth=1.2, label="P(stop) of one shot"
    )
    axes.plot(velocity, dataset[f.PASS].values, color=BLUE, label="plan passes, shots anywhere")
    axes.plot(
        velocity,
        dataset[f.PASS_SAME_PLACE].values,
        color=GREEN,
        linestyle="-.",
        label="plan passes, all shots at one place",
    )
    axes.axvline(
        float(dataset.attrs[f.PROOF_VELOCITY]),
        color=VERMILION,
        linestyle="--",
        linewidth=1.2,
        label="velocity of the proof",
    )
    title = f"proof: {shots} shots, at most {int(dataset.attrs[f.PROOF_ALLOWED])} perforate"
    _furnish(axes, title=title, xlabel="impact velocity [m/s]", ylabel="probability", ylim=(-0.03, 1.03))


def directions_figure(dataset: xarray.Dataset) -> Figure:
    """P(perforation) over the directions of fire, as a polar map: the angle from the normal of the plate outwards, and
    the direction to the side and upwards about it."""
    figure = Figure(figsize=(8.2, 7.6), layout=ConstrainedLayoutEngine(w_pad=0.3))  # room for "left"
    axes: Any = figure.add_subplot(projection="polar")
    azimuth, elevation = np.meshgrid(
        np.radians(dataset[f.AZIMUTH].values), np.radians(dataset[f.ELEVATION].values), indexing="ij"
    )
    around = np.arctan2(np.sin(elevation), np.cos(elevation) * np.sin(azimuth))
    outward = dataset[f.DIRECTION_OBLIQUITY].values
    share, hits = dataset[f.DIRECTION_SHARE].values, dataset[f.DIRECTION_HITS].values
    sizes = 90.0 + 160.0 * (np.log2(hits) - np.log2(hits.min())) / max(1.0, float(np.log2(hits.max() / hits.min())))
    artist = axes.scatter(around, outward, c=share, s=sizes, cmap="RdYlBu_r", vmin=0.0, vmax=1.0, edgecolors="black")
    for angle, radius, value in zip(around.ravel(), outward.ravel(), share.ravel(), strict=True):
        axes.annotate(
            f"{value:.2f}",
            (angle, radius),
            xytext=(0, -15),
            textcoords="offset points",
            ha="center",
            fontsize="x-small",
        )
    axes.set_rlim(0.0, 1.12 * float(outward.max()) if outward.max() > 0.0 else 1.0)
    axes.set_rlabel_position(-67.5)
    axes.yaxis.set_major_formatter("{x:g}°")
    axes.set_xticks(np.radians([0, 90, 180, 270]), ["right", "from above", "left", "from below"])
    figure.colorbar(artist, ax=axes, label="probability of perforation", shrink=0.8, pad=0.1)
    low, high = dataset.attrs[f.MEAN_INTERVAL]
    weight = json.loads(dataset.attrs[f.SETTINGS])["directions"]["weight"].replace("_", " ")
    mean = f"mean by {weight}: {float(dataset.attrs[f.MEAN]):.3g} ({low:.3g} to {high:.3g}); larger dots: more hits"
    add_heading(figure, str(dataset.attrs[attr.TITLE]), mean, str(dataset.attrs[f.DISCLAIMER]))
    return figure
