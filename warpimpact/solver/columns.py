"""Numbers of a scene that may differ from shot to shot of one computation, as columns of Shots."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
from numpy.typing import NDArray

from warpimpact.scene import Plate
from warpimpact.scene.quantities import OF_THE_SCENE, QUANTITIES
from warpimpact.solver.materials import decay_rate

Array = NDArray[np.float64]
Path = tuple[str | int, ...]
"""Place of a key in the tables of a scene, such as ("plate", "pattern", "spacing", 0)."""

COLUMN_OF: dict[Path, str] = {(QUANTITIES[name].table, name): name for name in OF_THE_SCENE}
"""Name of the column, by the path."""
UNITS_OF_EXPOSURE: tuple[Path, ...] = (("plate", "degradation_interval"), ("plate", "degradation_distance"))
"""β per Δt_β is the same law as β^(Δt₀/Δt_β) per Δt₀, so these become a degradation of the shot."""


def columns_of(values: Mapping[Path, Array], plate: Plate) -> dict[str, Array]:
    """Columns of Shots for some values, each of their shape.

    Args:
        values: values by path. Paths that make no column are left out.
        plate: plate of the scene. Its degradation and unit of exposure hold where no value replaces them.
    """
    columns = {name: values[path] for path, name in COLUMN_OF.items() if path in values}
    for path in UNITS_OF_EXPOSURE:
        if path in values:
            base = columns.get("degradation", np.full_like(values[path], plate.degradation))
            columns["degradation"] = np.exp(decay_rate(base, 1.0) * plate.degradation_unit / values[path])
    return columns
