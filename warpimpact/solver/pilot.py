"""The coarsest level of resolution that keeps a promised accuracy on a scene.

A pilot computes some of the shots on levels of LADDER, coarse to fine. The error of a level is estimated by its change
to a finer one. The coarsest level whose error is within the promise is taken for all shots. The estimate is an upper
one: a high order statistic of the pilot's shots, times a margin for the error of the finer level itself.
"""

from __future__ import annotations

import logging
import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TypeAlias

import numpy as np
from numpy.typing import NDArray

from warpimpact.records.layers import LAYER_RESIDUAL_VELOCITY
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Accuracy, Numerics, Shots
from warpimpact.solver.changes import ended_otherwise, fewest, upper_errors
from warpimpact.solver.climb import MARGIN, Verdict, coarsest
from warpimpact.solver.findings import HitErrors, Tried
from warpimpact.solver.purse import Computed, Purse
from warpimpact.solver.resolution import LADDER, at_level, coarsest_level

Array = NDArray[np.float64]

_logger = logging.getLogger(__name__)

SHOTS, SHOTS_OF_FINE = 64, 32
"""Shots of a pilot, and of one that begins at FINE or beyond, where they are dear. More shots make a lower estimate
safe."""
MORE, PART = 256, 16
"""Shots of a pilot where SHOTS leave the choice between two levels open, and one of so many shots of a run at most."""
OPEN = (0.7, 1.5)
"""Upper estimates over what is allowed, between which more shots may choose another level."""
OPEN_MEASURE = (0.7, 3.0)
"""Likewise of what a measure shifts by: mostly the noise of few shots, of which four times as many leave half."""
TYPICAL = 0.75
"""Share of the first shots whose errors tell how those fall from level to level: the largest few fall by chance."""
FEW = 2
"""Shots that end otherwise, as few as which say little of their share; likewise."""
FINE = 4
FURTHER = 5
"""Levels behind the first one on which a promise is looked for: 105 random scenes of single plates needed no finer one
for draft and standard, but one. Who asks for a draft waits for no level that costs fifty times as much."""
FURTHER_LAYERED = 3
"""Likewise behind several layers, where a shot costs more: eight to ten times the first level's cost."""
BEYOND = 1
"""Levels behind the first one that nearly keeps the promise, on which one is looked for that does; it costs about twice
the one before. Nearly does a level whose weighed errors are within the promise."""


def pilot_size(accuracy: Accuracy, hits: int = 0) -> int:
    """Shots of a pilot, at most; of a run of so many hits."""
    return max(_first(accuracy), min(MORE, hits // PART))


def _first(accuracy: Accuracy) -> int:
    """Shots that a pilot begins with."""
    usual = SHOTS if coarsest_level(accuracy.strictness) < FINE else SHOTS_OF_FINE
    return max(usual, fewest(accuracy.share))


Excess: TypeAlias = Callable[[Outcomes, Outcomes, Shots], float]
"""What outcomes of some shots at a level are off by over what is allowed, from those at a finer level."""


def pilot_hits(
    outcomes_at: Callable[[int, Shots], Outcomes],
    pilot: Shots,
    numerics: Numerics,
    free: Sequence[bool] = (True,),
    excess_of: Excess | None = None,
    purse: Purse | None = None,
) -> HitErrors:
    """Find the coarsest level whose outcomes have the accuracy that is asked for.

    Args:
        outcomes_at: computes some of the pilot's shots on a level of LADDER.
        pilot: shots like those that are to be computed, some `pilot_size` of them, the first of which are like all. The
            rest is computed where the first leave the choice between two levels open.
        numerics: their accuracy, precision and layout count; other settings would promise nothing.
        free: of each layer of the target, whether a core flies free behind it (`Scene.free_behind`). Residual
            velocities behind others count in no error.
        excess_of: in place of the accuracy, from the coarsest level on.
        purse: what it may take; None if that does not matter.

    Returns:
        The level that keeps the promise. If none does: the coarsest one that keeps it with errors weighed by the energy
        of slow cores, where finer ones would be of little use. Else the coarsest one whose errors are about the
        smallest of all. Its errors are then those to the finest level that as many shots were computed at.

    Raises:
        ValueError: the accuracy says nothing of outcomes.
    """
    accuracy = numerics.asked
    if math.isinf(accuracy.residual_velocity) and math.isinf(accuracy.tilt):
        raise ValueError("accuracy: needs residual_velocity or tilt; a limit alone is for a search of limits")
    search = _Search(Computed(outcomes_at, pilot, purse), pilot, numerics, free, excess_of)
    found = coarsest(search.judge, range(search.first, len(LADDER) - 1), len(LADDER) - 1, BEYOND, search.allowed)
    if found is None:
        return HitErrors(at_level(search.first, numerics), False, accuracy.share, math.inf, math.inf)
    tried = search.tried
    if not found.kept:
        index, coarse = next((at, coarse) for at, (one, coarse, _) in tried.items() if one is found)
        finest, fine = search.computed.finest(len(coarse))
        tried[index] = _to_finer(found, coarse, fine, finest - index, pilot, accuracy, free)
        found = tried[index][0]
    return replace(found, tried=tuple(tried[index] for index in sorted(tried)))


@dataclass(frozen=True)
class _Search:
    """What a pilot asks of a level; some attributes are arguments of `pilot_hits`.

    Attributes:
        computed: its outcomes so far.
        tried: what was found at every level that was tried.
    """

    computed: Computed
    pilot: Shots
    numerics: Numerics
    free: Sequence[bool]
    excess_of: Excess | None
    tried: dict[int, Tried] = field(default_factory=dict)

    @property
    def first(self) -> int:
        """The level from which on it is looked for."""
        return coarsest_level(self.numerics.asked.strictness) if self.excess_of is None else 0

    @cached_property
    def sizes(self) -> list[int]:
        """Numbers of shots: twice as many each time, of whole plates."""
        most, at_a_plate = len(self.pilot), self.pilot.at_a_plate
        sizes = [min(most, -(-_first(self.numerics.asked) // at_a_plate) * at_a_plate)]
        while sizes[-1] < most:
            sizes.append(min(most, 2 * sizes[-1]))
        return sizes

    def allowed(self, index: int, finer: int, count: int | None = None) -> bool:
        """Whether a level is worth so many shots there and at a finer one."""
        further = FURTHER if len(self.free) == 1 else FURTHER_LAYERED
        usual = index <= coarsest_level(self.numerics.asked.strictness) + further
        return self.computed.worth(index, finer, count or self.sizes[0], usual) if self.tried else usual

    def judge(self, index: int, finer: int, margin: float) -> Verdict[HitErrors]:
        """A level by its change to a finer one, from as many shots as tell whether it keeps the promise."""
        verdict = self._by(self.sizes[0], index, finer, margin)
        typical = self._typical(index, finer, margin) if self.excess_of is None else verdict.excess
        for count in self.sizes[1:]:
            if self._decided(verdict, len(self.tried[index][1])) or not self.allowed(index, finer, count):
                break
            verdict = self._by(count, index, finer, margin)
        return verdict._replace(typical=typical)

    def _by(self, count: int, index: int, finer: int, margin: float) -> Verdict[HitErrors]:
        """A level by so many shots."""
        shots, accuracy = self.pilot[:count], self.numerics.asked
        pair = self.computed.at(index, count), self.computed.at(finer, count)
        found, excess, weighed = judged(*pair, shots, at_level(index, self.numerics), accuracy, margin, self.free)
        # What more shots told of a coarser level holds, as finer ones err no more.
        status = [one.status_error for at, (one, coarse, _) in self.tried.items() if at < index and len(coarse) > count]
        if found.status_error > min(status, default=1.0):
            kept = excess <= 1.0 and min(status) <= accuracy.status_share
            found = replace(found, kept=kept, status_error=min(status))
        if self.excess_of is not None:
            excess, weighed = self.excess_of(*pair, shots), math.inf
            found = replace(found, kept=excess <= 1.0)
        _logger.info(
            "pilot of %d hits at level %d: errors of %s, the promise is %skept",
            count, index, found.errors, "" if found.kept else "not ",
        )  # fmt: skip
        self.tried[index] = found, *pair
        return Verdict(found, excess, math.nan, weighed <= 1.0)

    def _typical(self, index: int, finer: int, margin: float) -> float:
        """Errors over what is allowed of most of the first shots, as likely to be too small as too large."""
        found, coarse, fine = self.tried[index]
        if found.status_error > 1.0 - self.numerics.asked.share:
            return math.inf  # the shots that end otherwise are those that err most
        accuracy, layered = self.numerics.asked, LAYER_RESIDUAL_VELOCITY in coarse
        each = (self.pilot.at_a_plate, TYPICAL, None, _relative(accuracy, layered), self.free, 0.5)
        return _excess(accuracy, margin * upper_errors(coarse, fine, *each), layered)

    def _decided(self, verdict: Verdict[HitErrors], count: int) -> bool:
        """Whether more shots would hardly tell otherwise."""
        low, high = OPEN if self.excess_of is None else OPEN_MEASURE
        few = self.numerics.asked.status_share < verdict.found.status_error <= FEW / count
        return not low < verdict.excess < high and not (few and verdict.excess <= low)


def _to_finer(
    found: HitErrors, coarse: Outcomes, fine: Outcomes, on: int, pilot: Shots, accuracy: Accuracy, free: Sequence[bool]
) -> Tried:
    """A level that breaks the promise, with its errors to one so many levels on: where they stall, two tell too
    little."""
    told, *_ = judged(coarse, fine, pilot[: len(fine)], found.numerics, accuracy, MARGIN[min(2, on)], free)
    return replace(told, kept=False), coarse, fine


def judged(
    coarse: Outcomes,
    fine: Outcomes,
    shots: Shots,
    numerics: Numerics,
    accuracy: Accuracy,
    margin: float,
    free: Sequence[bool],
    between: Outcomes | None = None,
) -> tuple[HitErrors, float, float]:
    """What is known of a resolution from some shots: the finding, its errors over what is allowed, and the same with
    errors weighed by the energy of slow cores.

    Args:
        margin: how many times the change to the fine outcomes the error is at most.
        between: outcomes at a level between, if the margin is that level's. What it has beyond 1 is then the error of
            the fine outcomes, over the change from there.
    """

    def upper(impact: Array | None, relative: tuple[float, float]) -> Array:
        told = (shots.at_a_plate, accuracy.share, impact, relative, free)
        if between is None:
            return margin * upper_errors(coarse, fine, *told)
        return upper_errors(coarse, fine, *told) + (margin - 1.0) * upper_errors(between, fine, *told)

    layered = LAYER_RESIDUAL_VELOCITY in coarse
    relative = _relative(accuracy, layered)
    told, counted, weighed = upper(None, (0.0, 0.0)), upper(None, relative), upper(shots.velocity, relative)
    status = float(ended_otherwise(coarse, fine).mean()) if layered else math.nan
    excess = _excess(accuracy, counted, layered)
    kept = excess <= 1.0 and not status > accuracy.status_share
    velocity, tilt, depth = (float(error) for error in told)
    found = HitErrors(numerics, kept, accuracy.share, velocity, tilt, depth, status, finer=fine)
    return found, excess, _excess(accuracy, weighed, layered)


def _relative(accuracy: Accuracy, layered: bool) -> tuple[float, float]:
    """The relative parts of what is allowed over the absolute ones; of single plates none."""
    if not layered:
        return 0.0, 0.0
    return accuracy.residual_velocity_share / accuracy.residual_velocity, accuracy.tilt_share / accuracy.tilt


def _excess(accuracy: Accuracy, errors: Array, layered: bool) -> float:
    """The largest of the errors over what is allowed; infinite if no shot has a speed. A depth counts behind layers.
    What is not asked for counts as 0, however large its error is."""
    velocity, tilt = np.nan_to_num(errors[:2], nan=math.inf)
    depth = np.nan_to_num(errors[2], nan=0.0) if layered else 0.0
    allowed = accuracy.residual_velocity, accuracy.tilt, accuracy.depth
    return max(
        float(error) / bound if math.isfinite(bound) else 0.0
        for error, bound in zip((velocity, tilt, depth), allowed, strict=True)
    )
