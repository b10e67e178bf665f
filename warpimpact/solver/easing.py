"""Coarser levels of single settings, where a level keeps its promise with room to spare.

Scenes differ in what their errors come from: a straight shot's from the step, an oblique one's from the patches along
the core, few from the grid. The ladder refines all settings together. So from the level that a pilot found, single
settings go back to coarser levels while the promise is kept. Each trial is compared with the same finer outcomes as the
level was.
"""

from __future__ import annotations

import logging
from collections.abc import Callable, Sequence
from dataclasses import replace

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Numerics, Shots
from warpimpact.solver.climb import MARGIN
from warpimpact.solver.findings import HitErrors
from warpimpact.solver.pilot import PART, judged
from warpimpact.solver.resolution import LADDER, at_level

_logger = logging.getLogger(__name__)

SETTINGS = ("step", "grid", "around", "along")
"""In the order in which they are tried: first what saves most, and what often changes little."""
ROOM = 0.9
"""Errors over what is allowed, above which nothing coarser is tried or taken. What is left makes up for the choice: of
several trials those pass whose errors on the pilot's shots happen to be small."""
WIDE = 0.5
"""Likewise, below which two levels are tried before one."""
FEW = 0.1
"""Likewise, below which nothing is tried: so few hits err that the others tell nothing of a trial."""


def worth_easing(found: HitErrors, hits: int) -> bool:
    """Whether a run of so many hits is long enough for trials beside its pilot."""
    return hits >= PART * len(_known(found)[1])


def eased(
    found: HitErrors,
    outcomes_at: Callable[[Numerics, Shots], Outcomes],
    pilot: Shots,
    asked: Numerics,
    free: Sequence[bool],
) -> HitErrors:
    """The level that a pilot found, with coarser levels of single settings where they keep the promise. Where the level
    keeps it only with errors weighed by the energy of slow cores, the settings do, too.

    Args:
        outcomes_at: computes some of the pilot's shots.
        asked, free: as in `pilot_hits`.
    """
    level, (between, fine) = found.numerics.level, _known(found)
    assert level is not None
    shots, margin = pilot[: len(fine)], MARGIN[min(2, len(LADDER) - 1 - level)]

    def judge(outcomes: Outcomes, at: Numerics) -> tuple[HitErrors, float]:
        errors, excess, weighed = judged(outcomes, fine, shots, at, asked.asked, margin, free, between)
        status = errors.status_error - known_better
        errors = replace(errors, kept=excess <= 1.0 and not status > asked.asked.status_share, status_error=status)
        return errors, excess if found.kept else weighed

    known_better = 0.0  # how much more these shots end otherwise than more of them do
    known_better = judge(between, found.numerics)[0].status_error - found.status_error
    (best, excess), outcomes = judge(between, found.numerics), between
    coarser: dict[str, int] = {}
    for name in SETTINGS:
        for down in (2, 1) if excess < WIDE else (1,):
            if not FEW < excess < ROOM or down > level:
                continue
            at = at_level(level, asked, **coarser, **{name: level - down})
            trial = outcomes_at(at, shots)
            errors, now = judge(trial, at)
            _logger.info(
                "level %d with %s: errors of %s, %.2f of what is allowed", level, at.coarser, errors.errors, now
            )
            if now <= ROOM and not errors.status_error > max(best.status_error, asked.asked.status_share):
                coarser[name] = level - down
                best, excess, outcomes = errors, now, trial
                break
    tried = tuple((best, outcomes, fine) if one[0].numerics == found.numerics else one for one in found.tried)
    return replace(best, tried=tried)


def _known(found: HitErrors) -> tuple[Outcomes, Outcomes]:
    """Outcomes of a pilot's shots at the level that was found, and at a finer one."""
    return next((coarse, fine) for one, coarse, fine in found.tried if one.numerics == found.numerics)
