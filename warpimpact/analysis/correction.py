"""Maps of the fast law, corrected by finite elements at some of their hits (statistics/correction.py)."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import pandas as pd
import xarray

from warpimpact.analysis.numbers import number_text
from warpimpact.measures.estimates import by_hit_of, estimated, means_of
from warpimpact.measures.hits import failed, hit_numbers, is_choice, passed
from warpimpact.measures.measure import Measure, estimate_from
from warpimpact.measures.references import (
    ELEMENTS,
    SECOND_LAW,
    Result,
    as_dataset,
    as_tree,
    node_hits,
    node_places,
    with_nodes,
    with_references,
)
from warpimpact.measures.vocabulary import Array, has_base
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.scene.units import count_text
from warpimpact.statistics.correction import (
    FEWEST_ACCURATE,
    Correction,
    correct,
    corrected_event,
    corrected_mean,
    corrected_quantile,
    corrected_share,
)
from warpimpact.statistics.intervals import Estimate

CORRECTED = (v.RESIDUAL_VELOCITY, v.DEFLECTION, v.TILT, v.BENDING_STRESS)
"""Variables of which a corrected result has corrected ones, with standard errors, as far as it has them."""
LAWS = ("fast law", "free surfaces")
"""The controls of a correction: the law of the campaign, and the one of `SECOND_LAW`."""
_DIGITS = 1e-4
"""Half width of an interval over its value, below which it says less than the four digits that are shown."""
MOST_FAILED = 0.1
"""Share of the elements' hits that may fail; beyond it a correction is not to be trusted."""
FEWEST_SHARED = 0.9
"""Share of the hits with a value by the law of the campaign that must have one by the second law, too. It is no control
otherwise: near a limit velocity it may stop the cores that the first one lets pass."""
MESH_ERRORS = {"draft": (3.9, 2.9, 6.2), "standard": (1.5, 1.9, 4.2)}
"""Errors of meshes, root mean squares against the next finer ones (docs/continuum.md): of the residual velocity [m/s],
and of the tilt at 50 and at 130 mm [°]. Hits on one mesh share them, so no mean is known better."""
_PERFORATED, _BROKEN = Measure.parse("P(base_perforated)"), Measure.parse("P(broken)")


def is_corrected(result: Result) -> bool:
    """Whether a result has hits by finite elements that correct it; chosen hits of one have not."""
    dataset, (second, elements) = as_dataset(result), (node_places(result, name) for name in (SECOND_LAW, ELEMENTS))
    return len(elements) > 0 and len(second) == dataset.sizes[v.HIT] and not is_choice(dataset)


def is_trusted(result: Result) -> bool:
    """Whether a result is corrected, by hits of which few failed."""
    return is_corrected(result) and bool(failed(_parts(result)[-1]).mean() <= MOST_FAILED)


def with_correction(result: Result, second: xarray.Dataset, elements: xarray.Dataset) -> xarray.DataTree:
    """A result with corrected variables and their standard errors, of the hits that pass by the laws that correct them.

    Args:
        result: the map of the fast law.
        second: the same hits by the second law.
        elements: some of these hits by finite elements.
    """
    whole, result = as_tree(result), as_dataset(result)
    columns, shifts = dict[str, Any](), _mesh_shifts(elements)
    weights: dict[str, dict[str, float]] = {}
    for variable in (one for one in CORRECTED if one in result and one in elements):
        shape, most = result[variable].shape, 180.0 if variable in (v.DEFLECTION, v.TILT) else math.inf
        values, errors = np.full((2, *shape), np.nan, dtype=np.float32)
        for place in np.ndindex(*shape[1:]):
            numbers = [
                np.where(passed(one), one[variable].values[(slice(None), *place)].astype(float), np.nan)
                for one in (result, second, elements)
            ]
            correction, there, _ = _correction(result, elements, *numbers)
            if correction is not None:
                values[(there, *place)] = np.clip(correction.values, 0.0, most)
                least = shifts[variable].values[place] if variable in shifts else 0.0
                errors[(there, *place)] = np.maximum(correction.errors, least)
                name = f"{variable}{''.join(f'@{result[v.STANDOFF].values[k] * 1e3:g}mm' for k in place)}"
                terms = ("constant", *(LAWS[k] for k in correction.controls), "R²")
                parts = zip(terms, (*correction.coefficients.tolist(), correction.determination), strict=True)
                weights[name] = {term: float(f"{number:.6g}") for term, number in parts}
        if not np.isfinite(values).any():
            continue
        meaning = f"{variable.long_name}, corrected by finite elements where the core passes by the fast law"
        columns[f"corrected_{variable}"] = variable.dims, values, {"units": variable.units, "long_name": meaning}
        meaning = f"standard error of a prediction of the {variable.long_name}"
        columns[f"corrected_{variable}_error"] = variable.dims, errors, {"units": variable.units, "long_name": meaning}
    corrected = result.assign(columns).assign_attrs({attr.CORRECTION: json.dumps(weights)})
    nodes = {name: node.to_dataset(inherit=False) for name, node in whole.children.items()}
    new = with_references(corrected, {SECOND_LAW: second, ELEMENTS: elements})
    return with_nodes(corrected, nodes | {name: node.to_dataset(inherit=False) for name, node in new.children.items()})


def _correction(
    dataset: xarray.Dataset, elements: xarray.Dataset, first: Array, second: Array, of_elements: Array
) -> tuple[Correction | None, Any, Any]:
    """The correction of numbers of all hits by both laws, or by the first one alone, None with too few elements; which
    hits have a corrected number, and which of the elements' hits count."""
    numbers = hit_numbers(dataset)
    order = np.argsort(numbers)
    places = order[np.searchsorted(numbers, hit_numbers(elements), sorter=order)]
    both = np.isfinite(first) & np.isfinite(second)
    laws = np.column_stack([first, second] if both.sum() >= FEWEST_SHARED * np.isfinite(first).sum() else [first])
    there = np.asarray(np.isfinite(laws).all(axis=1))
    sound = np.flatnonzero(there[places] & np.isfinite(of_elements))
    if len(sound) < FEWEST_ACCURATE:
        return None, there, sound
    return correct(of_elements[sound], laws[places[sound]], laws[there]), there, sound


def corrected_estimate(result: Result, measure: Measure, confidence: float = 0.95) -> Estimate | None:
    """A measure of a corrected result, in its display unit; None where nothing sound corrects it.

    A probability of numbers that are all finite counts how far they are from the limit; other events count as 0 or 1.
    An event is at least as probable as those that imply it, whatever each correction alone would say.
    """
    if (estimate := _own_estimate(result, measure, confidence)) is None or measure.kind != "share":
        return estimate
    parts = (Measure.parse(f"P({name})") for name in measure.quantity.implied_by)
    known = [estimate, *filter(None, (_own_estimate(result, part, confidence) for part in parts))]
    value, low, high = (max(getattr(one, name) for one in known) for name in ("value", "low", "high"))
    return replace(estimate, value=value, low=low, high=high)


def _own_estimate(result: Result, measure: Measure, confidence: float) -> Estimate | None:
    """`corrected_estimate` of a measure alone."""
    dataset, second, elements = _parts(result)
    by_hit = [by_hit_of(one, measure) for one in (dataset, second, elements)]
    is_event = measure.is_binary and (measure.kind == "share" or any(np.isinf(numbers).any() for numbers in by_hit))
    if measure.kind not in ("mean", "share", "probability", "quantile"):
        return None
    if is_event or measure.kind == "mean":
        by_hit = [measure.counted(numbers) for numbers in by_hit]
    correction, *_ = _correction(dataset, elements, *by_hit)
    if correction is None:
        return None
    if is_event:
        estimate = corrected_event(correction, confidence)
    elif measure.kind == "probability":
        estimate = corrected_share(correction, measure.limit, above=measure.above, confidence=confidence)
    elif measure.kind == "quantile":
        estimate = corrected_quantile(correction, measure.share, confidence)
    else:
        estimate = corrected_mean(correction, confidence, measure.bounds)
    estimate = estimate.no_narrower(mesh_error(elements, measure))
    return estimate.within(*measure.bounds).times(measure.display.factor)


def mesh_error(elements: xarray.Dataset, measure: Measure) -> float:
    """What the mesh of hits by finite elements may move a mean or a quantile by, 0 where that is unknown: the root mean
    square over the hits, whose velocities and tilts move by those of `MESH_ERRORS`."""
    if measure.is_binary:
        return 0.0
    moved = elements.assign({name: elements[name] + shift for name, shift in _mesh_shifts(elements).items()})
    change = by_hit_of(moved, measure) - by_hit_of(elements, measure)
    known = change[np.isfinite(change)]
    return float(np.sqrt(np.mean(known**2))) if len(known) else 0.0


def _mesh_shifts(elements: xarray.Dataset) -> dict[v.Variable, xarray.DataArray]:
    """`MESH_ERRORS` of hits by finite elements, by variable; those of the tilt along "standoff"."""
    fidelity = json.loads(elements.attrs.get(attr.CONTINUUM, "{}")).get("fidelity", "draft")
    velocity, *tilts = MESH_ERRORS.get(fidelity, MESH_ERRORS["standard"])
    at_standoffs = np.interp(elements[v.STANDOFF].values, (0.05, 0.13), tilts)
    return {
        v.RESIDUAL_VELOCITY: xarray.DataArray(velocity),
        v.TILT: xarray.DataArray(at_standoffs, dims=v.STANDOFF),
    }


def corrected_difference(one: Result, other: Result, measure: Measure, confidence: float = 0.95) -> Estimate | None:
    """The difference of a corrected mean of two results of the same shots, in its display unit.

    What both corrections miss at the same hits cancels. None for other measures, for which pairs of few hits gain
    nothing; where one result counts a hit and the other not; and with too few elements.
    """
    if measure.kind != "mean":
        return None
    corrections, hits, errors = list[Correction | None](), list[Any](), list[float]()
    for dataset, second_law, elements in map(_parts, (one, other)):
        by_hit = [measure.counted(by_hit_of(part, measure)) for part in (dataset, second_law, elements)]
        correction, there, sound = _correction(dataset, elements, *by_hit)
        corrections.append(correction)
        hits.append((hit_numbers(dataset)[there].tolist(), hit_numbers(elements)[sound].tolist()))
        errors.append(mesh_error(elements, measure))
    first, second = corrections
    if first is None or second is None or hits[0] != hits[1]:
        return None
    if np.ptp(first.accurate) == np.ptp(second.accurate) == 0.0:  # equal numbers, whose pairs say nothing more
        return None
    difference = replace(
        first,
        values=first.values - second.values,
        residuals=first.residuals - second.residuals,
        leverage=max(first.leverage, second.leverage),
    )
    return corrected_mean(difference, confidence).no_narrower(max(errors)).times(measure.display.factor)


def _parts(result: Result) -> tuple[xarray.Dataset, xarray.Dataset, xarray.Dataset]:
    """The map of a corrected result, its hits by the second law, and those by the elements."""
    second, elements = node_hits(result, SECOND_LAW), node_hits(result, ELEMENTS)
    assert second is not None
    assert elements is not None
    return as_dataset(result), second, elements


def correction_table(result: Result, measures: Sequence[Measure] = ()) -> list[str | pd.DataFrame]:
    """Measures by the fast law, by the elements alone, and corrected; with a sentence where elements failed.

    Args:
        measures: by default the means of velocity, angles and bending stress, and whether base and core break.
    """
    dataset, _, elements = _parts(result)
    count, bad = elements.sizes["hit"], int(failed(elements).sum())
    events = [*([_PERFORATED] if has_base(dataset) else []), *([_BROKEN] if v.BROKEN in elements else [])]
    measures = measures or [*means_of(dataset, CORRECTED), *events]
    rows = {}
    for measure, fast in estimated(result, measures).items():
        values, corrected = measure.values(elements), corrected_estimate(result, measure)
        alone = estimate_from(measure, values).no_narrower(mesh_error(elements, measure)).times(measure.display.factor)
        rows[measure.title] = (
            f"{fast.value:.0%}" if measure.is_binary else number_text(fast.value),
            f"{np.nansum(values):.0f} of {alone.count}" if measure.is_binary else _interval(measure, alone),
            "-" if corrected is None else _interval(measure, corrected),
        )
    head = ("fast law", f"{count_text(count - bad, 'hit')} by elements", "corrected")
    table = pd.DataFrame.from_dict(rows, orient="index", columns=head)
    note = f"{bad} of {count_text(count, 'hit')} failed by finite elements. Do not trust the correction."
    return [table, *([note] if bad > MOST_FAILED * count else []), *touching_note(elements)]


def touching_note(elements: xarray.Dataset) -> list[str]:
    """A sentence on layers that may touch, where hits by finite elements crossed some."""
    sentence = elements.attrs.get(attr.TOUCHING_LAYERS)
    return [f"Layers that touch: {sentence}."] if sentence else []


def _interval(measure: Measure, estimate: Estimate) -> str:
    if measure.is_binary:
        return f"{estimate.value:.0%} ({estimate.low:.0%} to {estimate.high:.0%})"
    if not estimate.half_width > _DIGITS * abs(estimate.value):  # unknown, or equal hits without an error of their mesh
        return number_text(estimate.value)
    digits = max(0, 1 - math.floor(math.log10(estimate.half_width)))
    return f"{estimate.value:.{digits}f} ± {estimate.half_width:.{digits}f}"
