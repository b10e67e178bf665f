"""Names and distributions in the tables of a file, replaced by numbers: what stands for a threat, a material, a median.

A key beside a name overrides its value.
"""

from collections.abc import Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any

import numpy as np
from pydantic import ValidationError

from warpimpact.errors import CampaignError

from ..catalogue.catalogue import Catalogue
from ..catalogue.entries import Material, Threat
from ..scene import Core, Interaction, Scatter
from ..scene.model import sentence
from ..scene.quantities import SCATTERED
from ..scene.scatter import Distribution
from ..scene.target import layer_name
from ..scene.units import quantity, quoted
from .text import as_campaign_error

Tables = dict[str, Any]
SEARCHED_FROM = 800.0
"""Impact velocity at which a search of limit velocities begins if the threat has none [m/s]."""


def catalogue_of(data: Mapping[str, Any], folder: Path) -> Catalogue:
    """The catalogue of a file: the package's entries, and those in the file that its key `catalogue` names.

    Raises:
        CampaignError: that file cannot be read.
    """
    given = data.get("catalogue")
    if not isinstance(given, str) or not (folder / given).is_file():
        return Catalogue()  # the validation of the campaign refuses a wrong name
    with as_campaign_error("catalogue: "):
        return Catalogue.of(folder / given)


def with_core(data: Tables, catalogue: Catalogue) -> Tables:
    """Tables with the core of their threat, overridden by the keys beside its name.

    Raises:
        CampaignError: the catalogue has no such threat, or does not know its core.
    """
    with as_campaign_error("core.threat: "):
        if (threat := _threat(data, catalogue)) is None:
            return data
        core, base = data["core"], {} if threat.shape is None else threat.shape.model_dump(exclude_unset=True)
        if threat.shape is None and "shape" not in core:
            raise ValueError(
                f'the catalogue knows only velocities of "{threat.name}", no core; give shape and its keys'
            )
    if core.get("shape", base.get("shape")) != base.get("shape"):
        base = {key: value for key, value in base.items() if key in Core.model_fields}
    if any(core.get(key) is not None for key in ("mass", "density")):
        base = {key: value for key, value in base.items() if key not in ("mass", "density")}
    return data | {"core": base | core | {"threat": threat.name}}


def with_bullet(data: Tables, catalogue: Catalogue) -> Tables:
    """Tables with the bullet of their threat, where it is known and the core is that of the threat (`with_core`),
    overridden by the keys of the table bullet."""
    given, threat = data.get("bullet", {}), _threat(data, catalogue)
    if threat is None or threat.bullet is None or threat.shape is None or not isinstance(given, dict):
        return data
    if any(data["core"].get(key) != value for key, value in threat.shape.model_dump(exclude_unset=True).items()):
        return data
    return data | {"bullet": threat.bullet.model_dump(exclude_unset=True) | given}


def _threat(data: Tables, catalogue: Catalogue) -> Threat | None:
    core = data.get("core")
    named = isinstance(core, dict) and isinstance(core.get("threat"), str)
    return catalogue.named(Threat, data["core"]["threat"]) if named else None


def with_velocity(data: Tables, catalogue: Catalogue, *, is_needed: bool = True) -> Tables:
    """Tables with the velocity of their threat by its standard, or its distribution, unless they give one. If none is
    needed, a threat without one gets `SEARCHED_FROM`.

    Raises:
        CampaignError: the entry lacks what is asked for.
    """
    impact, threat = data.get("impact", {}), _threat(data, catalogue)
    if threat is None or not isinstance(impact, dict) or "velocity" in impact:
        return data
    value: Any = SEARCHED_FROM
    standard, known = data["core"].get("standard"), {one.standard: one for one in threat.velocities}
    if known or standard is not None or is_needed:
        with as_campaign_error("core.threat: "):
            if not known:
                raise ValueError(f'the catalogue has no velocity of "{threat.name}"; give impact.velocity')
            if standard is not None and standard not in known:
                raise ValueError(f"got standard = {quoted(standard)}, but it must be one of {', '.join(known)}")
            velocity = threat.velocities[0] if standard is None else known[standard]
            value, tolerance = velocity.value, velocity.tolerance
            if data["core"].get("velocity_tolerance") is True:
                if tolerance is None:
                    raise ValueError(f"the catalogue has no tolerance of {velocity.standard}; give impact.velocity")
                value = {"distribution": "uniform", "low": value - tolerance, "high": value + tolerance}
    return data | {"impact": {"velocity": value} | impact}


def with_materials(data: Tables, catalogue: Catalogue) -> tuple[Tables, dict[int, Material]]:
    """Tables with the numbers of the materials of plate and layers, and with their law.

    Y depends on core, plate, law and shot. So that of the entry stands in the tables of these layers, until
    `resistance_under` computes it from the valid ones.

    Returns:
        The tables, and the material of each layer that takes its Y from the catalogue.

    Raises:
        CampaignError: the catalogue has no such material, or the laws of two materials differ.
    """
    layers, interaction = data.get("layer"), data.get("interaction", {})
    tables = [data.get("plate"), *(layers if isinstance(layers, list) else ())]
    materials, unknown = dict[int, Material](), dict[int, Material]()
    for k, table in enumerate(tables):
        if isinstance(table, dict) and isinstance(table.get("material"), str):
            with as_campaign_error(f"{layer_name(k)}.material: "):
                materials[k] = material = catalogue.named(Material, table["material"])
            unknown |= {} if "resistance" in table else {k: material}
            tables[k] = material.table(table, material.resistance)
    filled = {"plate": tables[0]} if "plate" in data else {}
    filled |= {"layer": tables[1:]} if isinstance(layers, list) else {}
    if not materials or not isinstance(interaction, dict):
        return data | filled, unknown
    law: dict[str, float] = {}  # one for the whole target
    for key in (name for name in Interaction.model_fields if name in Material.model_fields):
        values = {getattr(material, key): layer_name(k) for k, material in materials.items()}
        if len(values) > 1 and key not in interaction:
            several = " and ".join(f"{value:g} ({place})" for value, place in values.items())
            raise CampaignError(f"interaction.{key}: the materials were fitted with {several}; give one value")
        law[key] = next(iter(values))
    return data | filled | {"interaction": law | interaction}, unknown


def with_scatter(data: Tables) -> Tables:
    """Tables with distributions moved to `scatter`, and with their medians in the place of values."""
    data, scatter = deepcopy(data), Tables()
    layers = data.get("layer") if isinstance(data.get("layer"), list) else []
    for field, known in SCATTERED.items():
        behind = [(layer_name(k), table) for k, table in enumerate(layers or [], start=1) if known.by_layer]
        places = [(known.table, data.get(known.table)), *behind]
        drawn = [_taken(table, field, place, k) for k, (place, table) in enumerate(places)]
        if any(drawn):
            scatter[field] = drawn if known.by_layer else drawn[0]
    return data | {"scatter": scatter} if scatter else data


def _taken(table: Any, field: str, place: str, layer: int) -> Distribution | None:
    """Take the distribution of a quantity out of a table, which keeps its median."""
    holder: Any = table
    key: Any = field
    if field.startswith("offset") and isinstance(table, dict):
        holder, key = table.get("offset"), "yz".index(field[-1])
    label = field if holder is table else f"offset[{key}]"
    try:
        entry = holder[key]
    except (TypeError, KeyError, IndexError):
        return None
    if not isinstance(entry, dict):
        return None
    known = SCATTERED[field]
    given = [*[None] * layer, entry] if known.by_layer else entry
    try:
        ((_, distribution),) = Scatter.model_validate({field: given}).given.items()
    except ValidationError as error:
        raise CampaignError(sentence(error, {field: given}, (f"{place}.{label}", 1 + known.by_layer))) from None
    holder[key] = quantity(known.type).as_read(float(distribution.quantile(np.array(0.5))))
    return distribution
