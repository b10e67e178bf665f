"""References of a target: a solid add-on of its steel and weight before the same base, and the base alone."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.resistances import catalogue_resistance
from warpimpact.scene import Plate, Scene, Shots, Target
from warpimpact.scene.quantities import BY_LAYER


def solid_target(campaign: Campaign) -> Target:
    """The target with a solid add-on, or a solid plate alone. A Y of the catalogue becomes that of the new
    thickness."""
    pairs = zip(campaign.target.layers, campaign.target.solid.layers, strict=True)
    return Target(layers=tuple(_of_its_thickness(campaign, *pair) for pair in pairs))


def _of_its_thickness(campaign: Campaign, given: Plate, solid: Plate) -> Plate:
    if solid == given or (known := catalogue_resistance(campaign, given, solid.thickness)) is None:
        return solid
    return solid.model_copy(update={"resistance": known.median})


def has_solid(campaign: Campaign) -> bool:
    """Whether there is a solid reference that differs from the target, or a base."""
    return bool(campaign.layer) or campaign.target.solid != campaign.target


def at_solid(campaign: Campaign, shots: Shots) -> tuple[Scene, Shots]:
    """The scene of the solid reference, and shots at it. Its add-on is as heavy as that of each shot."""
    target, solid = campaign.target, solid_target(campaign)
    columns: dict[str, Any] = {}
    for name in ("thickness", "resistance"):
        if (column := shots.columns.get(name)) is not None:
            pairs = zip(target.layers, solid.layers, strict=True)
            values = [(getattr(old, name), getattr(new, name)) for old, new in pairs]
            ratios = [1.0 if old == new else new / old for old, new in values]
            columns[name] = column * np.array(ratios[: column.shape[1]])
    return campaign.scene.model_copy(update={"target": solid}), replace(shots, **columns)


def at_base_alone(campaign: Campaign, shots: Shots) -> tuple[Scene, Shots]:
    """The scene of the base alone, and shots at the same places of its face."""
    last = len(campaign.target.layers) - 1
    columns: dict[str, Any] = {
        name: shots.columns[name][:, last] if shots.differs(name, last) else None for name in BY_LAYER
    }
    columns |= dict.fromkeys(("offset_y", "offset_z", "degradation_length"))
    return campaign.scene.model_copy(update={"target": campaign.target.base_alone}), replace(shots, **columns)
