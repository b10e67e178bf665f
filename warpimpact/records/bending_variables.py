"""The largest bending of the rigid core, and its break: its nominal stress exceeds its strength (kernels/bending.py).

A broken core goes on as one rigid body.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warpimpact.records.variable import HITS, Columns, Returned, Variable, VariableGroup

if TYPE_CHECKING:
    from warpimpact.scene import Scene, Shots

LARGEST_BENDING_MOMENT = Variable(
    "largest_bending_moment", HITS, "N m", "largest bending moment in the rigid core", shown_by=("inspect", "plot")
)
BENDING_SECTION = Variable("bending_section", HITS, "m", "distance of its section from the nose")
BENDING_STRESS = Variable(
    "bending_stress", HITS, "Pa", "largest nominal bending stress in the rigid core", shown_by=("inspect", "plot")
)
BENDING_STRESS_SECTION = Variable("bending_stress_section", HITS, "m", "distance of its section from the nose")
BROKEN = Variable("broken", HITS, "1", "1 where the bending stress passed the strength of the core, else 0")
BROKEN_TIME = Variable("broken_time", HITS, "s", "when the core broke, since the first touch of the front face")
BROKEN_X = Variable("broken_x", HITS, "m", "where the section that broke was, behind the front face")
BROKEN_SECTION = Variable(
    "broken_section", HITS, "m", "distance of the section that broke from the nose", field="broken_station"
)


def _bent(returned: Returned) -> Columns:
    """Columns of the bending: 0 without a section if the core touched nothing, NaN if the computation failed."""
    largest = returned.bending
    columns = {
        LARGEST_BENDING_MOMENT: largest["moment"],
        BENDING_SECTION: np.where(largest["moment"] > 0.0, largest["moment_station"], np.nan),
        BENDING_STRESS: largest["stress"],
        BENDING_STRESS_SECTION: np.where(largest["stress"] > 0.0, largest["stress_station"], np.nan),
    }
    return {name: np.where(returned.failed, np.nan, values).astype(np.float64) for name, values in columns.items()}


def _breaks(scene: Scene, shots: Shots) -> bool:
    return scene.record.bending and (scene.core.strength is not None or shots.strength is not None)


def _broken(returned: Returned) -> Columns:
    """Columns of the break: NaN if the computation failed. The time is the middle of a step."""
    bending, failed = returned.bending, returned.failed
    unbroken = failed | (bending["broken"] == 0)
    columns = {BROKEN: np.where(failed, np.nan, bending["broken"]).astype(np.float64)}
    for variable in (BROKEN_TIME, BROKEN_X, BROKEN_SECTION):
        columns[variable] = np.where(unbroken, np.nan, bending[variable.field]).astype(np.float64)
    return columns


BENDING_VARIABLES = VariableGroup(
    "With `output.bending`",
    (LARGEST_BENDING_MOMENT, BENDING_SECTION, BENDING_STRESS, BENDING_STRESS_SECTION),
    lambda scene, shots: scene.record.bending,
    _bent,
)
"""The stress is 4M/(πr³) where the core is thick enough (solver/rings.py)."""
BROKEN_VARIABLES = VariableGroup(
    "With `core.strength`", (BROKEN, BROKEN_TIME, BROKEN_X, BROKEN_SECTION), _breaks, _broken
)
