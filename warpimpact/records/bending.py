"""The largest bending of the rigid core (kernels/bending.py)."""

from __future__ import annotations

import numpy as np

from warpimpact.records.group import Columns, Group, Returned
from warpimpact.records.variable import HITS, Variable

LARGEST_BENDING_MOMENT = Variable(
    "largest_bending_moment", HITS, "N m", "largest bending moment in the rigid core", shown_by=("inspect", "plot")
)
BENDING_SECTION = Variable("bending_section", HITS, "m", "distance of its section from the nose")
BENDING_STRESS = Variable(
    "bending_stress", HITS, "Pa", "largest nominal bending stress in the rigid core", shown_by=("inspect", "plot")
)
BENDING_STRESS_SECTION = Variable("bending_stress_section", HITS, "m", "distance of its section from the nose")


def _bent(returned: Returned) -> Columns:
    """0, without a section, of a core that touched nothing; NaN where the computation failed."""
    found = returned.bending
    columns = {
        LARGEST_BENDING_MOMENT: found["moment"],
        BENDING_SECTION: np.where(found["moment"] > 0.0, found["moment_station"], np.nan),
        BENDING_STRESS: found["stress"],
        BENDING_STRESS_SECTION: np.where(found["stress"] > 0.0, found["stress_station"], np.nan),
    }
    return {name: np.where(returned.failed, np.nan, values).astype(np.float64) for name, values in columns.items()}


BENDING_VARIABLES = Group(
    "With `output.bending`",
    (LARGEST_BENDING_MOMENT, BENDING_SECTION, BENDING_STRESS, BENDING_STRESS_SECTION),
    lambda scene, shots: scene.record.bending,
    _bent,
)
"""The stress is 4M/(πr³), where the core is thick enough (solver/rings.py)."""
