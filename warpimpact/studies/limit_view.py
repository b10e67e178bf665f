"""The view of a search of limits."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

import numpy as np
import xarray

from warpimpact.analysis.estimates import estimated
from warpimpact.analysis.numbers import interval_text
from warpimpact.analysis.plate_text import reference_name
from warpimpact.analysis.proxy import proxy
from warpimpact.analysis.summary import numerics_note
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.files import ResultError
from warpimpact.results.measures import NAMES, Measure
from warpimpact.results.references import reference
from warpimpact.results.vocabulary import needed_density
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.scene.units import quantity as reader_of
from warpimpact.solver.accuracy import errors_text, share_text
from warpimpact.solver.limit_search import MOST_RUNS
from warpimpact.view.view import Column, Section, Table, number

_MOST_LISTED = 12


def shown_unit(name: str) -> tuple[str, float]:
    """Display unit of a limit, and the factor to it."""
    shown = reader_of(QUANTITIES[name].type).display
    return shown.shown, shown.factor


def measures_of(dataset: xarray.Dataset, texts: Sequence[str] = ()) -> list[Measure]:
    """The measures with these texts for a search of limits; by default V50 and V05, or H50 and H05.

    Raises:
        ResultError: a text is no measure, or the result lacks what it needs.
    """
    try:
        limits = v.LIMITS[dataset.attrs[attr.LIMIT]].value
        named = [text for text in NAMES if Measure.parse(text).name == limits]
        return [Measure.parse(text).of(dataset) for text in texts or named]
    except ValueError as error:
        raise ResultError(f"measure: {error}") from None


def limit_view(dataset: xarray.Dataset, texts: Sequence[str] = ()) -> list[Section]:
    """The view of a search of limits: every hit of a short list, or its measures; its references; notes.

    Args:
        texts: texts of measures, which are also shown for a short list; by default as in `measures_of`.
    """
    short = len(dataset[v.LIMITS[dataset.attrs[attr.LIMIT]].value]) <= _MOST_LISTED
    return [
        *([Section([_hits(dataset)]), *_proxies(dataset)] if short else []),
        *([] if short and not texts else [Section([_estimates(dataset, texts)])]),
        Section([*_left_out(dataset), *_expected(dataset), *_references(dataset)]),
        Section(list(_costs(dataset))),
    ]


def in_short(dataset: xarray.Dataset) -> str:
    """A sentence with V50 and V05, or H50 and H05, and their intervals; for a short list the range of its limits."""
    quantity = dataset.attrs[attr.LIMIT]
    unit, factor = shown_unit(quantity)
    values = factor * dataset[v.LIMITS[quantity].value].values
    known = values[np.isfinite(values)]
    if len(values) <= _MOST_LISTED:
        ends = f"{known.min():.5g} to {known.max():.5g} {unit}" if len(known) else "not found"
        return f"limit {quantity} of {len(values)} hits: {ends}"
    parts = []
    for measure, estimate in estimated(dataset, measures_of(dataset)).items():
        interval = interval_text(factor * estimate.low, factor * estimate.high, text="{:.5g}".format)
        parts.append(f"{measure.text} {factor * estimate.value:.5g} {unit} ({interval})")
    return ", ".join(parts)


def _hits(dataset: xarray.Dataset) -> Table:
    """Every hit with its limit and the two ends that enclose it."""
    quantity = dataset.attrs[attr.LIMIT]
    unit, factor = shown_unit(quantity)
    value, lower, upper = (factor * dataset[name].values for name in v.LIMITS[quantity][:3])
    columns = (
        *(number("hit", digits="d"), number("obliquity", "°", ".4g")),
        *(number(header, unit, ".5g") for header in (f"limit {quantity}", "lower end", "upper end")),
    )
    obliquity = dataset[v.OBLIQUITY].values
    return Table(columns, list(zip(range(len(value)), obliquity, value, lower, upper, strict=True)))


def _estimates(dataset: xarray.Dataset, texts: Sequence[str]) -> Table:
    """Measures with their intervals."""
    rows = []
    for measure, estimate in estimated(dataset, measures_of(dataset, texts)).items():
        shown = estimate.times(measure.display.factor)
        interval = interval_text(shown.low, shown.high, shown.numerics, "{:.5g}".format)
        rows.append((measure.text, shown.value, interval, measure.title))
    columns = Column("measure"), number("value", digits=".5g"), Column("95 % interval"), Column("meaning")
    return Table(columns, rows)


def _left_out(dataset: xarray.Dataset) -> Iterator[str]:
    """Hits without a limit, and limits that are less accurate than required."""
    attributes, quantity = dataset.attrs, dataset.attrs[attr.LIMIT]
    unit, factor = shown_unit(quantity)
    value, _, _, _, converged = (dataset[name].values for name in v.LIMITS[quantity])
    if failed := int(np.isnan(value).sum()):
        yield f"{failed} hits failed, and count in none of these numbers"
    if beyond := int(np.isposinf(value).sum()):
        yield f"{beyond} hits have no limit {quantity} up to {factor * attributes[attr.LIMIT_HIGHEST]:g} {unit}"
    if missed := int((value == 0.0).sum()):
        yield f"{missed} hits touch no material"
    if open_ := int((converged == 0).sum()) - failed:
        yield f"{open_} hits were not found to {factor * attributes[attr.LIMIT_TOLERANCE]:g} {unit} in {MOST_RUNS} runs"


def _expected(dataset: xarray.Dataset) -> Iterator[str]:
    """Where a test would find the limit velocity, from what is known of the material; empty where that is unknown."""
    value = dataset[v.LIMITS[dataset.attrs[attr.LIMIT]].value].values
    if attr.LIMIT_FACTORS not in dataset.attrs or not np.isfinite(value).any():
        return
    middle = float(np.median(value[np.isfinite(value)]))
    low, high = (middle * float(factor) for factor in dataset.attrs[attr.LIMIT_FACTORS])
    yield (
        f"a test of this material is expected between {low:.4g} and {high:.4g} m/s (90 %): Y is not better known, and "
        "tests scatter"
    )


def _costs(dataset: xarray.Dataset) -> Iterator[str]:
    """Number of runs of the search, and accuracy of its limits."""
    runs = dataset[v.LIMITS[dataset.attrs[attr.LIMIT]].runs].values
    yield f"{runs.mean():.2g} runs of a hit on average, {runs.max()} at most"
    yield promise_line(dataset)
    yield from filter(None, [numerics_note(dataset)])


def _references(dataset: xarray.Dataset) -> Iterator[str]:
    """The limits of the solid reference and of the base alone; empty without them."""
    if (solid := reference(dataset, "solid")) is not None:
        yield _of_solid(dataset, solid)
    if (alone := reference(dataset, "base_alone")) is not None:
        quantity = dataset.attrs[attr.LIMIT]
        yield f"base alone: limit {quantity} {_mean_text(alone, quantity)}"


def _mean_text(of_reference: xarray.Dataset, quantity: str) -> str:
    """The mean limit of a reference."""
    unit, factor = shown_unit(quantity)
    value = of_reference[v.LIMITS[quantity].value].values
    return f"{factor * float(np.nanmean(value)):.5g} {unit}" + (", mean" if len(value) > 1 else "")


def _of_solid(dataset: xarray.Dataset, solid: xarray.Dataset) -> str:
    """The limit of the solid reference, and the cost of its search."""
    quantity, hit_count = dataset.attrs[attr.LIMIT], solid.sizes["hit"]
    limit = _mean_text(solid, quantity)
    density = float(dataset.attrs[attr.AREAL_DENSITY])
    if quantity == "thickness":
        needed = needed_density(solid, 0.0)
        limit += f", {float(np.nanmean(needed)):.4g} kg/m²"
        limit += f" (the target as given has {density:.4g} kg/m²)"
    else:
        limit += f", of {density:.4g} kg/m² as the target"
    hits = f"{hit_count} hit{'s' if hit_count > 1 else ''}"
    seconds = float(solid.attrs[attr.COMPUTE_TIME])
    return f"{reference_name(dataset)}: limit {quantity} {limit}; {hits} searched in {seconds:.2g} s"


def _proxies(dataset: xarray.Dataset) -> list[Section]:
    """The proxy beside the limit thickness of a solid plate; empty for another search."""
    proxies = proxy(dataset) if dataset.attrs[attr.LIMIT] == "thickness" else None
    if proxies is None:
        return []
    title = "proxy: energy over presented area and resistance, as a depth, and its ratio to the limit thickness"
    columns = (
        *(number("hit", digits="d"), number("inclination", "°", ".4g"), number("proxy", "mm", ".4g")),
        number("ratio", digits=".3f"),
    )
    rows = [
        (hit, inclination, 1e3 * depth, ratio)
        for hit, (inclination, depth, ratio) in enumerate(zip(*proxies, strict=True))
    ]
    return [Section([Table(columns, rows)], title)]


def promise_line(dataset: xarray.Dataset) -> str:
    """A line with the estimated error of the limits."""
    attributes = dataset.attrs
    unit, factor = shown_unit(attributes[attr.LIMIT])
    of_layer = f"thickness of layer {attributes[attr.LIMIT_LAYER]}; " if attributes[attr.LIMIT_LAYER] else ""
    ends = f"{of_layer}ends of a limit at most {factor * attributes[attr.LIMIT_TOLERANCE]:g} {unit} apart"
    if attr.RESOLUTION not in attributes:
        return f"{ends}; the error of the numerics was not measured, as the campaign fixes the resolution"
    kept = "" if attributes[attr.PROMISE_KEPT] else ", more than was asked for"
    hits = share_text(json.loads(attributes[attr.ACCURACY])["share"])
    return f"{ends}; against a finer level {hits} are within {errors_text(attributes)}{kept}"
