"""A solid plate beside results made by hand."""

import numpy as np
import xarray


def with_solid(dataset: xarray.Dataset, velocity: np.ndarray | float, tilt: np.ndarray | float = 0.0) -> xarray.Dataset:
    """The same with these residual velocities [m/s] and tilts at 130 mm [degree] behind the solid plate, one or one per
    shot."""
    velocity, tilt = np.broadcast_arrays(np.atleast_1d(velocity), tilt)
    return dataset.assign(
        solid_status=("solid_hit", np.zeros(len(velocity), dtype=np.int8)),
        solid_residual_velocity=("solid_hit", velocity),
        solid_tilt=(("solid_hit", "standoff"), np.stack([0.0 * tilt, tilt], axis=1)),
    )
