"""The attributes of a result: its campaign, and how it was computed."""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.resistances import catalogue_names
from warpimpact.campaign.tested_range import outside_tested_range
from warpimpact.records.outcomes import Outcomes
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import to_table
from warpimpact.results.table import HitTable
from warpimpact.scene import Accuracy, Impact, Numerics, Shots, Target
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.solver.accuracy import UNITS, PilotResult
from warpimpact.solver.device import find_device
from warpimpact.solver.materials import weakens
from warpimpact.solver.resolution import Resolution, resolve

if TYPE_CHECKING:
    from warpimpact.results.table import Result


def described(
    campaign: Campaign,
    shots: Shots,
    pilot: PilotResult | None,
    outcomes: Outcomes,
    numerics: Numerics,
    computed: tuple[str, float],
    attributes: Mapping[str, Any],
) -> HitTable:
    """The columns of shots with their outcomes.

    Args:
        pilot: of the campaign; None if it fixes the resolution.
        computed: the device, and the time [s].
        attributes: attributes of this kind of computation.
    """
    resolution = resolve(campaign.scene, numerics, weakens(campaign.target, shots))
    names, finer = catalogue_names(campaign), dict[str, Any]()
    if pilot is not None and pilot.finer is not None and pilot.numbers is not None:
        stored = {name: of_hits for name, of_hits in v.FINER_VARIABLES.items() if of_hits in pilot.finer}
        finer = {v.FINER_HIT: pilot.numbers[: len(pilot.finer)].astype("int32")}
        finer |= {name: getattr(pilot.finer, of_hits) for name, of_hits in stored.items()}
    every = {
        **_numerics(campaign.numerics, campaign.impact, campaign.target, resolution),
        **({attr.CATALOGUE_NAMES: "\n".join(names)} if names else {}),
        attr.OUTSIDE_TESTED_RANGE: json.dumps(outside_tested_range(campaign), ensure_ascii=False),
        **computed_by(campaign, computed[0], len(outcomes), computed[1]),
        **_pilot(campaign.numerics.asked, pilot),
        **attributes,
    }
    return described_as(campaign, shots, outcomes, every, double=is_double(campaign), finer=finer)


def described_as(
    campaign: Campaign,
    shots: Shots,
    outcomes: Outcomes,
    attributes: Mapping[str, Any],
    *,
    double: bool,
    finer: Mapping[str, Any] | None = None,
) -> HitTable:
    """The columns of shots of a campaign with the outcomes of all of them, and attributes that do not follow from the
    campaign alone."""
    return to_table(
        campaign.scene,
        shots,
        outcomes,
        period=campaign.sampler().cell,
        attributes={**_campaign(campaign), **attributes},
        double=double,
        finer=finer,
        left_out=() if campaign.output.exit_state else v.EXIT_VARIABLES,
    )


def is_double(campaign: Campaign) -> bool:
    """Whether a campaign is computed, and stored, in double precision."""
    return campaign.numerics.precision == "double"


def computed_by(campaign: Campaign, device: str, computed: int, elapsed: float) -> dict[str, Any]:
    """Attributes on versions, device, symmetries, and time [s] of this number of shots."""
    chosen = find_device(device)
    attributes = {
        **attr.versions(),
        **attr.machine(),
        attr.DEVICE: f"{chosen.alias} ({chosen.name})",
        attr.COMPUTE_TIME: elapsed,
        attr.HITS_PER_SECOND: computed / elapsed,
    }
    if campaign.hits.irreducible:
        attributes[attr.SYMMETRIES] = "; ".join(map(str, campaign.symmetries))
    return attributes


def _pilot(asked: Accuracy, pilot: PilotResult | None) -> dict[str, Any]:
    """Attributes on the accuracy that a pilot was to reach, and on its result; none without a pilot."""
    if pilot is None:
        return {}
    bounds = {name: getattr(asked, name) for name in Accuracy.model_fields}
    given = {name: value for name, value in bounds.items() if value is not None and math.isfinite(value)}
    return {
        attr.RESOLUTION: pilot.numerics.model_dump_json(),
        attr.PROMISE_KEPT: int(pilot.kept),
        attr.ACCURACY: json.dumps(given),
        **pilot.errors,
    }


def pilot_in(result: Result) -> PilotResult | None:
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


def made_by(device: str) -> dict[str, str]:
    """Versions and kind of device: with the campaign, they determine the bits of a result."""
    chosen = find_device(device)
    return {**attr.versions(), attr.DEVICE: "cpu" if chosen.is_cpu else chosen.name}


def _campaign(campaign: Campaign) -> dict[str, Any]:
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
    attributes |= {} if campaign.hits.count is None else {attr.COUNT: campaign.hits.count}
    if campaign.layer:
        attributes[attr.LAYERS] = _layers(campaign)
        attributes[attr.ADD_ON_DENSITY] = campaign.target.weights["add-on"]
    attributes |= {attr.LIGAMENT: ligament} if math.isfinite(ligament) else {}
    return attributes


def _material(campaign: Campaign) -> str:
    """The resistance of the plate as JSON: its material and the law of its stress."""
    of_plate = campaign.plate.model_dump(exclude={"thickness", "size", "margin", "pattern"})
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
        attr.NUMERICS: f"{_asked(numerics)}, {numerics.scheme} scheme, "
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


def _asked(numerics: Numerics) -> str:
    """What determined the resolution."""
    if numerics.explicit is None:
        return "accuracy in numbers" if numerics.accuracy is not None else f"{numerics.fidelity} fidelity"
    if numerics.level is None:
        return "given resolution"
    return f"level {numerics.level}"
