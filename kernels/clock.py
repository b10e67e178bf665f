"""The time of a shot: steps of several lengths, each of which counts from mid-step.

A kick acts at the middle of its step, and the core drifts freely from there to the middle of the next step (leapfrog).
The position of a step is therefore the one at mid-step, and the state after the last kick is drifted to the middle of a
step that is not computed. Steps are counted as if all had the shortest length, and only the excess of longer ones is
summed, so a shot of equal steps has times without rounding errors.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import structs
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the clock for one variant."""
    struct, real = structs.build(variant), variant.real
    half = real(0.5)

    @wp.func
    def started(shortest: real, step: real):
        """The clock at the middle of the first step, which is `step` long [s]."""
        clock = struct.Clock()
        clock.shortest = shortest
        clock.step = step
        clock.beyond = half * (step - shortest)
        return clock

    @wp.func
    def now(clock: struct.Clock):
        """Time since the start of the shot at mid-step [s]."""
        return (real(clock.steps) + half) * clock.shortest + clock.beyond

    @wp.func
    def in_contact(clock: struct.Clock):
        """The clock of a step that touches material."""
        counted = clock
        counted.contact_steps += 1
        counted.contact_beyond += clock.step - clock.shortest
        return counted

    @wp.func
    def contact_duration(clock: struct.Clock):
        """Length of all steps that touched material [s]."""
        return real(clock.contact_steps) * clock.shortest + clock.contact_beyond

    @wp.func
    def drift_time(clock: struct.Clock, following: real):
        """Time from this mid-step to that of the `following` step, without a free flight between them [s]."""
        return half * (clock.step + following)

    @wp.func
    def advanced(clock: struct.Clock, following: real, free: real):
        """The clock at the middle of the `following` step [s], after a `free` flight between the steps [s]."""
        later = clock
        later.beyond += drift_time(clock, following) - clock.shortest + free
        later.step = following
        later.steps += 1
        return later

    return SimpleNamespace(**locals())
