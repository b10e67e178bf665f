"""Two models of the same shots, hit by hit: how much they differ, where most, whether they contradict each other."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np
import pandas as pd
import xarray
from numpy.typing import NDArray
from scipy.stats import spearmanr

from warpimpact.analysis.numbers import View
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, hit_numbers, passed

MOST_NAMED = 12
"""Most hits that are named as ending differently."""
MOST_WORST = 3
"""Number of hits that are named for the largest differences."""
FEWEST_RANKED = 3
"""Fewest hits for a correlation of ranks."""
CONTRADICTION = 0.25
"""Share of the hits that must end differently for the models to contradict each other: it then decides a comparison."""


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


def shot_by_shot(shared: Mapping[str, xarray.Dataset]) -> View:
    """How two results differ, hit by hit: bias, root mean square, correlation of ranks and the worst hits by quantity.
    The numbers describe these hits and have no intervals. Hits that failed in either result are left out, and counted.

    Where many cores are stopped by one model and pass by the other, a difference of velocities means nothing; a
    sentence says so in its place.
    """
    (name, compared), (reference, other) = shared.items()
    numbers, sound = hit_numbers(compared), ~(failed(compared) | failed(other))
    differs = sound & (passed(compared) != passed(other))
    left_out = f"; {int((~sound).sum())} of them failed and count nowhere" if (~sound).any() else ""
    parts: list[str | pd.DataFrame] = [f"{name} less {reference}, of the {len(numbers)} hits that both have{left_out}"]
    if differs.any():
        more = f" and {differs.sum() - MOST_NAMED} more" if differs.sum() > MOST_NAMED else ""
        named = ", ".join(map(str, numbers[differs][:MOST_NAMED]))
        parts.append(f"{name} and {reference} end differently at hits {named}{more}")
    if differs.sum() >= CONTRADICTION * sound.sum() and differs.any():
        counts = (f"{int(passed(one)[sound].sum())} pass by {label}" for label, one in shared.items())
        parts.append(
            f"The models contradict each other here: of {int(sound.sum())} hits, {' and '.join(counts)}. Believe "
            "neither without a shot. Differences are of the hits that end alike."
        )
    rows = [_row(numbers, sound & ~differs, *columns) for columns in _columns(compared, other)]
    table = pd.DataFrame([row for row in rows if row])
    return {"shot by shot": [*parts, *([table.set_index("quantity")] if len(table) else [])]}


def _columns(
    result: xarray.Dataset, other: xarray.Dataset
) -> list[tuple[str, NDArray[np.float64], NDArray[np.float64]]]:
    """Quantities with their units, and their values in both results."""
    columns = [
        (f"{name.replace('_', ' ')}, {unit}", result[name].values, other[name].values)
        for name, unit in ((v.RESIDUAL_VELOCITY, "m/s"), (v.DEFLECTION, "°"))
    ]
    for standoff in np.intersect1d(result[v.STANDOFF], other[v.STANDOFF]):
        one, two = (each[v.TILT].sel(standoff=standoff).values for each in (result, other))
        columns.append((f"tilt at {1e3 * standoff:g} mm, °", one, two))
    return columns


def _row(
    numbers: NDArray[np.int64],
    counts: NDArray[np.bool_],
    label: str,
    values: NDArray[np.float64],
    other: NDArray[np.float64],
) -> dict[str, str]:
    """How a quantity differs; empty where no hit has it in both results."""
    known = counts & ~np.isnan(values) & ~np.isnan(other)
    if not known.any():
        return {}
    difference, hits, ranked = (values - other)[known].astype(np.float64), numbers[known], math.nan
    if len(hits) >= FEWEST_RANKED and np.ptp(values[known]) > 0.0 and np.ptp(other[known]) > 0.0:
        ranked = float(spearmanr(values[known], other[known]).statistic)
    worst = np.argsort(-np.abs(difference), kind="stable")[:MOST_WORST]
    return {
        "quantity": label,
        "hits": str(len(hits)),
        "bias": f"{difference.mean():.3g}",
        "rms": f"{np.sqrt((difference**2).mean()):.3g}",
        "rank correlation": "-" if math.isnan(ranked) else f"{ranked:.2f}",
        "largest differences at hits": ", ".join(f"{hits[k]} ({difference[k]:+.3g})" for k in worst),
    }
