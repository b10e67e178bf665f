"""Keys that a campaign must have so that its result has a measure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from warpimpact.results.measures import Measure
from warpimpact.results.variables import BENDING_VARIABLES, BROKEN_VARIABLES, DEPTH
from warpimpact.results.vocabulary import BASE, STRENGTH


def lacking(
    measure: Measure, *, standoffs: Sequence[float] | None, layered: bool, bending: bool, breakable: bool
) -> str:
    """Keys that a campaign needs for a measure of its hits and does not have; empty if it lacks none.

    It may have layers behind the plate, record bending, and have cores with a strength. Its stand-offs [m] are None
    where they are not known yet, but some are computed.
    """
    quantity = measure.quantity
    needed = "" if quantity.need is None else quantity.need.name
    if needed in (BASE.name, DEPTH) and not layered:
        return BASE.keys
    if needed in BROKEN_VARIABLES and not (bending and breakable):
        return STRENGTH.keys
    if needed in BENDING_VARIABLES and not bending:
        return "output.bending = true"
    if not quantity.has_standoff or standoffs is None:
        return ""
    if not standoffs:
        return "output.standoffs"
    if measure.standoff is None or np.isclose(measure.standoff, standoffs, rtol=1e-9, atol=0.0).any():
        return ""
    return f"{measure.standoff:g} m in output.standoffs, which are {', '.join(f'{at:g} m' for at in standoffs)}"
