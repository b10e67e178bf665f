"""Where limit velocities have shown the model to fail, or have not tested it: a sentence with its figure each
(docs/validation.md)."""

from __future__ import annotations

import json
import math
from collections.abc import Iterator, Mapping
from functools import cache
from typing import TYPE_CHECKING

import numpy as np

from ..catalogue.catalogue import HERE
from ..catalogue.entries import Material
from ..scene import Core, Plate
from .catalogued import calibres_of

if TYPE_CHECKING:
    from .campaign import Campaign

_CLOSE = 1e-6
"""Relative difference of numbers that are the same."""
_HEAVY, _CARBIDE = 5000.0, 11_000.0
"""Density above which a plate is steel, and above which a core is a carbide or a heavy metal [kg/m³]."""
_STRONG = 2.0e9
"""A steel may be hard from this resistance on [Pa]."""
_STEP = 1.0
"""Calibres below which the step of hard steel may lie."""
_NOSE, _SHORT = 0.95, 0.75
"""A nose ends where this share of the largest radius is reached; a blunt one is shorter, in diameters."""


def doubts_of(campaign: Campaign, materials: Mapping[str, Material]) -> Iterator[str]:
    """Sentences about what a campaign takes the model to."""
    core, figures = campaign.core, _figures()
    if (nose := nose_length(core)) < _SHORT:
        yield (
            f"the nose of the core is {nose:.2g} diameters long, but every core with a limit velocity had a nose of "
            f"{figures['nose']['least']:.2g}; a blunt nose shears out a plug, which the model lacks"
        )
    for place, plate in campaign.target.named:
        material = None if plate.material is None else materials.get(plate.material)
        if material is not None:
            yield from _beyond(campaign, place, plate, material)
        if material is None:
            yield from _thin_hard(core, place, plate, figures["thin hard steel"])
        yield from _dense(core, place, plate, figures["carbide"])


def nose_length(core: Core) -> float:
    """Where a core is nearly as wide as it gets, in its largest diameters behind the tip."""
    s = np.linspace(0.0, core.length, 1001)
    first = int(np.argmax(core.radius(s) >= _NOSE * core.max_radius))
    return float(s[first] / (2.0 * core.max_radius))


@cache
def _figures() -> Mapping[str, Mapping[str, float]]:
    """Errors of predicted limit velocities, by what they are of (tests/validation/limit_catalogue.py)."""
    figures: Mapping[str, Mapping[str, float]] = json.loads((HERE / "figures.json").read_text(encoding="utf-8"))
    return figures


def _thin_hard(core: Core, place: str, plate: Plate, figure: Mapping[str, float]) -> Iterator[str]:
    """Of a plate whose Y is not the catalogue's, which follows the thickness."""
    ratio = calibres_of(core, plate)
    if plate.density < _HEAVY or ratio >= _STEP or plate.resistance < _STRONG:
        return
    yield (
        f"{place} is steel that may be hard and {ratio:.2g} calibres of the core thick: hard steel has "
        f"{figure['share']:.0%} of its Y at one calibre where it is {figure['calibres']:.2g} calibres thick (median of "
        f"{figure['materials']:.0f} steels with limit velocities that thin); check that your Y is of such a thickness"
    )


def _dense(core: Core, place: str, plate: Plate, figure: Mapping[str, float]) -> Iterator[str]:
    if _density(core) < _CARBIDE:
        return
    steel = plate.density >= _HEAVY
    bias, rows = (figure["steel"], figure["steel rows"]) if steel else (figure["aluminium"], figure["aluminium rows"])
    yield (
        f"the core is as dense as a carbide: from rows of steel cores the model predicts limit velocities of the BS41 "
        f"carbide core in {'steel' if steel else 'aluminium'} {abs(bias):.0%} too {'high' if bias > 0 else 'low'} "
        f"(median of {rows:.0f}); {place} is of it"
    )


def _density(core: Core) -> float:
    """Mass over volume [kg/m³]."""
    if core.density is not None:
        return core.density
    s = np.linspace(0.0, core.length, 2001)
    volume = float(np.trapezoid(np.pi * core.radius(s) ** 2, s))
    return core.mass_properties.mass / volume


def _beyond(campaign: Campaign, place: str, plate: Plate, material: Material) -> Iterator[str]:
    """Where a plate leaves the rows that its material comes from."""
    if not material.rows:
        return
    core, obliquity = campaign.core, math.degrees(campaign.impact.obliquity)
    ratio = calibres_of(core, plate)
    if not _within(plate.thickness, material.thickness_low, material.thickness_high):
        yield (
            f"{place} is {1e3 * plate.thickness:.4g} mm thick, but the limit velocities of {material.name} are of "
            f"{1e3 * material.thickness_low:.4g} to {1e3 * (material.thickness_high or 0.0):.4g} mm"
        )
    if not _within(ratio, material.calibres_low, material.calibres_high):
        yield (
            f"{place} has {ratio:.3g} calibres of the core, but the limit velocities of {material.name} are of "
            f"{material.calibres_low:.3g} to {material.calibres_high or 0.0:.3g}"
        )
    low, high = math.degrees(material.obliquity_low), math.degrees(material.obliquity_high or 0.0)
    if not _within(obliquity, low, high):
        angles = f"at {low:.4g}°" if low == high else f"from {low:.4g} to {high:.4g}°"
        yield f"{place} is hit at {obliquity:.4g}°, but the limit velocities of {material.name} are {angles}"
    if core.threat is not None and core.threat not in material.rows:
        yield f"no limit velocity of {material.name} is of the {core.threat}, but of {', '.join(material.rows)}"


def _within(value: float, low: float, high: float | None) -> bool:
    return high is None or low * (1.0 - _CLOSE) - 1e-12 <= value <= high * (1.0 + _CLOSE) + 1e-12
