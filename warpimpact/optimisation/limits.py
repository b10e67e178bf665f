"""Limits of the hits of a design, for searches that ask for a limit velocity or a limit thickness."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.resistances import resistance_by_thickness
from warpimpact.records.group import failures
from warpimpact.results.measures import Measure
from warpimpact.scene import Numerics, Scene, Shots
from warpimpact.solver.limit import (
    HIGHEST_VELOCITY,
    THICKNESS_TOLERANCE,
    VELOCITY_TOLERANCE,
    Sought,
    limits,
    pilot_of_limits,
    thickest,
)
from warpimpact.solver.pilot import limits_pilot_size
from warpimpact.solver.worker import Worker

Array = NDArray[np.float64]


def sought_by(campaign: Campaign, scene: Scene, key: Measure) -> Sought:
    """The limit behind a measure, with the tolerance of `warpimpact limit`."""
    if key.name == "limit_velocity":
        return Sought("velocity", VELOCITY_TOLERANCE, HIGHEST_VELOCITY)
    layer = key.layer or 0
    highest = thickest(scene, layer)
    curve = resistance_by_thickness(campaign, layer, highest)
    return Sought("thickness", THICKNESS_TOLERANCE, highest, layer, curve)


def limits_said(
    campaign: Campaign, scene: Scene, shots: Shots, key: Measure, numerics: Numerics, worker: Worker
) -> Array:
    """The values of a measure of limits, in its display unit, shape [shots]; NaN where the computation failed."""
    sought = sought_by(campaign, scene, key)
    limits_found = limits(scene, shots, sought, numerics, worker)
    value = np.minimum(limits_found.value, sought.highest)
    value = np.where(failures(limits_found.outcomes.status), np.nan, value)
    if key.name == "limit_areal_density":
        layer = scene.target.layers[sought.layer]
        value = scene.target.areal_density + layer.areal_density * (value / layer.thickness - 1.0)
    return np.asarray(key.display.factor * key.counted(value))


def limits_level(campaign: Campaign, shots: Shots, key: Measure, numerics: Numerics, worker: Worker) -> Numerics:
    """The numerics that a pilot finds for a limit."""
    some = shots[: limits_pilot_size(numerics.asked)]
    sought = sought_by(campaign, campaign.scene, key)
    return pilot_of_limits(campaign.scene, some, sought, numerics, worker).numerics
