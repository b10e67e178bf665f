"""Two results of the same shots: whether they are, and how two models of them differ hit by hit."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

import numpy as np
import pandas as pd
import xarray

from warpimpact.analysis.numbers import View
from warpimpact.errors import ResultError
from warpimpact.measures.hits import failed, hit_numbers, passed
from warpimpact.measures.measure import sampling_design
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.scene.units import count_text

_SAME_PLACE = 1e-9
"""Rounding of a place in units of the cell."""
MOST_NAMED, MOST_WORST = 12, 3
"""Most hits that are named as ending differently by two models, and as the largest differences of a quantity."""
CONTRADICTION = 0.25
"""Share of the hits that must end differently for two models to contradict each other."""


def shot_conditions(dataset: xarray.Dataset, name: str) -> dict[str, Any]:
    """What must be the same for plates to be compared, in the units of the result.

    Raises:
        ResultError: the result, which has this name, does not describe its core and impact.
    """
    attributes = dataset.attrs
    if v.PRESENTED_AREA not in dataset or attr.STANDOFF_POINT not in attributes:
        raise ResultError(f"{name}: has no description of its core and impact, which a comparison needs; run it again")
    own = [name for name in map(str, dataset.variables) if name.startswith("core_") or name in (v.MASS, v.STRENGTH)]
    core = {name.removeprefix("core_"): input_value(dataset, name) for name in own}
    core["presented_area"] = float(dataset[v.PRESENTED_AREA].mean())
    searched = attributes.get(attr.LIMIT) == "velocity"
    impact = {
        variable.field: f"{value!r} deg" if variable.units == "degree" and isinstance(value, float) else value
        for variable in v.SHOT_VARIABLES
        if not (searched and variable == v.IMPACT_VELOCITY) and (value := input_value(dataset, variable)) is not None
    }
    output = {"standoffs": dataset[v.STANDOFF].values.tolist(), "standoff_point": attributes[attr.STANDOFF_POINT]}
    limit = {"limit": attributes[attr.LIMIT]} if attr.LIMIT in attributes else {}
    return limit | {"core": core, "impact": impact, "output": output}


def input_value(dataset: xarray.Dataset, name: str) -> float | str | None:
    """The number of an input that is one for all hits, or words on how it scatters; None where it is absent."""
    if name not in dataset:
        return None
    if "distribution" in dataset[name].attrs:
        return str(dataset[name].attrs["distribution"])
    values = np.unique(dataset[name].values)
    return values[0].item() if len(values) == 1 else "other from hit to hit"


def not_paired(result: xarray.Dataset, other: xarray.Dataset) -> str:
    """Why the first hits of both are not the same shots; empty where they are."""
    common = min(result.sizes["hit"], other.sizes["hit"])
    one, two = (dataset.isel(hit=slice(common)) for dataset in (result, other))
    if sampling_design(one) != sampling_design(two):
        return "their shots have other replicates"
    for axis, coordinate in enumerate((v.HIT_Y, v.HIT_Z)):
        here, there = (dataset[coordinate].values / dataset.attrs[attr.PLATE_PERIOD][axis] for dataset in (one, two))
        if not np.allclose(here, there, rtol=0.0, atol=_SAME_PLACE):
            return "their shots hit other places of the cell"
    names = (name for name in (*v.SHOT_VARIABLES, v.MASS) if name in one)
    differing = (name for name in names if not (name in two and np.array_equal(one[name], two[name])))
    return next((f"their shots differ in {name}" for name in differing), "")


def shared_hits(datasets: Mapping[str, xarray.Dataset]) -> dict[str, xarray.Dataset] | None:
    """The hits that both results have, in memory, the result by finite elements last; None unless there are two results
    of the same shots, one of them by finite elements. Results are given and returned by their names."""
    by_elements = [name for name, dataset in datasets.items() if attr.CONTINUUM in dataset.attrs]
    if len(datasets) != 2 or len(by_elements) != 1:
        return None
    (reference,), (name,) = by_elements, {*datasets} - {*by_elements}
    one, other = datasets[name], datasets[reference]
    numbers, first, second = np.intersect1d(hit_numbers(one), hit_numbers(other), return_indices=True)
    fast, slow = one.isel(hit=first).load(), other.isel(hit=second).load()
    shots = (v.HIT_Y, v.HIT_Z, *v.SHOT_VARIABLES)
    same = len(numbers) and all(np.allclose(fast[at], slow[at], atol=1e-9) for at in shots if at in fast)
    return {name: fast, reference: slow} if same else None


def shot_by_shot(shared: Mapping[str, xarray.Dataset]) -> View:
    """How two results differ, hit by hit: bias, root mean square, correlation of ranks and the worst hits by quantity.
    The numbers describe these hits and have no intervals. Hits that failed in either result are left out, and counted.

    Where many cores are stopped by one model and pass by the other, a difference of velocities means nothing; a
    sentence says so in its place.
    """
    (name, one), (reference, other) = shared.items()
    numbers, sound = hit_numbers(one), ~(failed(one) | failed(other))
    differs = sound & (passed(one) != passed(other))
    left_out = f"; {int((~sound).sum())} failed and are left out" if (~sound).any() else ""
    common = count_text(len(numbers), "hit")
    parts: list[str | pd.DataFrame] = [f"{name} by the fast law less {reference}, of {common} in both{left_out}"]
    if differs.any():
        more = f" and {differs.sum() - MOST_NAMED} more" if differs.sum() > MOST_NAMED else ""
        named = ", ".join(map(str, numbers[differs][:MOST_NAMED]))
        parts.append(f"{name} and {reference} end differently at {count_text(differs.sum(), 'hit')}: {named}{more}")
    if differs.sum() >= CONTRADICTION * sound.sum() and differs.any():
        counts = (f"{int(passed(result)[sound].sum())} by {label}" for label, result in shared.items())
        parts.append(
            f"The models contradict each other here. Cores that pass, of {int(sound.sum())}: {', '.join(counts)}. "
            "Believe neither without a shot. Differences are of the hits that end alike."
        )
    standoffs, rows = np.intersect1d(one[v.STANDOFF], other[v.STANDOFF]), {}
    ours, theirs = (_columns(result, standoffs).set_axis(numbers)[sound & ~differs] for result in (one, other))
    for label in ours:
        difference = (ours[label] - theirs[label]).dropna()
        if len(difference):
            both = pd.concat([ours[label], theirs[label]], axis=1).dropna()
            varies = len(both) >= 3 and both.nunique().min() > 1
            ranked = both.corr("spearman").iloc[0, 1] if varies else np.nan
            worst = difference[difference.abs().nlargest(MOST_WORST).index]
            rows[label] = {
                "hits": str(len(difference)),
                "bias": f"{difference.mean():.3g}",
                "rms": f"{np.sqrt((difference**2).mean()):.3g}",
                "rank correlation": "-" if math.isnan(ranked) else f"{ranked:.2f}",
                "largest differences at hits": ", ".join(f"{hit} ({value:+.3g})" for hit, value in worst.items()),
            }
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("quantity")
    return {"shot by shot": [*parts, *([table] if rows else [])]}


def _columns(result: xarray.Dataset, standoffs: Any) -> pd.DataFrame:
    """Quantities of the hits with their units."""
    columns = {"residual velocity, m/s": result[v.RESIDUAL_VELOCITY], "deflection, °": result[v.DEFLECTION]}
    columns |= {f"tilt at {1e3 * at:g} mm, °": result[v.TILT].sel(standoff=at) for at in standoffs}
    return pd.DataFrame({label: column.values.astype(float) for label, column in columns.items()})
