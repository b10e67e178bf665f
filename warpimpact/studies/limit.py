"""The limits of a campaign: the impact velocity at which each core just passes, or the thickness that it passes."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Sequence
from pathlib import Path
from statistics import NormalDist

import numpy as np
import pandas as pd
import xarray

from warpimpact.analysis.effectiveness import reference_name
from warpimpact.analysis.inspection import numerics_note
from warpimpact.analysis.numbers import View, interval_text
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import as_campaign_error
from warpimpact.measures.estimates import estimated, measures_named
from warpimpact.measures.measure import NAMES, Measure
from warpimpact.measures.references import Result, as_dataset, reference
from warpimpact.measures.vocabulary import LIMIT_VELOCITY, needed_density
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.runs.compute import limit_of
from warpimpact.runs.options import RunOptions
from warpimpact.runs.run import run
from warpimpact.scene.model import Array
from warpimpact.scene.rigid import angle_between, axis_on_impact, line_of_flight
from warpimpact.scene.units import count_text
from warpimpact.solver.accuracy import errors_text, share_text
from warpimpact.solver.limit import MOST_RUNS

_MOST_LISTED = 12
UNITS = {"velocity": ("m/s", 1.0), "thickness": ("mm", 1e3)}
"""Display unit of a limit, and the factor to it."""


def limit(
    campaign: Campaign | str | Path,
    quantity: str = "velocity",
    *,
    layer: int = 0,
    tolerance: float | None = None,
    references: bool = False,
    options: RunOptions = RunOptions(),
) -> xarray.DataTree:
    """The limit velocity, or the limit thickness of a layer, of every hit of a campaign.

    `compare` ranks such results, and V50 is `limit(...).limit_velocity.quantile(0.5)`.

    Args:
        campaign: the campaign, or its file.
        quantity, layer, tolerance: as in `limit_of`.
        references, options: as in `run`.

    Returns:
        The result of `run`, of the slowest shots that pass, with `limit_velocity` [m/s] or `limit_thickness` [m].

    Raises:
        CampaignError: the campaign has no limits, or this search cannot find them.
        DeviceError, ClusterError, Cancelled: as in `run`.
    """
    if not isinstance(campaign, Campaign):
        campaign = Campaign.from_toml(campaign, needs_velocity=quantity != "velocity")
    spec = limit_of(campaign, quantity, tolerance, layer)
    return run(campaign, limit=spec, references=references, options=options)


def check_measures(texts: Sequence[str], quantity: str) -> None:
    """Refuse measures that a search of limits of this quantity does not give.

    Raises:
        CampaignError: the message names the measure.
    """
    for text in texts:
        with as_campaign_error("--measure: "):
            measure = Measure.parse(text)
            if not measure.is_limit or (measure.quantity.need is LIMIT_VELOCITY) != (quantity == "velocity"):
                raise ValueError(f"{text} does not follow from each hit's limit {quantity}")


def limit_view(result: Result, texts: Sequence[str] = ()) -> View:
    """Every hit of a short list, or the measures of a search; its references; notes.

    Args:
        texts: texts of measures, which are also shown for a short list; by default V50 and V05, or H50 and H05.

    Raises:
        ResultError: a text is no measure, or the result lacks what it needs.
    """
    dataset = as_dataset(result)
    quantity = dataset.attrs[attr.LIMIT]
    short = len(dataset[v.LIMITS[quantity].value]) <= _MOST_LISTED
    view: dict[str, list[str | pd.DataFrame]] = {f"limit {quantity}": [_hits(dataset)] if short else []}
    if texts or not short:
        rows = {
            measure.text: {
                "value": f"{estimate.value:.5g}",
                "95 % interval": interval_text(estimate.low, estimate.high, estimate.numerics, ".5g"),
                "meaning": measure.title,
            }
            for measure, estimate in estimated(result, measures_named(dataset, texts, [*NAMES])).items()
        }
        view[f"measures, by {count_text(dataset.sizes[v.HIT], 'hit')}"] = [
            pd.DataFrame.from_dict(rows, orient="index").rename_axis("measure")
        ]
    view["references and notes"] = [*_left_out(dataset), *_references(result)]
    runs = dataset[v.LIMITS[quantity].runs].values
    cost = f"{runs.mean():.2g} runs of a hit on average, {runs.max()} at most"
    at = {"velocity": "V50", "thickness": "H50"}[quantity]
    law = (
        "By the fast law. Finite elements correct a map, not a limit: each hit would take some six of them near "
        f"arrest. To check: warpimpact run at the {at} with --elements 16; half of the cores should pass."
    )
    return view | {"cost and accuracy": [cost, accuracy_line(dataset), numerics_note(result), law]}


def limit_sentence(result: Result) -> str:
    """A sentence with V50 and V05, or H50 and H05, and their intervals."""
    dataset = as_dataset(result)
    unit, _ = UNITS[dataset.attrs[attr.LIMIT]]
    texts = (
        f"{measure.text} {estimate.value:.5g} {unit} ({interval_text(estimate.low, estimate.high, digits='.5g')})"
        for measure, estimate in estimated(result, measures_named(dataset, (), [*NAMES])).items()
    )
    return f"{', '.join(texts)}, by {count_text(dataset.sizes[v.HIT], 'hit')}"


def _hits(dataset: xarray.Dataset) -> pd.DataFrame:
    """Every hit with its limit and the two ends that enclose it."""
    quantity = dataset.attrs[attr.LIMIT]
    unit, factor = UNITS[quantity]
    columns = {"obliquity [°]": [f"{angle:.4g}" for angle in dataset[v.OBLIQUITY].values]}
    for head, name in zip((f"limit {quantity}", "lower end", "upper end"), v.LIMITS[quantity], strict=False):
        columns[f"{head} [{unit}]"] = [f"{number:.5g}" for number in factor * dataset[name].values]
    return pd.DataFrame(columns).rename_axis("hit")


def _left_out(dataset: xarray.Dataset) -> Iterator[str]:
    """Hits without a limit, less accurate limits, and where a test would find the limit velocity."""
    attributes, quantity = dataset.attrs, dataset.attrs[attr.LIMIT]
    unit, factor = UNITS[quantity]
    value, _, _, _, converged = (dataset[name].values for name in v.LIMITS[quantity])
    if failed := int(np.isnan(value).sum()):
        yield f"{count_text(failed, 'hit')} failed, left out of these numbers"
    if beyond := int(np.isposinf(value).sum()):
        highest = f"{factor * attributes[attr.LIMIT_HIGHEST]:g} {unit}"
        yield f"{count_text(beyond, 'hit')} without a limit {quantity} up to {highest}"
    if untouched := int((value == 0.0).sum()):
        yield f"no material is touched by {count_text(untouched, 'hit')}"
    if open_ := int((converged == 0).sum()) - failed:
        tolerance = f"{factor * attributes[attr.LIMIT_TOLERANCE]:g} {unit}"
        yield f"{count_text(open_, 'hit')} not found to {tolerance} in {MOST_RUNS} runs"
    known = value[np.isfinite(value)]
    if attr.LIMIT_DEVIATION in attributes:
        share = math.expm1(NormalDist().inv_cdf(0.975) * float(attributes[attr.LIMIT_DEVIATION]))
        yield f"the material's resistance leaves limits open by ± {share:.0%} (95 %), which the intervals hold"
    if attr.LIMIT_FACTORS in attributes and len(known):
        low, high = (float(np.median(known)) * float(factor) for factor in attributes[attr.LIMIT_FACTORS])
        yield f"a test of this material is expected between {low:.4g} and {high:.4g} m/s (90 %): tests scatter, too"


def _references(result: Result) -> Iterator[str]:
    """The limits of the solid reference and of the base alone; empty without them."""
    dataset = as_dataset(result)
    quantity, density = dataset.attrs[attr.LIMIT], float(dataset.attrs[attr.AREAL_DENSITY])
    unit, factor = UNITS[quantity]
    for name, label in (("solid", reference_name(dataset)), ("base_alone", "base alone")):
        if (one := reference(result, name)) is None:
            continue
        value, hits = one[v.LIMITS[quantity].value].values, one.sizes["hit"]
        text = f"{label}: limit {quantity} {factor * float(np.nanmean(value)):.5g} {unit}" + ", mean" * (hits > 1)
        if name == "solid":
            weight = f"of {density:.4g} kg/m² as the target"
            if quantity == "thickness":
                needed = float(np.nanmean(needed_density(one, 0.0)))
                weight = f"{needed:.4g} kg/m² (the target as given has {density:.4g} kg/m²)"
            text += f", {weight}; {count_text(hits, 'hit')} searched in {float(one.attrs[attr.COMPUTE_TIME]):.2g} s"
        yield text


def accuracy_line(dataset: xarray.Dataset) -> str:
    """A line with the estimated error of the limits."""
    attributes = dataset.attrs
    unit, factor = UNITS[attributes[attr.LIMIT]]
    of_layer = f"thickness of layer {attributes[attr.LIMIT_LAYER]}; " if attributes[attr.LIMIT_LAYER] else ""
    ends = f"{of_layer}ends of a limit at most {factor * attributes[attr.LIMIT_TOLERANCE]:g} {unit} apart"
    if attr.RESOLUTION not in attributes:
        return f"{ends}; the error of the numerics is not known, because the campaign fixes the resolution"
    kept = "" if attributes[attr.TOLERANCE_MET] else ", more than the tolerance"
    hits = share_text(json.loads(attributes[attr.ACCURACY])["share"])
    return f"{ends}; against a finer level {hits} are within {errors_text(attributes)}{kept}"


def inclination(dataset: xarray.Dataset) -> Array:
    """Angle between the axis and the line of fire [rad]. The projected angles of the axis add to those of the line."""
    names = (v.OBLIQUITY, v.AZIMUTH, v.IMPACT_PITCH, v.IMPACT_YAW)
    shots = zip(*(np.radians(dataset[name].values) for name in names), strict=True)
    lines = ((line_of_flight(*angles), pitch, yaw) for *angles, pitch, yaw in shots)
    return np.array([angle_between(axis_on_impact(flight, pitch, yaw), flight) for flight, pitch, yaw in lines])
