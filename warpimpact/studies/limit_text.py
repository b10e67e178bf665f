"""What a search of limits found, as text."""

from __future__ import annotations

import json

import numpy as np
import xarray

from warpimpact.analysis.numbers import ends_of, intervals_text
from warpimpact.analysis.proxy import proxy
from warpimpact.analysis.summary import numerics_note
from warpimpact.analysis.survival import draws_note
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.limits import solid_limits
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.scene.units import quantity as reader_of
from warpimpact.solver.findings import hits_text, limit_error_text
from warpimpact.solver.limit_search import MOST_RUNS
from warpimpact.studies.limit import QUANTILES, quantiles
from warpimpact.studies.published import published_lines

_MOST_LISTED = 12


def shown_unit(name: str) -> tuple[str, float]:
    """Unit that people see a limit in, and the factor to it."""
    shown = reader_of(QUANTITIES[name].type).display
    return shown.shown, shown.factor


def limits_text(dataset: xarray.Dataset) -> str:
    """What a search found, as a short table: V50 and V05, and every hit of a short list."""
    attributes = dataset.attrs
    quantity = attributes[attr.LIMIT]
    unit, factor = shown_unit(quantity)
    value, lower, upper, runs, converged = (dataset[name].values for name in v.LIMITS[quantity])
    rows = []
    if len(value) <= _MOST_LISTED:
        rows.append(f"{'hit':>4} {'obliquity':>10} {f'limit {quantity}':>16}   between")
        for hit, obliquity in enumerate(dataset[v.OBLIQUITY].values):
            ends = f"{factor * lower[hit]:.5g} and {factor * upper[hit]:.5g} {unit}"
            rows.append(f"{hit:>4} {obliquity:>9.4g}° {factor * value[hit]:>11.5g} {unit:<4}   {ends}")
        rows += _proxy_lines(dataset)
    else:
        for name, estimate in quantiles(dataset).items():
            ends = intervals_text(ends_of(estimate.times(factor)), "{:.5g}".format, "{:.2g}".format)
            what = "perforate" if quantity == "velocity" else "have a smaller limit"
            share = f"{100.0 * QUANTILES[f'V{name[1:]}']:g} % of the hits {what}"
            rows.append(f"{name} = {factor * estimate.value:.5g} {unit}   95 % interval {ends}   ({share})")
    if broken := int(np.isnan(value).sum()):
        rows.append(f"{broken} hits failed, and count in none of these numbers")
    beyond, missed = int(np.isposinf(value).sum()), int((value == 0.0).sum())
    if beyond:
        rows.append(f"{beyond} hits have no limit {quantity} up to {factor * attributes[attr.LIMIT_HIGHEST]:g} {unit}")
    if missed:
        rows.append(f"{missed} hits touch no material")
    if open_ := int((converged == 0).sum()) - int(np.isnan(value).sum()):
        rows.append(
            f"{open_} hits were not found to {factor * attributes[attr.LIMIT_TOLERANCE]:g} {unit} in {MOST_RUNS} runs"
        )
    rows += [*_solid_lines(dataset), *published_lines(dataset)]
    rows.append(f"{runs.mean():.2g} runs of a hit on average, {runs.max()} at most")
    rows.append(promise_line(dataset))
    rows += filter(None, [numerics_note(dataset), draws_note(dataset)])
    return "\n".join(rows)


def _solid_lines(dataset: xarray.Dataset) -> list[str]:
    """The solid plate that replaces the whole target, and what its search cost; none without one."""
    reference = solid_limits(dataset)
    if reference is None:
        return []
    quantity = dataset.attrs[attr.LIMIT]
    unit, factor = shown_unit(quantity)
    value = reference[v.LIMITS[quantity].value].values
    found = f"{factor * float(np.nanmean(value)):.5g} {unit}" + (", mean" if len(value) > 1 else "")
    density = float(dataset.attrs[attr.AREAL_DENSITY])
    if quantity == "thickness":
        found += f", {float(np.nanmean(value)) * reference.attrs[attr.LIMIT_DENSITY]:.4g} kg/m²"
        found += f" (the target as given has {density:.4g} kg/m²)"
    else:
        found += f", of {density:.4g} kg/m² as the target"
    hits = f"{len(value)} hit{'s' if len(value) > 1 else ''}"
    seconds = float(dataset.attrs[attr.SOLID_LIMIT_TIME])
    return [f"solid plate in place of the whole target: limit {quantity} {found}; {hits} searched in {seconds:.2g} s"]


def _proxy_lines(dataset: xarray.Dataset) -> list[str]:
    """The proxy beside the limit thickness of a solid plate; none of another search."""
    found = proxy(dataset) if dataset.attrs[attr.LIMIT] == "thickness" else None
    if found is None:
        return []
    rows = ["proxy: energy over presented area and resistance, as a depth, and its ratio to the limit thickness"]
    rows.append(f"{'hit':>4} {'inclination':>12} {'proxy':>12}   ratio")
    for hit, (inclination, depth, ratio) in enumerate(zip(*found, strict=True)):
        rows.append(f"{hit:>4} {inclination:>11.4g}° {1e3 * depth:>9.4g} mm   {ratio:.3f}")
    return rows


def promise_line(dataset: xarray.Dataset) -> str:
    """How far off the limits are estimated to be."""
    attributes = dataset.attrs
    unit, factor = shown_unit(attributes[attr.LIMIT])
    of_layer = f"thickness of layer {attributes[attr.LIMIT_LAYER]}; " if attributes[attr.LIMIT_LAYER] else ""
    ends = f"{of_layer}ends of a limit at most {factor * attributes[attr.LIMIT_TOLERANCE]:g} {unit} apart"
    if attr.LIMIT_ERROR not in attributes:
        return f"{ends}; the error of the numerics was not measured, as the campaign fixes the resolution"
    kept = "" if attributes[attr.PROMISE_KEPT] else ", more than was asked for"
    error = limit_error_text(attributes[attr.LIMIT_ERROR], attributes[attr.LIMIT])
    hits = hits_text(json.loads(attributes[attr.ACCURACY])["share"])
    return f"{ends}; against a finer level {hits} are within {error}{kept}"
