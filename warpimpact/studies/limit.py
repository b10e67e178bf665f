"""The limits of a campaign: for every hit the impact velocity, or the thickness of plate, that it just perforates."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.evidence import resistance_by_thickness
from warpimpact.campaign.text import CampaignError
from warpimpact.results.measures import Measure
from warpimpact.results.vocabulary import LIMIT_VELOCITY
from warpimpact.runs.run import run_to_file
from warpimpact.scene import exclusions
from warpimpact.solver.limit import (
    HIGHEST_VELOCITY,
    THICKNESS_TOLERANCE,
    VELOCITY_TOLERANCE,
    LimitSpec,
    check_arrests,
    thickest,
)


def limit_to_file(
    campaign: Campaign,
    output: Path,
    quantity: str = "velocity",
    *,
    tolerance: float | None = None,
    layer: int = 0,
    **options: Any,
) -> None:
    """Search the limit of every hit of a campaign into a file.

    Args:
        output, options: as in `run_to_file`.
        quantity, tolerance, layer: as in `limit_of`.

    Raises:
        CampaignError: as in `limit_of`.
    """
    run_to_file(campaign, output, limit=limit_of(campaign, quantity, tolerance, layer), **options)


def limit_of(
    campaign: Campaign, quantity: str = "velocity", tolerance: float | None = None, layer: int = 0
) -> LimitSpec:
    """The limit of a campaign that is to be searched.

    Args:
        quantity: "velocity" or "thickness".
        tolerance: of the limit [m/s] or [m], or the default one.
        layer: number of the layer whose thickness is searched; 0 is the plate.

    Raises:
        CampaignError: the campaign has no limits, or this search cannot find them.
    """
    try:
        stop = {exclusions.STOP: campaign.stop is not None}
        exclusions.check_together({exclusions.LIMIT_COMMAND: True} | stop)
        check_arrests(campaign.scene, campaign.sampler().shots(0, 1))
    except ValueError as error:
        raise CampaignError(str(error)) from None
    if quantity == "velocity":
        return LimitSpec(quantity, tolerance or VELOCITY_TOLERANCE, HIGHEST_VELOCITY)
    plates = campaign.target.layers
    if layer >= len(plates):
        raise CampaignError(f"got layer {layer}, but the target has layers 0 (the plate) to {len(plates) - 1}")
    highest = thickest(campaign.scene, layer)
    curve = resistance_by_thickness(campaign, layer, highest)
    return LimitSpec(quantity, tolerance or THICKNESS_TOLERANCE, highest, layer, curve)


def check_measures(texts: Sequence[str], quantity: str) -> None:
    """Refuse measures that a search of limits of this quantity does not give.

    Raises:
        CampaignError: the message names the measure.
    """
    for text in texts:
        try:
            measure = Measure.parse(text)
        except ValueError as error:
            raise CampaignError(f"--measure: {error}") from None
        if not measure.is_limit or (measure.quantity.need is LIMIT_VELOCITY) != (quantity == "velocity"):
            raise CampaignError(f"--measure: {text} does not follow from each hit's limit {quantity}")


def warning_of(campaign: Campaign, quantity: str) -> str | None:
    """A warning about a campaign whose limits are searched; None if there is nothing to warn of."""
    if (quantity, 0) not in campaign.scatter.given:
        return None
    return (
        f"the {quantity} scatters in this campaign, but a limit {quantity} does not depend on that: the scatter only "
        "says where the searches begin"
    )
