"""A solid plate beside results made by hand."""

import numpy as np
import xarray

from warpimpact.results import variables as v
from warpimpact.results.references import with_references


def with_solid(dataset: xarray.Dataset, velocity: np.ndarray | float, tilt: np.ndarray | float = 0.0) -> xarray.Dataset:
    """The same with these residual velocities [m/s] and tilts at 130 mm [degree] behind the solid plate, one or one per
    shot."""
    velocity, tilt = np.broadcast_arrays(np.atleast_1d(velocity), tilt)
    shots = dataset[v.shot_variables(dataset)].isel(hit=slice(len(velocity)))
    solid = shots.assign_coords(dataset[[v.STANDOFF, v.PRESENTED_AREA]].coords).assign(
        status=("hit", np.zeros(len(velocity), dtype=np.int8)),
        residual_velocity=("hit", velocity),
        tilt=(("hit", "standoff"), np.stack([0.0 * tilt, tilt], axis=1)),
    )
    return with_references(dataset, {"solid": solid})
