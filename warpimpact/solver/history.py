"""The history of one shot: the columns of its trace by name, and quantities that follow from them."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.trace import COLUMNS
from warpimpact.scene import MassProperties

Array = NDArray[np.float64]


@dataclass(frozen=True)
class History:
    """State of a core in the middle of every step and at the end of contact: plate frame, SI.

    Attributes:
        time: since the first touch of the front face [s], shape [steps].
        step: length of the step, over which force and moment act [s], shape [steps].
        position: of the centre of mass, from the hit point [m], shape [steps, 3].
        attitude: unit quaternion (x, y, z, w) that turns the plate's axes into the core's, shape [steps, 4].
        core_axis: unit vector along the core towards its nose, shape [steps, 3].
        velocity: of the centre of mass, at the end of the step [m/s], shape [steps, 3].
        angular_velocity: at the end of the step [rad/s], shape [steps, 3].
        force, moment: means over the step, about the centre of mass [N] and [N m], shape [steps, 3].
        translational_energy, rotational_energy: at the end of the step [J], shape [steps].
    """

    time: Array
    step: Array
    position: Array
    attitude: Array
    core_axis: Array
    velocity: Array
    angular_velocity: Array
    force: Array
    moment: Array
    translational_energy: Array
    rotational_energy: Array

    @classmethod
    def from_trace(cls, trace: Array, body: MassProperties) -> Self:
        """Read a trace of shape [steps, WIDTH] (kernels/trace.py)."""
        from scipy.spatial.transform import Rotation  # a third of a second to import

        columns = (trace[:, part] for part in COLUMNS.values())
        time, position, attitude, velocity, momentum, force, moment, step = columns
        axis = Rotation.from_quat(attitude).apply([1.0, 0.0, 0.0])
        spin = np.sum(momentum * axis, axis=1, keepdims=True)
        along = spin * axis
        omega = along / body.inertia_axial + (momentum - along) / body.inertia_transverse
        # L × a is 0 where L − (L·a) a is what rounding leaves; ½ L·ω of a spinning disc would take it for a rotation.
        across = np.cross(momentum, axis)
        return cls(
            time=time[:, 0],
            step=step[:, 0],
            position=position,
            attitude=attitude,
            core_axis=axis,
            velocity=velocity,
            angular_velocity=omega,
            force=force,
            moment=moment,
            translational_energy=0.5 * body.mass * np.sum(velocity**2, axis=1),
            rotational_energy=0.5
            * (spin[:, 0] ** 2 / body.inertia_axial + np.sum(across**2, axis=1) / body.inertia_transverse),
        )
