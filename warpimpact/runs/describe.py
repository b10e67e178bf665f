"""The attributes of a result: its campaign, and how it was computed."""

from __future__ import annotations

import json
import math
from typing import Any

import xarray

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.evidence import catalogue_names, limit_velocity_factors, outside_tested_range
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import stored_columns
from warpimpact.scene import Accuracy, Impact, Numerics, Target
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.solver.accuracy import UNITS, PilotResult
from warpimpact.solver.limit import LimitSpec
from warpimpact.solver.materials import weakens
from warpimpact.solver.resolution import Resolution, resolve


def described(
    dataset: xarray.Dataset,
    campaign: Campaign,
    numerics: Numerics,
    pilot: PilotResult | None = None,
    limit: LimitSpec | None = None,
) -> xarray.Dataset:
    """The first hits of a result with the attributes of the whole.

    Args:
        numerics: those of the hits, which fix the resolution.
        pilot: of the campaign; None if it fixes the resolution.
        limit: the limit of every hit that was searched.
    """
    shots = campaign.sampler().shots(0, dataset.sizes["hit"])
    resolution = resolve(campaign.scene, numerics, weakens(campaign.target, shots))
    attributes = {
        **campaign_attributes(campaign),
        **_numerics(campaign.numerics, campaign.impact, campaign.target, resolution),
        attr.OUTSIDE_TESTED_RANGE: json.dumps(outside_tested_range(campaign), ensure_ascii=False),
        **_pilot(campaign.numerics.required, pilot),
        **({} if limit is None else _limit(campaign, limit)),
    }
    if names := catalogue_names(campaign):
        attributes[attr.CATALOGUE_NAMES] = "\n".join(names)
    if pilot is not None and pilot.finer is not None and pilot.numbers is not None:
        stored = {name: of_hits for name, of_hits in v.FINER_VARIABLES.items() if of_hits in pilot.finer}
        finer: dict[str, Any] = {v.FINER_HIT: pilot.numbers[: len(pilot.finer)].astype("int32")}
        finer |= {name: getattr(pilot.finer, of_hits) for name, of_hits in stored.items()}
        single = () if campaign.numerics.precision == "double" else v.computed_variables()
        dataset = dataset.assign_coords(stored_columns((name for name in v.FINER if name in finer), finer, single))
    return dataset.assign_attrs(attr.with_units(attributes))


def _limit(campaign: Campaign, limit: LimitSpec) -> dict[str, Any]:
    """Attributes on the limits that were searched."""
    attributes = {
        attr.HISTORY: attr.history_line(f"limit --quantity {limit.quantity}"),
        attr.LIMIT: limit.quantity,
        attr.LIMIT_LAYER: limit.layer,
        attr.LIMIT_TOLERANCE: limit.tolerance,
        attr.LIMIT_HIGHEST: limit.highest,
    }
    if limit.quantity == "thickness":  # from it follows the areal density of the target
        layer = campaign.target.layers[limit.layer]
        attributes[attr.LIMIT_DENSITY] = layer.areal_density / layer.thickness
        attributes[attr.LIMIT_ELSEWHERE] = campaign.target.areal_density - layer.areal_density
    elif (factors := limit_velocity_factors(campaign)) is not None:
        attributes[attr.LIMIT_FACTORS] = list(factors)
    return attributes


def _pilot(bounds_wanted: Accuracy, pilot: PilotResult | None) -> dict[str, Any]:
    """Attributes on the accuracy that a pilot was to reach, and on its result; none without a pilot."""
    if pilot is None:
        return {}
    bounds = {name: getattr(bounds_wanted, name) for name in Accuracy.model_fields}
    given = {name: value for name, value in bounds.items() if value is not None and math.isfinite(value)}
    return {
        attr.RESOLUTION: pilot.numerics.model_dump_json(),
        attr.PROMISE_KEPT: int(pilot.kept),
        attr.ACCURACY: json.dumps(given),
        **pilot.errors,
    }


def pilot_in(result: xarray.Dataset) -> PilotResult | None:
    """The pilot of a result; None if its campaign fixed the resolution."""
    attributes = result.attrs
    if attr.RESOLUTION not in attributes:
        return None
    return PilotResult(
        Numerics.model_validate_json(attributes[attr.RESOLUTION]),
        bool(attributes[attr.PROMISE_KEPT]),
        float(json.loads(attributes[attr.ACCURACY])["share"]),
        {name: float(attributes[name]) for name in UNITS if name in attributes},
    )


def campaign_attributes(campaign: Campaign) -> dict[str, Any]:
    """Attributes that follow from a campaign alone."""
    ligament, scatter = campaign.plate.ligament, campaign.scatter.given.items()
    # Impact quantities with their value or distribution, and the distribution of the core's mass.
    scattered = {name: law.model_dump() for (name, _), law in scatter if not QUANTITIES[name].by_layer}
    attributes = {
        attr.TITLE: campaign.title,
        attr.HISTORY: attr.history_line("run"),
        attr.CAMPAIGN: campaign.text,
        attr.SAMPLING: campaign.hits.sampling,
        attr.SEED: campaign.hits.seed,
        attr.REPLICATES: campaign.replicates,
        attr.STANDOFF_POINT: campaign.output.standoff_point,
        attr.OPEN_AREA: campaign.plate.open_area,
        attr.AREAL_DENSITY: campaign.target.areal_density,
        attr.CORE: campaign.core.model_dump_json(),
        attr.PLATE: json.dumps(campaign.plate.model_dump(mode="json")),
        attr.IMPACT: json.dumps(dict(campaign.impact) | scattered),
        attr.MATERIAL: _material(campaign),
        attr.FAILED_SHARE: campaign.output.failed_share,
    }
    if campaign.hits.irreducible:
        attributes[attr.SYMMETRIES] = "; ".join(map(str, campaign.symmetries))
    attributes |= {} if campaign.hits.count is None else {attr.COUNT: campaign.hits.count}
    if campaign.layer:
        attributes[attr.LAYERS] = _layers(campaign)
        attributes[attr.ADD_ON_DENSITY] = campaign.target.weights["add-on"]
    attributes |= {attr.LIGAMENT: ligament} if math.isfinite(ligament) else {}
    return attributes


def _material(campaign: Campaign) -> str:
    """The resistance of the plate as JSON: its material and the law of its stress."""
    of_plate = campaign.plate.model_dump(exclude={"thickness", "size", "pattern"})
    law = campaign.interaction.model_dump(exclude={"free_surface"})
    free = campaign.interaction.free_surface
    of_surfaces = {} if free is None else {f"free_surface.{key}": value for key, value in free.model_dump().items()}
    return json.dumps(of_plate | law | of_surfaces)


def _layers(campaign: Campaign) -> str:
    """The layers behind the plate as JSON: each by its number, with its scattered quantities."""
    layers = {str(k + 1): json.loads(layer.model_dump_json()) for k, layer in enumerate(campaign.layer)}
    for (name, k), given in campaign.scatter.given.items():
        if k:
            layers[str(k)][name] = given.model_dump()
    return json.dumps(layers)


def _numerics(numerics: Numerics, impact: Impact, target: Target, resolution: Resolution) -> dict[str, Any]:
    """The numerics as given, and as used with every choice made: as a line of text and as numbers."""
    precision = "double" if resolution.double else "single"
    return {
        attr.NUMERICS: f"{_wanted(numerics)}, {numerics.scheme} scheme, "
        f"time_step {resolution.step_in(impact, target):.4g} s, "
        f"patches_axial {resolution.patches_axial}, patches_around {resolution.patches_around}, "
        f"grid_spacing {resolution.grid_spacing:.4g} m, precision {precision}",
        attr.NUMERICS_GIVEN: json.dumps(dict(numerics), default=lambda accuracy: accuracy.model_dump()),
        attr.PRECISION: precision,
        attr.PATCHES_AXIAL: resolution.patches_axial,
        attr.PATCHES_AROUND: resolution.patches_around,
        attr.GRID_SPACING: resolution.grid_spacing,
        attr.TIME_STEP: resolution.step_of(impact, target.layers[0]),
    }


def _wanted(numerics: Numerics) -> str:
    """What determined the resolution."""
    if numerics.explicit is None:
        return "accuracy in numbers" if numerics.accuracy is not None else f"{numerics.fidelity} fidelity"
    if numerics.level is None:
        return "given resolution"
    return f"level {numerics.level}"
