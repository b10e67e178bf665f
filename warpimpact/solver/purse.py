"""What a pilot has computed, and what it may still take by the times that are foreseen."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Shots

PATIENCE, WORTH = 10.0, 1600
"""What a pilot may take: so many seconds of a core, or as long as so many hits take at the level that it looks at,
whichever is more: a tenth of a run of 16,384 hits. As long as it takes no more than these seconds, it looks at finer
levels than FURTHER, too. Times are those that are foreseen (`Prepared.seconds`), so that a level does not depend on the
machine."""


class Purse:
    """What a pilot may still take, by the price of a shot at a level [s]."""

    def __init__(self, price: Callable[[int], float]) -> None:
        self._price, self._spent = price, 0.0

    def pay(self, level: int, shots: int) -> None:
        """Some shots are computed."""
        self._spent += shots * self._price(level)

    def allows(self, level: int, new: Mapping[int, int], patient: bool) -> bool:
        """Whether a level is worth so many new shots at some levels. Who is not `patient` goes on only as long as it
        takes no time to speak of."""
        try:
            spent = self._spent + sum(shots * self._price(one) for one, shots in new.items())
        except MemoryError:  # the plate's period does not fit at that spacing
            return False
        return spent <= PATIENCE or (patient and spent <= WORTH * self._price(level))


class Computed:
    """Outcomes of the first shots of a pilot at some levels.

    Args:
        outcomes_at: computes some shots on a level of LADDER.
        purse: what the pilot may take; None if that does not matter.
    """

    def __init__(self, outcomes_at: Callable[[int, Shots], Outcomes], pilot: Shots, purse: Purse | None) -> None:
        self._outcomes_at, self._pilot, self._purse = outcomes_at, pilot, purse
        self._known: dict[int, Outcomes] = {}

    def at(self, level: int, count: int) -> Outcomes:
        """Those of so many shots, computed as far as they are not known."""
        if new := self._new(level, count):
            others = [self._known[level]] if level in self._known else []
            some = self._outcomes_at(level, self._pilot[count - new : count])
            self._known[level] = Outcomes.joined([*others, some])
            if self._purse is not None:
                self._purse.pay(level, new)
        return self._known[level][:count]

    def worth(self, level: int, finer: int, count: int, patient: bool) -> bool:
        """Whether a level is worth so many shots there and at a finer one; `patient` as in `Purse.allows`."""
        if self._purse is None:
            return patient
        return self._purse.allows(level, {one: self._new(one, count) for one in (level, finer)}, patient)

    def finest(self, count: int) -> tuple[int, Outcomes]:
        """The finest level at which so many shots are known, and their outcomes there."""
        level = max(level for level, known in self._known.items() if len(known) >= count)
        return level, self._known[level][:count]

    def _new(self, level: int, count: int) -> int:
        return max(0, count - (len(self._known[level]) if level in self._known else 0))
