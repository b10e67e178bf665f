"""When and where a core broke: its nominal bending stress passed its strength. It goes on as one rigid body."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warpimpact.records.group import Columns, Group, Returned
from warpimpact.records.variable import HITS, Variable

if TYPE_CHECKING:
    from warpimpact.scene import Scene, Shots

BROKEN = Variable("broken", HITS, "1", "1 where the bending stress passed the strength of the core, else 0")
BROKEN_TIME = Variable("broken_time", HITS, "s", "when the core broke, since the first touch of the front face")
BROKEN_X = Variable("broken_x", HITS, "m", "where the section that broke was, behind the front face")
BROKEN_SECTION = Variable(
    "broken_section", HITS, "m", "distance of the section that broke from the nose", field="broken_station"
)


def _breaks(scene: Scene, shots: Shots) -> bool:
    return scene.record.bending and (scene.core.strength is not None or shots.strength is not None)


def _broken(returned: Returned) -> Columns:
    """NaN where the computation failed; the time is the middle of a step."""
    found, failed = returned.bending, returned.failed
    unbroken = failed | (found["broken"] == 0)
    where = {one: np.where(unbroken, np.nan, found[one.field]) for one in (BROKEN_TIME, BROKEN_X, BROKEN_SECTION)}
    columns = {BROKEN: np.where(failed, np.nan, found["broken"])} | where
    return {name: values.astype(np.float64) for name, values in columns.items()}


BROKEN_VARIABLES = Group("With `core.strength`", (BROKEN, BROKEN_TIME, BROKEN_X, BROKEN_SECTION), _breaks, _broken)
