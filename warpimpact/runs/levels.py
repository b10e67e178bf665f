"""Levels of resolution for the measures of a run: the shift of the measures by the numerics at each level."""

from __future__ import annotations

import math

import numpy as np

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.stop import Stop
from warpimpact.records.outcomes import Outcomes
from warpimpact.results.dataset import to_table
from warpimpact.results.measures import Measure
from warpimpact.results.table import HitTable
from warpimpact.results.tallies import shift_of
from warpimpact.scene import Shots
from warpimpact.scene.model import Array
from warpimpact.solver.findings import HitErrors
from warpimpact.solver.pilot import Aim, Excess
from warpimpact.statistics.shifts import SHIFT_MARGIN

OF_THE_NUMERICS = 0.5
"""Largest shift by the numerics, as a share of an interval's half width."""
MEASURES = "the measures"
"""Words for what the level is chosen for at several layers."""
LAYERED = ("mean(residual_velocity)", "P(perforated)", "mean(base_depth)")
"""Measures that choose the level at several layers, beside the mean tilt at the last stand-off."""


def level_for(campaign: Campaign) -> str:
    """What the level is chosen for, if not for an accuracy of single hits: the quantity of a stop rule, or the measures
    of a target of several layers. Empty where the campaign asks for an accuracy or fixes the level."""
    if {"fidelity", "accuracy"} & campaign.numerics.model_fields_set or campaign.numerics.explicit is not None:
        return ""
    if campaign.stop is not None:
        return campaign.stop.quantity
    return MEASURES if len(campaign.target.layers) > 1 else ""


def aim_of(campaign: Campaign, hits: int) -> Aim | None:
    """The measures for which a pilot chooses the level; None where it chooses for an accuracy of single hits. At
    several layers a level that keeps the accuracy will do, too.

    Args:
        hits: number of hits of the campaign.
    """
    if not level_for(campaign):
        return None
    if campaign.stop is not None:
        return Aim(_excess_of_stop(campaign, campaign.stop))
    return Aim(_excess_of_layers(campaign, hits), alone=False)


def _excess_of_stop(campaign: Campaign, rule: Stop) -> Excess:
    """Excess for a stop rule: the shift of its quantity by the numerics over the allowed part of its interval."""
    measure, allowed = rule.measure, OF_THE_NUMERICS * rule.measure.shown(rule.half_width)

    def excess(coarse: Outcomes, fine: Outcomes, shots: Shots) -> float:
        levels = _table(campaign, shots, coarse), _table(campaign, shots, fine)
        shift = shift_of(measure, levels, rule.confidence)
        return math.inf if shift is None or math.isnan(shift) else shift / allowed

    return excess


def _excess_of_layers(campaign: Campaign, hits: int) -> Excess:
    """Excess for several layers: the shift of the measures between the pilot's hits over the interval that the run will
    have. An upper estimate of the shift from the pilot's few hits would ask for more expensive levels."""
    measures = [Measure.parse(text) for text in (*LAYERED, *_last_tilts(campaign))]

    def excess(coarse: Outcomes, fine: Outcomes, shots: Shots) -> float:
        levels = [_table(campaign, shots, outcomes) for outcomes in (coarse, fine)]
        return max(_open_share(measure.values(levels[0]), measure.values(levels[1]), hits) for measure in measures)

    return excess


def _open_share(coarse: Array, fine: Array, hits: int) -> float:
    """Shift of a mean between two levels with the same shots, with the margin for the finer one, over half the 95 %
    interval of this number of independent hits; 0 where fewer than two shots count."""
    counts = ~np.isnan(coarse) & ~np.isnan(fine)
    if counts.sum() < 2:
        return 0.0
    shift = SHIFT_MARGIN * abs(float(np.mean(fine[counts] - coarse[counts])))
    counted = max(float(counts.mean()) * hits, 2.0)
    left_open = max(1.96 * float(np.std(fine[counts])) / math.sqrt(counted), 1.0 / counted)
    return shift / left_open


def shifts_of(campaign: Campaign, pilot: Shots, findings: HitErrors) -> dict[int, tuple[float, ...]]:
    """Upper estimates of the shifts of the mean residual velocity [m/s] and the mean last tilt [degree] by the
    numerics, for every level that a pilot tried."""
    measures = [Measure.parse(text) for text in ("mean(residual_velocity)", *_last_tilts(campaign))]
    shifts: dict[int, tuple[float, ...]] = {}
    for errors, *outcomes in findings.tried:
        coarse, fine = (_table(campaign, pilot[: len(outcome)], outcome) for outcome in outcomes)
        assert errors.numerics.level is not None
        shifts[errors.numerics.level] = tuple(shift_of(measure, (coarse, fine)) or 0.0 for measure in measures)
    return shifts


def _last_tilts(campaign: Campaign) -> list[str]:
    return [f"mean(tilt@{at!r}m)" for at in campaign.output.standoffs[-1:]]


def _table(campaign: Campaign, shots: Shots, outcomes: Outcomes) -> HitTable:
    """A result of a pilot's shots and their outcomes."""
    period = campaign.hits.covered(campaign.plate)
    return to_table(campaign.scene, shots, outcomes, period=period, attributes={})
