"""Values of a campaign that are probably not meant, with the likely slip (a warning), or cannot be meant (an error)."""

import math
import re
from collections.abc import Iterator, Mapping
from typing import Any

import numpy as np

from ..catalogue.catalogue import Catalogue
from ..catalogue.entries import Threat
from ..scene import Core, Hits, Impact, Plate, Record, Scene, Target
from ..scene.model import Array
from ..scene.quantities import QUANTITIES, USUAL, Bounds, hit_bounds
from ..scene.target import layer_name

Tables = Mapping[str, Any]
Values = Iterator[tuple[str, str, float]]
"""Place, kind and value of bounded quantities."""
_OF_A_PLATE = [name for name in Plate.model_fields if f"plate.{name}" in USUAL and name != "size"]
_STEEL = 7850.0
"""Density of steel [kg/m³]."""
_LIGHT = 5000.0
"""Density below which a plate is no steel [kg/m³]."""
_DENSITY_SHARES = 0.7, 1.3
"""Mass over volume of a core, over the density of its material: shapes are approximate, but a bullet weighs 1.5 cores
and more, and its size gives a core of steel half its density."""
LEAST_EFFECTIVE_SHARE = 0.5
"""Effective thickness over thickness below which a plate that weakens is doubted. The paper's plate has 0.61."""


def check_plausible(
    core: Core,
    target: Target,
    record: Record,
    impact: Impact,
    hits: Hits | None = None,
    catalogue: Catalogue = Catalogue(),  # noqa: B008
    tables: Tables = {},  # noqa: B006
) -> None:
    """Raise a ValueError if a value is beyond what any core or target has. The tables are those of the campaign file,
    as written."""
    for complaint in _complaints(USUAL, _values(core, target, record, impact, hits), tables, usual=False):
        raise ValueError(complaint)
    if core.density is None:
        _check_masses(core, (hits and hits.listed) or {}, catalogue.all(Threat).get(str(core.threat)))


def _check_masses(core: Core, listed: Mapping[str, Array], threat: Threat | None) -> None:
    """Refuse masses of a core that is neither of steel nor of the material of its threat, such as that of a bullet."""
    name, density = "steel", _STEEL
    if threat is not None and threat.core_density is not None:
        name, density = f"the core of {threat.name}", threat.core_density
    lightest, heaviest = (share * density for share in _DENSITY_SHARES)
    masses = {"core.mass": [core.mass_properties.mass]}
    if "mass" in listed:
        masses["hits.file, column mass"] = [listed["mass"].min(), listed["mass"].max()]
    for place, mass in ((place, float(mass)) for place, several in masses.items() for mass in several):
        if not lightest <= mass / core.volume <= heaviest:
            raise ValueError(
                f"{place}: got {1e3 * mass:.4g} g for a core of {1e9 * core.volume:.4g} mm³, which is "
                f"{mass / core.volume:.0f} kg/m³, but {lightest:.0f} to {heaviest:.0f} kg/m³ is allowed: {name} has "
                f"{density:.0f}; give the mass of the core, without jacket and filler, or for another material "
                "core.density in place of core.mass"
            )


def implausible_notes(scene: Scene, impact: Impact, hits: Hits, tables: Tables) -> Iterator[str]:
    """Sentences about values that are possible but unusual. The tables are those of the campaign file, as written."""
    plate = scene.target.layers[0]
    bounds = USUAL | {"hits": hit_bounds(plate.sampled_cell, plate.size)}
    values = _values(scene.core, scene.target, scene.record, impact, hits)
    yield from _complaints(bounds, values, tables, usual=True)
    for place, plate in scene.target.named:
        share = effective_thickness(plate, impact.velocity) / plate.thickness
        if share < LEAST_EFFECTIVE_SHARE:
            yield (
                f"{place}: weakens so fast that only {share:.0%} of its {1e3 * plate.thickness:.3g} mm resist a core "
                f"at {impact.velocity:.4g} m/s, and a thicker one would resist hardly more. Weakening was only fitted "
                "to 4 mm at 825 m/s; degradation = 1 suits thicker plates and slower cores"
            )


def effective_thickness(plate: Plate, velocity: float) -> float:
    """Thickness [m] without weakening that takes as much from a core at this velocity [m/s].

    It holds for a solid plate that is hit normally, if the speed hardly changes (docs/model.md §4.8).
    """
    if plate.degradation in (0.0, 1.0):
        return plate.degradation * plate.thickness
    way = plate.degradation_unit * (velocity if plate.degradation_distance is None else 1.0)
    decay = -math.log(plate.degradation) / way
    return (1.0 - math.exp(-decay * plate.thickness)) / decay


def _complaints(bounds: Mapping[str, Bounds], values: Values, tables: Tables, *, usual: bool) -> Iterator[str]:
    for place, kind, value in values:
        has_unit = _has_unit(tables, place, kind)
        if kind in bounds and (sentence := bounds[kind].complaint(place, value, usual=usual, has_unit=has_unit)):
            yield sentence


def _has_unit(tables: Tables, place: str, kind: str) -> bool:
    """Whether a value was written with its unit; for one that follows from a table, all values of it."""
    table, *keys = kind.split(".")
    layer = re.match(r"layer (\d+)", place)
    written: Any = tables["layer"][int(layer[1]) - 1] if layer and "layer" in tables else tables.get(table)
    for key in keys:
        written = written.get(key, written) if isinstance(written, dict) else written
    return written is not None and not place.startswith("hits.file") and not _has_number(written)


def _has_number(written: Any) -> bool:
    """Whether a value of a file has a number without a unit."""
    if isinstance(written, dict | list):
        return any(map(_has_number, written.values() if isinstance(written, dict) else written))
    return isinstance(written, int | float) and not isinstance(written, bool)


def _values(core: Core, target: Target, record: Record, impact: Impact, hits: Hits | None) -> Values:
    """Place, kind and value of every bounded quantity."""
    yield "core: length", "core.length", core.length
    yield "core: largest diameter", "core.diameter", 2.0 * core.max_radius
    yield "core: mass", "core.mass", core.mass_properties.mass
    if core.density is not None:
        yield "core.density", "core.density", core.density
    for place, plate in target.named:
        for name in _OF_A_PLATE:
            if getattr(plate, name) is not None:
                light = ".light" if name == "thickness" and plate.density < _LIGHT else ""
                yield f"{place}.{name}", f"plate.{name}{light}", getattr(plate, name)
        for side in plate.size or ():
            yield f"{place}.size", "plate.size", side
        if plate.open_area > 0.0:
            for side in plate.pattern.period:
                yield f"{place}.pattern: cell", "plate.pattern.cell", side
            if math.isfinite(plate.ligament):
                yield f"{place}.pattern: smallest ligament", "plate.pattern.ligament", plate.ligament
            yield f"{place}.pattern.rotation", "plate.pattern.rotation", getattr(plate.pattern, "rotation", 0.0)
    for k, gap in enumerate(target.gaps[1:], start=1):
        yield f"{layer_name(k)}.gap", "layer.gap", gap
    for name, value in impact:
        yield f"impact.{name}", f"impact.{name}", value
    for standoff in record.standoffs:
        yield "output.standoffs", "output.standoffs", standoff
    for name, column in ((hits and hits.listed) or {}).items():
        of_hits, sizes = QUANTITIES[name].table == "hits", np.abs(column)
        kind = "hits" if of_hits else f"{QUANTITIES[name].table}.{name}"
        ends = [sizes.argmax()] if of_hits else [sizes.argmax(), sizes.argmin()]  # hits may be near the origin
        for value in dict.fromkeys(float(column[end]) for end in ends):
            yield f"hits.file, column {name}", kind, value
