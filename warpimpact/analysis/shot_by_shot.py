"""Two results of the same shots, hit by hit: by how much one differs from the other, and where most."""

from __future__ import annotations

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, hit_numbers
from warpimpact.view.view import Column, Section, Table, number

Array = NDArray[np.float64]

MOST_WORST = 3
"""Hits that are named as those of the largest differences."""
FEWEST_RANKED = 3
"""Hits below which no ranks are correlated."""


def shot_by_shot(datasets: dict[str, xarray.Dataset]) -> list[Section]:
    """Where one of two results is by finite elements, and both have the same hits: how they differ, hit by hit.

    Args:
        datasets: results by their names.

    Returns:
        A section with bias, root mean square, correlation of ranks and the worst hits by quantity; empty where there is
        nothing to compare so. Hits of which either failed are left out, and counted.
    """
    by_elements = [name for name, dataset in datasets.items() if attr.CONTINUUM in dataset.attrs]
    if len(datasets) != 2 or len(by_elements) != 1:
        return []
    (reference,) = by_elements
    (name,) = {*datasets} - {reference}
    shared, places, others = np.intersect1d(
        hit_numbers(datasets[name]), hit_numbers(datasets[reference]), return_indices=True
    )
    one, other = datasets[name].isel(hit=places).load(), datasets[reference].isel(hit=others).load()
    if not len(shared) or not all(np.allclose(one[at], other[at], atol=1e-9) for at in (v.HIT_Y, v.HIT_Z)):
        return []
    sound = ~(failed(one) | failed(other))
    rows = [row for label, unit, a, b in _pairs(one, other) if (row := _row(label, unit, a, b, shared, sound))]
    left_out = int((~sound).sum())
    sentence = f"{name} less {reference}, of the {len(shared)} hits that both have" + (
        f"; {left_out} of them failed and count nowhere" if left_out else ""
    )
    columns = (
        *(Column("quantity"), number("hits", digits=".0f"), number("bias", digits=".3g"), number("rms", digits=".3g")),
        *(number("rank correlation", digits=".2f"), Column("largest differences at hits")),
    )
    return [Section([sentence, Table(columns, rows)], "shot by shot")] if rows else []


def _pairs(one: xarray.Dataset, other: xarray.Dataset) -> list[tuple[str, str, Array, Array]]:
    """Quantities with their units and values in both results."""
    pairs = [
        (str(name), unit, one[name].values, other[name].values)
        for name, unit in ((v.RESIDUAL_VELOCITY, "m/s"), (v.DEFLECTION, "°"))
    ]
    for k, standoff in enumerate(one[v.STANDOFF].values):
        if k < other.sizes[v.STANDOFF] and other[v.STANDOFF].values[k] == standoff:
            label = f"tilt at {1e3 * standoff:g} mm"
            pairs.append((label, "°", one[v.TILT].values[:, k], other[v.TILT].values[:, k]))
    return pairs


def _row(
    label: str, unit: str, one: Array, other: Array, numbers: NDArray[np.int64], sound: NDArray[np.bool_]
) -> tuple[str, float, float, float, float, str] | None:
    known = sound & ~np.isnan(one) & ~np.isnan(other)
    if not known.any():
        return None
    apart, hits = (one - other)[known].astype(np.float64), numbers[known]
    order = np.argsort(-np.abs(apart), kind="stable")[:MOST_WORST]
    worst = ", ".join(f"{hits[k]} ({apart[k]:+.3g})" for k in order)
    head = f"{label.replace('_', ' ')}, {unit}"
    ranked = rank_correlation(one[known], other[known])
    return head, float(known.sum()), float(apart.mean()), float(np.sqrt((apart**2).mean())), ranked, worst


def rank_correlation(one: Array, other: Array) -> float:
    """Spearman's; NaN of fewer than three hits, or where all are the same."""
    if len(one) < FEWEST_RANKED:
        return float("nan")
    from scipy.stats import rankdata

    ranks = [rankdata(values) for values in (one, other)]
    if any(np.ptp(rank) == 0.0 for rank in ranks):
        return float("nan")
    return float(np.corrcoef(*ranks)[0, 1])
