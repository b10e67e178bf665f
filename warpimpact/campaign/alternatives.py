"""The alternatives of a campaign: its scene and its shots with one thing that nobody measured chosen otherwise.

The hits stay in their places, so that what they have in common drops out of the difference to the campaign as given.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from pydantic import ValidationError

from ..scene import Interaction, Plate, Scene, Shots, Target
from ..scene.interaction import NEAR_EDGES
from .resistances import catalogue_resistance, is_drawn
from .straight_passage import StraightPassage

if TYPE_CHECKING:
    from ..catalogue.strength import Resistance
    from .campaign import Campaign

UNKNOWN = 0.3
"""How far a resistance that a user gives may be off, as a share of it: two steels of one hardness differ by more."""
WEAK, SOON = 0.8, 1e-6
"""β and its interval [s] of a plate with holes that is given without weakening: those of the paper."""
_STEEPEST = math.radians(85.0)
"""Largest obliquity, and largest projected angle of the axis, of an alternative [rad]."""
_DIFFERENT = 1e-6
"""Relative change of a value below which an alternative is none."""

Values = Mapping[tuple[str, int], float]


@dataclass(frozen=True)
class Alternative:
    """A campaign with one thing otherwise.

    Attributes:
        name: what is otherwise, for people.
        scene: the scene of all shots.
        layers: values of quantities that shots have of their own, by quantity and layer.
        turned: by how much the shots are turned, by the name of the angle [rad].
        breaks: whether it only tells which cores would break.
        moves_limits: whether limits depend on it.
    """

    name: str
    scene: Scene
    layers: Values = field(default_factory=dict)
    turned: Mapping[str, float] = field(default_factory=dict)
    breaks: bool = False
    moves_limits: bool = True

    def shots(self, shots: Shots) -> Shots:
        """Shots of the campaign, as they are in the alternative."""
        for (name, layer), value in self.layers.items():
            shots = shots.with_own({name: np.full(len(shots), value)}, layer)
        turned: dict[str, Any] = {name: getattr(shots, name) + angle for name, angle in self.turned.items()}
        return replace(shots, **turned)

    def is_possible(self, shots: Shots) -> bool:
        """Whether all shots can fly so."""
        if not self.turned:
            return True
        shots = self.shots(shots)
        flight = np.tan(shots.obliquity)
        along = flight * np.cos(shots.azimuth), flight * np.sin(shots.azimuth)
        steep = [np.abs(np.arctan(of) + angle).max() for of, angle in zip(along, (shots.yaw, shots.pitch), strict=True)]
        return bool(max(shots.obliquity.max(), *steep) < _STEEPEST)


def alternatives(campaign: Campaign) -> list[Alternative]:
    """All alternatives that [assumptions] asks for and that differ from the campaign, in the order of its keys."""
    asked = (_resistances, _degradations, _rates, _reaches, _frictions, _onsets, _edges, _turns, _standoffs, _breaks)
    return [alternative for alternatives_of in asked for alternative in alternatives_of(campaign)]


def _resistances(campaign: Campaign) -> Iterator[Alternative]:
    factors = campaign.assumptions.resistance
    if factors is None:
        for end, name in enumerate(("low", "high")):
            ends = (_end_of_resistance(campaign, plate, end) for plate in campaign.target.layers)
            yield from _of_layers(campaign, f"Y at its {name} end", "resistance", dict(enumerate(ends)))
        return
    for factor in factors:
        changed = {k: factor * plate.resistance for k, plate in enumerate(campaign.target.layers)}
        yield from _of_layers(campaign, f"Y × {factor:g}", "resistance", changed)


def _end_of_resistance(campaign: Campaign, plate: Plate, end: int) -> float:
    """The low (0) or high (1) end of what Y may be: the catalogue's interval, or a share of a value of the user."""
    known = _in_catalogue(campaign, plate)
    return plate.resistance * (1.0 + UNKNOWN * (2 * end - 1)) if known is None else known.ends[end]


def _in_catalogue(campaign: Campaign, plate: Plate) -> Resistance | None:
    """The catalogue's Y of a plate with what is not known of it; None where Y is the user's, or nothing tells that."""
    known = catalogue_resistance(campaign, plate)
    return known if known is not None and known.deviation else None


def _refitted(campaign: Campaign, law: Interaction, friction: float | None = None) -> Values:
    """Y of the layers that have it from the catalogue, as published limit velocities would give it under another law or
    with another η: the limit velocity of a solid plate stays (docs/model.md §6.2)."""
    layers = enumerate(campaign.target.layers)
    return {
        ("resistance", k): _passage(campaign, plate).resistance_under(
            law, plate.shear_coefficient if friction is None else friction, plate.resistance
        )
        for k, plate in layers
        if _in_catalogue(campaign, plate) is not None
    }


def _passage(campaign: Campaign, plate: Plate) -> StraightPassage:
    """The core straight through a plate without holes."""
    given = campaign.interaction, plate.shear_coefficient, plate.thickness, plate.density
    return StraightPassage(campaign.core, *given, campaign.impact.obliquity)


def _degradations(campaign: Campaign) -> Iterator[Alternative]:
    weak = {k for k, plate in enumerate(campaign.target.layers) if plate.degradation < 1.0}
    for value in campaign.assumptions.degradation:
        name = "no weakening (β = 1)" if value == 1.0 else f"β = {value:g}"
        yield from _of_layers(campaign, name, "degradation", dict.fromkeys(weak, value))
    strong = {k for k, plate in enumerate(campaign.target.layers) if plate.open_area and k not in weak}
    if strong and campaign.assumptions.degradation and not is_drawn(campaign, "degradation", strong):
        paper = {"degradation": WEAK, "degradation_interval": SOON, "degradation_distance": None}
        changed = _changed(campaign, lambda k, plate: paper if k in strong else {})
        yield Alternative(f"weakening (β = {WEAK:g} in 1 µs)", changed)


def _rates(campaign: Campaign) -> Iterator[Alternative]:
    for factor in campaign.assumptions.rate:
        layers = enumerate(campaign.target.layers)
        changed = {k: plate.degradation**factor for k, plate in layers if 0.0 < plate.degradation < 1.0}
        name = {0.5: "weakens half as fast", 2.0: "weakens twice as fast"}.get(factor, f"weakens {factor:g} × as fast")
        yield from _of_layers(campaign, name, "degradation", changed)


def _reaches(campaign: Campaign) -> Iterator[Alternative]:
    """Other lengths and depths over which plates weaken. A posterior may draw them."""
    weak = {k for k, plate in enumerate(campaign.target.layers) if plate.degradation < 1.0}
    if not weak or is_drawn(campaign, "degradation_length", weak) or is_drawn(campaign, "degradation_depth", weak):
        return
    for factor in campaign.assumptions.reach:

        def changed(k: int, plate: Plate, factor: float = factor) -> dict[str, Any]:
            lengths = ("degradation_length", "degradation_depth")
            return {name: factor * getattr(plate, name) for name in lengths} if k in weak else {}

        name = {0.5: "half as far", 2.0: "twice as far"}.get(factor, f"{factor:g} × as far")
        if factor != 1.0:
            yield Alternative(f"weakening reaches {name}", _changed(campaign, changed))


def _frictions(campaign: Campaign) -> Iterator[Alternative]:
    for value in campaign.assumptions.shear_coefficient:
        every = dict.fromkeys(range(len(campaign.target.layers)), value)
        for changed in _of_layers(campaign, f"friction η = {value:g}", "shear_coefficient", every):
            yield _with_refitted(campaign, changed, _refitted(campaign, campaign.interaction, value))


def _onsets(campaign: Campaign) -> Iterator[Alternative]:
    law = campaign.interaction
    for value in campaign.assumptions.onset:
        if not math.isclose(law.onset, value) and not is_drawn(campaign, "onset"):
            other = law.model_copy(update={"onset": value})
            changed = Alternative(f"onset κ = {value:g}", campaign.scene.model_copy(update={"interaction": other}))
            yield _with_refitted(campaign, changed, _refitted(campaign, other))


def _with_refitted(campaign: Campaign, changed: Alternative, refitted: Values) -> Alternative:
    """An alternative with Y as a fit with it would have it, where Y comes from a fit."""
    if not refitted or is_drawn(campaign, "resistance", [k for _, k in refitted]):
        return changed
    return replace(changed, name=f"{changed.name}, Y fitted with it", layers={**changed.layers, **refitted})


def _edges(campaign: Campaign) -> Iterator[Alternative]:
    """Less resistance near edges in place of weakening (docs/model.md §4.9), which finite elements of plates with holes
    ask for; of a campaign that has it, a constant stress. A plate without holes takes as much from the core as before.
    """
    law, plates, burst = campaign.interaction, campaign.target.layers, campaign.at_a_plate > 1
    constant = Interaction(onset=law.onset)
    free = NEAR_EDGES.model_copy(update={"onset": law.onset})
    every, drawn = range(len(plates)), ("resistance", "degradation", "linear", "static", "quadratic")
    if (
        not campaign.assumptions.edges
        or law not in (constant, free)
        or not any(plate.open_area for plate in plates)
        or burst
        or campaign.numerics.scheme == "nodal"
        or any(is_drawn(campaign, name, every) for name in drawn)
    ):
        return
    other = free if law == constant else constant

    def changed(k: int, plate: Plate) -> dict[str, Any]:
        arriving = 0.0 if _in_catalogue(campaign, plate) is not None else campaign.impact.velocity
        alike = _passage(campaign, plate).resistance_under(other, plate.shear_coefficient, plate.resistance, arriving)
        return {"resistance": alike, "degradation": 1.0}

    scene = _changed(campaign, changed).model_copy(update={"interaction": other})
    name = "less resistance near edges" if other == free else "as much resistance near edges"
    yield Alternative(f"{name}, Y fitted with it", scene)


def _turns(campaign: Campaign) -> Iterator[Alternative]:
    """Shots that are turned where their angle does not scatter."""
    for name, text in (("obliquity", "more oblique"), ("yaw", "of yaw")):
        for angle in getattr(campaign.assumptions, name):
            if angle and not any(scattered == name for scattered, _ in campaign.scatter.given):
                yield Alternative(f"{math.degrees(angle):.3g}° {text}", campaign.scene, turned={name: angle})


def _standoffs(campaign: Campaign) -> Iterator[Alternative]:
    """Nearer or farther stand-offs, where the core is out of the target at all of them."""
    record = campaign.scene.record
    for factor in campaign.assumptions.standoff:
        if not record.standoffs or factor == 1.0:
            continue
        moved = record.model_copy(update={"standoffs": tuple(factor * at for at in record.standoffs)})
        name = "half the stand-off" if factor == 0.5 else f"{factor:g} × the stand-off"
        with suppress(ValidationError):
            yield Alternative(name, campaign.scene.model_copy(update={"record": moved}), moves_limits=False)


def _breaks(campaign: Campaign) -> Iterator[Alternative]:
    """A core that may break, where the campaign takes it to be unbreakable and its scheme knows bending."""
    core = campaign.core
    if core.strength is not None or is_drawn(campaign, "strength") or campaign.numerics.scheme == "nodal":
        return
    for strength in campaign.assumptions.strength:
        record = campaign.scene.record.model_copy(update={"bending": True})
        update = {"core": core.model_copy(update={"strength": strength}), "record": record}
        scene = campaign.scene.model_copy(update=update)
        yield Alternative(f"a core of {strength / 1e9:g} GPa", scene, breaks=True, moves_limits=False)


def _of_layers(campaign: Campaign, name: str, quantity: str, changed: Mapping[int, float]) -> Iterator[Alternative]:
    """An alternative with other values of a quantity by layer: none if no layer differs, or if shots have their own."""
    layers = campaign.target.layers
    differ = any(
        not math.isclose(value, getattr(layers[k], quantity), rel_tol=_DIFFERENT) for k, value in changed.items()
    )
    if differ and not is_drawn(campaign, quantity, changed):
        yield Alternative(name, campaign.scene, {(quantity, k): value for k, value in changed.items()})


def _changed(campaign: Campaign, change: Callable[[int, Plate], Mapping[str, Any]]) -> Scene:
    """The scene with keys of its plate and layers changed."""
    layers = campaign.target.layers
    changed = (plate.model_copy(update=dict(change(k, plate))) for k, plate in enumerate(layers))
    return campaign.scene.model_copy(update={"target": Target(layers=tuple(changed))})
