"""Two results of the same shots, hit by hit: how much they differ, and where most."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import xarray
from numpy.typing import NDArray
from scipy.stats import spearmanr

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, hit_numbers, passed
from warpimpact.view.view import Column, Section, Table, number

Array = NDArray[np.float64]

MOST_OTHERWISE = 12
"""Most hits that are named as ending otherwise."""
MOST_WORST = 3
"""Number of hits that are named for the largest differences."""
FEWEST_RANKED = 3
"""Fewest hits for a correlation of ranks."""


def shared_hits(datasets: Mapping[str, xarray.Dataset]) -> dict[str, xarray.Dataset] | None:
    """The hits that both results have, in memory, the result by finite elements last; None unless there are two results
    of the same shots, one of them by finite elements. Results are given and returned by their names."""
    by_elements = [name for name, dataset in datasets.items() if attr.CONTINUUM in dataset.attrs]
    if len(datasets) != 2 or len(by_elements) != 1:
        return None
    (reference,) = by_elements
    (name,) = {*datasets} - {reference}
    numbers, places, others = np.intersect1d(
        hit_numbers(datasets[name]), hit_numbers(datasets[reference]), return_indices=True
    )
    fast, slow = datasets[name].isel(hit=places).load(), datasets[reference].isel(hit=others).load()
    shots = (v.HIT_Y, v.HIT_Z, *v.SHOT_VARIABLES)
    if not len(numbers) or not all(np.allclose(fast[at], slow[at], atol=1e-9) for at in shots if at in fast):
        return None
    return {name: fast, reference: slow}


def shot_by_shot(shared: Mapping[str, xarray.Dataset]) -> Section:
    """How two results differ, hit by hit: bias, root mean square, correlation of ranks and the worst hits by quantity.
    The numbers describe these hits and have no intervals. Hits that failed in either result are left out, and counted.
    """
    (name, compared), (reference, other) = shared.items()
    numbers, sound = hit_numbers(compared), ~(failed(compared) | failed(other))
    rows = [row for label, unit, a, b in _pairs(compared, other) if (row := _row(label, unit, a, b, numbers, sound))]
    left_out = int((~sound).sum())
    sentence = f"{name} less {reference}, of the {len(numbers)} hits that both have" + (
        f"; {left_out} of them failed and count nowhere" if left_out else ""
    )
    columns = (
        *(Column("quantity"), number("hits", digits=".0f"), number("bias", digits=".3g"), number("rms", digits=".3g")),
        *(number("rank correlation", digits=".2f"), Column("largest differences at hits")),
    )
    ended = (
        [f"{name} and {reference} end otherwise at hits {_text_of(numbers[differs])}"]
        if (differs := sound & (passed(compared) != passed(other))).any()
        else []
    )
    return Section([sentence, *ended, *([Table(columns, rows)] if rows else [])], "shot by shot")


def _text_of(numbers: NDArray[np.int64]) -> str:
    """The first hits, and how many more there are."""
    named = ", ".join(str(number) for number in numbers[:MOST_OTHERWISE])
    return named + (f" and {len(numbers) - MOST_OTHERWISE} more" if len(numbers) > MOST_OTHERWISE else "")


def _pairs(result: xarray.Dataset, other: xarray.Dataset) -> list[tuple[str, str, Array, Array]]:
    """Quantities with their units and values in both results."""
    pairs = [
        (str(name), unit, result[name].values, other[name].values)
        for name, unit in ((v.RESIDUAL_VELOCITY, "m/s"), (v.DEFLECTION, "°"))
    ]
    for k, standoff in enumerate(result[v.STANDOFF].values):
        if k < other.sizes[v.STANDOFF] and other[v.STANDOFF].values[k] == standoff:
            label = f"tilt at {1e3 * standoff:g} mm"
            pairs.append((label, "°", result[v.TILT].values[:, k], other[v.TILT].values[:, k]))
    return pairs


def _row(
    label: str, unit: str, values: Array, other: Array, numbers: NDArray[np.int64], sound: NDArray[np.bool_]
) -> tuple[str, float, float, float, float, str] | None:
    known = sound & ~np.isnan(values) & ~np.isnan(other)
    if not known.any():
        return None
    apart, hits = (values - other)[known].astype(np.float64), numbers[known]
    order = np.argsort(-np.abs(apart), kind="stable")[:MOST_WORST]
    worst = ", ".join(f"{hits[k]} ({apart[k]:+.3g})" for k in order)
    head = f"{label.replace('_', ' ')}, {unit}"
    ranked = math.nan
    if len(hits) >= FEWEST_RANKED and np.ptp(values[known]) > 0.0 and np.ptp(other[known]) > 0.0:
        ranked = float(spearmanr(values[known], other[known]).statistic)
    return head, float(known.sum()), float(apart.mean()), float(np.sqrt((apart**2).mean())), ranked, worst
