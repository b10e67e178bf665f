"""What a person sees of a search of limits: every hit of a short list, measures, references, and the cost."""

from __future__ import annotations

import json
from collections.abc import Iterator, Sequence

import numpy as np
import pandas as pd
import xarray
from pydantic import TypeAdapter

from warpimpact.analysis.effectiveness import reference_name
from warpimpact.analysis.estimates import estimated, measures_named
from warpimpact.analysis.inspection import numerics_note
from warpimpact.analysis.numbers import View, interval_text
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.measures import NAMES, Measure
from warpimpact.results.references import reference
from warpimpact.results.vocabulary import needed_density
from warpimpact.scene import AnyCore, Core
from warpimpact.scene.model import Array
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.scene.units import quantity as reader_of
from warpimpact.solver.accuracy import errors_text, share_text
from warpimpact.solver.limit import MOST_RUNS

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
    return measures_named(dataset, texts, list(NAMES))


def limit_view(dataset: xarray.Dataset, texts: Sequence[str] = ()) -> View:
    """Every hit of a short list, or the measures of a search; its references; notes.

    Args:
        texts: texts of measures, which are also shown for a short list; by default as in `measures_of`.
    """
    quantity = dataset.attrs[attr.LIMIT]
    short = len(dataset[v.LIMITS[quantity].value]) <= _MOST_LISTED
    view: dict[str, list[str | pd.DataFrame]] = {f"limit {quantity}": [_hits(dataset)] if short else []}
    if short and (table := proxy(dataset)) is not None:
        view["proxy: energy over presented area and resistance, as a depth, and its ratio to the limit"] = [table]
    if texts or not short:
        view["measures"] = [_estimates(dataset, texts)]
    view["references and notes"] = [*_left_out(dataset), *_expected(dataset), *_references(dataset)]
    return view | {"cost and accuracy": list(_costs(dataset))}


def in_short(dataset: xarray.Dataset) -> str:
    """A sentence with V50 and V05, or H50 and H05, and their intervals; for a short list the range of its limits."""
    quantity = dataset.attrs[attr.LIMIT]
    unit, factor = shown_unit(quantity)
    values = factor * dataset[v.LIMITS[quantity].value].values
    known = values[np.isfinite(values)]
    if len(values) <= _MOST_LISTED:
        ends = f"{known.min():.5g} to {known.max():.5g} {unit}" if len(known) else "not found"
        return f"limit {quantity} of {len(values)} hits: {ends}"
    return ", ".join(
        f"{measure.text} {estimate.value:.5g} {unit} ({interval_text(estimate.low, estimate.high, digits='.5g')})"
        for measure, estimate in estimated(dataset, measures_of(dataset)).items()
    )


def _hits(dataset: xarray.Dataset) -> pd.DataFrame:
    """Every hit with its limit and the two ends that enclose it."""
    quantity = dataset.attrs[attr.LIMIT]
    unit, factor = shown_unit(quantity)
    columns = {"obliquity [°]": [f"{angle:.4g}" for angle in dataset[v.OBLIQUITY].values]}
    for head, name in zip((f"limit {quantity}", "lower end", "upper end"), v.LIMITS[quantity], strict=False):
        columns[f"{head} [{unit}]"] = [f"{number:.5g}" for number in factor * dataset[name].values]
    return pd.DataFrame(columns).rename_axis("hit")


def _estimates(dataset: xarray.Dataset, texts: Sequence[str]) -> pd.DataFrame:
    """Measures with their intervals."""
    rows = {
        measure.text: {
            "value": f"{estimate.value:.5g}",
            "95 % interval": interval_text(estimate.low, estimate.high, estimate.numerics, ".5g"),
            "meaning": measure.title,
        }
        for measure, estimate in estimated(dataset, measures_of(dataset, texts)).items()
    }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("measure")


def _left_out(dataset: xarray.Dataset) -> Iterator[str]:
    """Hits without a limit, and limits that are less accurate than required."""
    attributes, quantity = dataset.attrs, dataset.attrs[attr.LIMIT]
    unit, factor = shown_unit(quantity)
    value, _, _, _, converged = (dataset[name].values for name in v.LIMITS[quantity])
    if failed := int(np.isnan(value).sum()):
        yield f"{failed} hits failed, and count in none of these numbers"
    if beyond := int(np.isposinf(value).sum()):
        yield f"{beyond} hits have no limit {quantity} up to {factor * attributes[attr.LIMIT_HIGHEST]:g} {unit}"
    if untouched := int((value == 0.0).sum()):
        yield f"{untouched} hits touch no material"
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
    yield numerics_note(dataset)


def _references(dataset: xarray.Dataset) -> Iterator[str]:
    """The limits of the solid reference and of the base alone; empty without them."""
    quantity, density = dataset.attrs[attr.LIMIT], float(dataset.attrs[attr.AREAL_DENSITY])
    if (solid := reference(dataset, "solid")) is not None:
        limit, hits = _mean_text(solid, quantity), solid.sizes["hit"]
        if quantity == "thickness":
            needed = float(np.nanmean(needed_density(solid, 0.0)))
            limit += f", {needed:.4g} kg/m² (the target as given has {density:.4g} kg/m²)"
        else:
            limit += f", of {density:.4g} kg/m² as the target"
        cost = f"{hits} hit{'s' if hits > 1 else ''} searched in {float(solid.attrs[attr.COMPUTE_TIME]):.2g} s"
        yield f"{reference_name(dataset)}: limit {quantity} {limit}; {cost}"
    if (alone := reference(dataset, "base_alone")) is not None:
        yield f"base alone: limit {quantity} {_mean_text(alone, quantity)}"


def _mean_text(of_reference: xarray.Dataset, quantity: str) -> str:
    """The mean limit of a reference."""
    unit, factor = shown_unit(quantity)
    value = of_reference[v.LIMITS[quantity].value].values
    return f"{factor * float(np.nanmean(value)):.5g} {unit}" + (", mean" if len(value) > 1 else "")


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


def proxy(dataset: xarray.Dataset) -> pd.DataFrame | None:
    """The proxy of every hit: kinetic energy over presented area and resistance, as a depth, and its ratio to the
    limit thickness; None where the target is not one solid plate whose limit thickness is known."""
    attributes, limit = dataset.attrs, v.LIMITS["thickness"].value
    needed = {attr.CORE, attr.MATERIAL, attr.OPEN_AREA}
    if not needed <= attributes.keys() or limit not in dataset:
        return None
    if attributes[attr.OPEN_AREA] > 0.0 or v.LAYER_STATUS in dataset:
        return None
    core: Core = TypeAdapter[Core](AnyCore).validate_json(attributes[attr.CORE])
    resistance = dataset.get(v.RESISTANCE, json.loads(attributes[attr.MATERIAL])["resistance"])
    mass = dataset.get(v.MASS, core.mass_properties.mass)
    tilt = inclination(dataset)
    energy = 0.5 * np.asarray(mass) * dataset[v.IMPACT_VELOCITY].values ** 2
    depth = energy / (core.presented_area(tilt) * np.asarray(resistance, dtype=np.float64))
    columns = {"inclination [°]": np.degrees(tilt), "proxy [mm]": 1e3 * depth, "ratio": depth / dataset[limit].values}
    return pd.DataFrame(columns).rename_axis("hit")


def inclination(dataset: xarray.Dataset) -> Array:
    """Angle between the axis and the line of fire [rad]. The projected angles of the axis add to those of the line."""
    names = (v.OBLIQUITY, v.AZIMUTH, v.IMPACT_PITCH, v.IMPACT_YAW)
    obliquity, azimuth, pitch, yaw = (np.radians(dataset[name].values) for name in names)
    along_y, along_z = np.tan(obliquity) * np.cos(azimuth), np.tan(obliquity) * np.sin(azimuth)
    ones = np.ones_like(obliquity)
    flight = np.stack([ones, along_y, along_z], axis=-1)
    axis = np.stack([ones, np.tan(np.arctan(along_y) + yaw), np.tan(np.arctan(along_z) + pitch)], axis=-1)
    across = np.linalg.norm(np.cross(axis, flight), axis=-1)
    return np.asarray(np.arctan2(across, (axis * flight).sum(axis=-1)))
