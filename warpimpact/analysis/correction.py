"""Where an answer comes from: the fast law, hits by finite elements, and what is known of materials."""

from __future__ import annotations

import json
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
import pandas as pd
import xarray

from warpimpact.analysis.numbers import ROUNDING, number_text
from warpimpact.measures.draws import COUNT, standard_normals
from warpimpact.measures.estimates import estimated, means_of, measure_data
from warpimpact.measures.hits import failed
from warpimpact.measures.measure import Measure, estimate_from
from warpimpact.measures.references import DRAWS, ELEMENTS, Result, as_dataset, as_tree, law_of, node_hits
from warpimpact.measures.vocabulary import has_base
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.scene.units import count_text, list_text
from warpimpact.statistics.intervals import Estimate

SHOWN = (v.RESIDUAL_VELOCITY, v.DEFLECTION, v.TILT)
"""Variables whose means the table shows."""
MOST_FAILED = 0.1
"""Share of the elements' hits that may fail; beyond it an answer is not to be trusted."""
WIDE, WIDE_SHARE = 0.05, 0.1
"""Length of an interval over its value, and of the interval of a share, above which more hits are worth a sentence."""
GOVERNING_STRENGTH = 0.15
"""Share of the variance from which the strength of a material is named as what governs an interval."""
_DIGITS = 1e-4
"""Half width of an interval over its value, below which it says less than the four digits that are shown."""
_SKEWNESS = 0.3
"""Distance of a value from the middle of its interval, over the half width, from which both ends are shown."""


def has_draws(result: Result) -> bool:
    """Whether a result is an answer, whose numbers are those of its draws."""
    return DRAWS in as_tree(result).children


def has_elements(result: Result) -> bool:
    """Whether hits by finite elements are in an answer."""
    return has_draws(result) and ELEMENTS in as_tree(result).children


def is_trusted(result: Result) -> bool:
    """Whether few of an answer's hits by finite elements failed."""
    elements = node_hits(result, ELEMENTS)
    return elements is not None and bool(failed(elements).mean() <= MOST_FAILED)


def trust_note(result: Result) -> list[str]:
    """A sentence where too many hits by finite elements failed."""
    elements = node_hits(result, ELEMENTS)
    if elements is None or is_trusted(result):
        return []
    bad, count = int(failed(elements).sum()), count_text(elements.sizes["hit"], "hit")
    return [f"{bad} of {count} by finite elements failed. Do not trust the answer."]


def passing(dataset: xarray.Dataset) -> Measure:
    """The share of the cores that pass: through the base where there is one."""
    return Measure.parse("P(base_perforated)" if has_base(dataset) else "P(perforated)")


def provenance_table(result: Result, measures: Sequence[Measure] = ()) -> list[str | pd.DataFrame]:
    """Measures by the fast law, by the elements alone, and as the answer has them, and what their variances come from;
    the methods and materials of the elements, and a sentence where they failed. Empty of a result without draws.

    Args:
        measures: by default the share that passes, and the means of velocity and angles.
    """
    if not has_draws(result):
        return []
    dataset, elements = as_dataset(result), node_hits(result, ELEMENTS)
    measures = measures or [passing(dataset), *means_of(dataset, SHOWN)]
    law, rows = estimated(as_dataset(law_of(result)), measures), {}
    for measure, one in estimated(result, measures).items():
        row = {"fast law": f"{law[measure].value:.0%}" if measure.is_binary else number_text(law[measure].value)}
        if elements is not None:
            sound = count_text(int((~failed(elements)).sum()), "hit")
            row[f"{sound} by elements"] = _of_elements(measure, elements)
        row |= {"answer": interval_of(measure, one), "variance by": _variance_text(result, measure)}
        rows[measure.title] = row
    table = pd.DataFrame.from_dict(rows, orient="index")
    if elements is None:
        return [table, "The interval of the answer contains the error of the fast law against finite elements."]
    methods = f"Elements: {elements.attrs[attr.NUMERICS]}."
    materials = elements.attrs.get(attr.CATALOGUE_NAMES, "").splitlines()
    return [table, methods, *materials, *trust_note(result), *touching_note(elements)]


def _of_elements(measure: Measure, elements: xarray.Dataset) -> str:
    """A measure of the hits by elements alone."""
    values = measure.values(elements)
    alone = estimate_from(measure, values).times(measure.display.factor)
    return f"{np.nansum(values):.0f} of {alone.count}" if measure.is_binary else interval_of(measure, alone)


def touching_note(elements: xarray.Dataset) -> list[str]:
    """A sentence on layers that may touch, where hits by finite elements crossed some."""
    sentence = elements.attrs.get(attr.TOUCHING_LAYERS)
    return [f"Layers that touch: {sentence}."] if sentence else []


def interval_of(measure: Measure, estimate: Estimate, unit: str = "") -> str:
    """A measure with its interval, as text; with both ends where the value is not in their middle."""
    value, half = estimate.value, estimate.half_width
    if measure.is_binary:
        return f"{value:.0%} ({estimate.low:.0%} to {estimate.high:.0%})"
    if not half > max(ROUNDING, _DIGITS * abs(value)):  # unknown, or equal hits
        return number_text(value) + unit
    digits = max(0, 1 - math.floor(math.log10(half)))
    if abs(value - 0.5 * (estimate.low + estimate.high)) > _SKEWNESS * half:
        return f"{value:.{digits}f}{unit} ({estimate.low:.{digits}f} to {estimate.high:.{digits}f})"
    return f"{value:.{digits}f} ± {half:.{digits}f}{unit}"


class VarianceShares(NamedTuple):
    """What the variance of a measure over the draws comes from; the sum is 1.

    Attributes:
        materials: share by the strength of each material, by its name.
        mesh: by the mesh of the elements.
        method: by the error of the fast law, or by what hits by elements leave open of it.
        hits: by the sample of hits.
    """

    materials: dict[str, float]
    mesh: float
    method: float
    hits: float


def variance_shares(result: Result, measure: Measure) -> VarianceShares | None:
    """What the variance of a measure over the draws comes from; None without draws that differ.

    Strengths and the mesh move a measure in proportion to their normal numbers, which are independent.
    """
    drawn = next(measure_data(result, [measure])).draws
    if drawn is None or not np.isfinite(drawn[0]).sum() > COUNT // 2 or len(drawn[0]) != COUNT:
        return None
    known = np.isfinite(drawn[0])
    own, sampled = drawn[0][known], drawn[1][known]
    total = max(float(own.var()), float(np.nanvar(sampled)))
    if not total > 0.0:
        return None
    names = _sources(result)
    normals = np.column_stack([standard_normals(name)[known] for name in names])
    normals -= normals.mean(axis=0)
    slopes, *_ = np.linalg.lstsq(normals, own - own.mean(), rcond=None)
    left = float((own - own.mean() - normals @ slopes).var()) * len(own) / (len(own) - len(names) - 1)
    parts = slopes**2 * normals.var(axis=0)
    parts *= max(0.0, float(own.var()) - left) / max(float(parts.sum()), np.finfo(float).tiny)
    *materials, mesh = (parts / total).tolist()
    method = min(left, float(own.var())) / total
    by_name = dict(zip(names, materials, strict=False))
    return VarianceShares(by_name, mesh, method, max(0.0, 1.0 - mesh - method - sum(materials)))


def _sources(result: Result) -> list[str]:
    """Names by which `standard_normals` draws the strengths of the materials, and last the mesh."""
    dataset, elements = as_dataset(result), node_hits(result, ELEMENTS)
    campaign = json.loads(dataset.attrs.get(attr.INPUTS, "{}"))
    layers = [campaign.get("plate", {}), *campaign.get("layer", ())]
    settings = {} if elements is None else json.loads(elements.attrs.get(attr.CONTINUUM, "{}"))
    behind = layers[settings.get("layers") or len(layers) :] if settings else layers
    settings = settings or campaign.get("continuum", {})
    names = [*settings.get("materials", ()), *(layer.get("material") for layer in behind)]
    return [*dict.fromkeys(filter(None, names)), f"mesh {settings.get('fidelity', 'draft')}"]


def _variance_text(result: Result, measure: Measure) -> str:
    """What the variance of a measure comes from, in percent."""
    shares = variance_shares(result, measure)
    if shares is None:
        return ""
    method = "elements" if has_elements(result) else "law"
    parts = {**shares.materials, "mesh": shares.mesh, method: shares.method, "hits": shares.hits}
    return ", ".join(f"{name} {part:.0%}" for name, part in parts.items() if part >= 0.05)


def width_note(result: Result, measures: Sequence[Measure]) -> list[str]:
    """A sentence on the first wide interval: how many more hits by elements would halve it, or what governs it.

    What elements leave open goes down with the square root of their number. Empty without elements, and where no
    interval is wide, or where the sample of hits governs it.
    """
    elements = node_hits(result, ELEMENTS)
    if elements is None or not has_elements(result):
        return []
    count = int((~failed(elements)).sum())
    for measure, one in estimated(result, measures).items():
        shares = variance_shares(result, measure)
        limit = WIDE_SHARE if measure.is_binary else WIDE * abs(one.value)
        if shares is None or not one.high - one.low > limit:
            continue
        what = "the interval of " + ("this share" if measure.is_binary else f"the mean {measure.column.label}")
        room = 0.25 - (1.0 - shares.method)
        strong = [name for name, part in shares.materials.items() if part >= GOVERNING_STRENGTH]
        if room > 0.0:
            more = math.ceil(count * (shares.method / room - 1.0))
            return [f"About {count_text(more, 'more hit')} by elements would halve {what}."]
        if strong:
            cause = f"Most of {what} is that of the strength of {list_text(strong)}"
            return [f"{cause}: more hits by elements do not halve it."]
    return []
