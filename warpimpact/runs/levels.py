"""Levels of resolution for the measures of a run: what the numerics may shift them by at each."""

from __future__ import annotations

import math

from warpimpact.campaign.campaign import Campaign
from warpimpact.records.outcomes import Outcomes
from warpimpact.results import attributes as attr
from warpimpact.results.dataset import to_table
from warpimpact.results.measures import Measure
from warpimpact.results.table import HitTable
from warpimpact.results.tallies import shift_of
from warpimpact.scene import Shots
from warpimpact.solver.findings import HitErrors
from warpimpact.solver.pilot import Excess

OF_THE_NUMERICS = 0.5
"""Share of an interval's half width that the numerics may take."""


def seeks_measure(campaign: Campaign) -> bool:
    """Whether a pilot looks for the level that the quantity of a stop rule needs: where nothing is asked of single
    hits."""
    asked = {"fidelity", "accuracy"} & campaign.numerics.model_fields_set
    return campaign.stop is not None and not asked and campaign.numerics.explicit is None


def excess_of_stop(campaign: Campaign) -> Excess | None:
    """What the numerics may shift the quantity of a stop rule by, over what they may; None where the level is not
    looked for by that."""
    rule = campaign.stop
    if rule is None or not seeks_measure(campaign):
        return None
    measure, allowed = rule.measure, OF_THE_NUMERICS * rule.measure.shown(rule.half_width)

    def excess(coarse: Outcomes, fine: Outcomes, shots: Shots) -> float:
        levels = _table(campaign, shots, coarse), _table(campaign, shots, fine)
        shift = shift_of(measure, levels, rule.confidence)
        return math.inf if shift is None or math.isnan(shift) else shift / allowed

    return excess


def shifts_of(campaign: Campaign, pilot: Shots, found: HitErrors) -> dict[int, tuple[float, ...]]:
    """What the numerics may shift the mean residual velocity [m/s] and the mean last tilt [degree] by, at every level
    that a pilot tried."""
    tilts = [f"mean(tilt@{at!r}m)" for at in campaign.output.standoffs[-1:]]
    measures = [Measure.parse(text) for text in ("mean(residual_velocity)", *tilts)]
    shifts: dict[int, tuple[float, ...]] = {}
    for errors, *outcomes in found.tried:
        coarse, fine = (_table(campaign, pilot[: len(outcome)], outcome) for outcome in outcomes)
        assert errors.numerics.level is not None
        shifts[errors.numerics.level] = tuple(shift_of(measure, (coarse, fine)) or 0.0 for measure in measures)
    return shifts


def _table(campaign: Campaign, shots: Shots, outcomes: Outcomes) -> HitTable:
    """Outcomes of a pilot's shots as a result."""
    together = {attr.SHOTS_AT_A_PLATE: campaign.at_a_plate} if campaign.at_a_plate > 1 else {}
    period = campaign.hits.covered(campaign.plate)
    return to_table(campaign.scene, shots, outcomes, period=period, attributes=together)
