"""The damping of the load of one step (docs/model.md §4)."""

from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from warpimpact.kernels import contact, core_surface, footprint, structs
from warpimpact.kernels.variant import Variant

from .probes import CONE, astride, plate_of, poisoned, poisoned_fields, poisoned_touches, surface_of

Array = NDArray[np.float64]

VARIANT = Variant(double=True, rate_dependent=True)
real, vec3, quat = VARIANT.real, VARIANT.vec3, VARIANT.quat
struct = structs.build(VARIANT)
Surface, Plate, Fields, Law, Load = struct.Surface, struct.Plate, struct.Fields, struct.Law, struct.Load
Touches = struct.Touches

CELL, CELLS = 0.25e-3, (200, 200)
use = VARIANT.use(contact, core_surface, footprint)


def loads(
    surface: Surface,
    plate: Plate,
    law: Law,
    fields: Fields,
    touches: Touches,
    position: wp.array(dtype=vec3),
    attitude: wp.array(dtype=quat),
    velocity: wp.array(dtype=vec3),
    omega: wp.array(dtype=vec3),
    dt: real,
    loads: wp.array(dtype=Load),
) -> None:
    """One step of every pose, each on its own plate."""
    i = wp.tid()
    context, slab = struct.Context(), struct.Slab()
    context.slot = i
    context.surface = surface
    context.touches = touches
    context.fields = use.contact.fields_of_slot(fields, i)
    slab.plate = plate
    slab.law = law
    slab.dt = dt
    slab.window = use.contact.open_window(plate, real(4.0e-3), context.fields, 0, wp.vec2d())
    slab.pose = use.core_surface.pose_of(surface, position[i], attitude[i], velocity[i], omega[i])
    slab.footprint = use.footprint.footprint_of(surface, plate, slab.window, slab.pose, dt)
    loads[i] = use.contact.load_on(context, slab)


LOADS = VARIANT.kernel(loads)


def law_of(**members: float) -> Any:
    law = Law()
    for name, value in ({"a0": 2.6e9, "friction": 0.0, "decay_rate": 0.0} | members).items():
        setattr(law, name, value)
    return law


def loaded(surface: Any, law: Any, device: str, *, dt: float, **poses: Array) -> tuple[Any, Array]:
    """Loads of poses in a solid plate, along the body axes; and force and moment in the plate frame, [poses, 6]."""
    count = len(poses["position"])
    plate = plate_of(Plate, np.ones((1, 1)), (CELL, CELL), CELL, device)
    fields = poisoned_fields(Fields, count, *CELLS, device)
    touches = poisoned_touches(Touches, count, surface, device)
    given = [wp.array(a, dtype=quat if n == "attitude" else vec3, device=device) for n, a in poses.items()]
    loads, inputs = poisoned(count, Load, device), [surface, plate, law, fields, touches, *given, dt]
    wp.launch(LOADS, count, inputs=inputs, outputs=[loads], device=device)
    load, turned = loads.numpy(), Rotation.from_quat(poses["attitude"])
    return load, np.concatenate([turned.apply(load["force"]), turned.apply(load["moment"])], axis=1)


@pytest.mark.parametrize(
    "law", [{"onset": 1e5}, {"onset": 1e-7, "a1": 4e6, "a2": 7850.0}], ids=["ramp of the contact", "rate"]
)
def test_damping_tends_to_half_the_derivative_of_the_load(law: dict[str, float], device: str) -> None:
    # The trapezoid rule: (M + ½ dt J) Δu = dt F, J = −∂F/∂u. The damping takes the normals and places of the rings, the
    # load those of the parts of curved patches that touch: they differ by a patch.
    poses, step, count = astride(12), 1e-4, 12
    poses["omega"] = poses["omega"] / 10
    speeds = np.concatenate([poses["velocity"], poses["omega"]], axis=1)
    scale = np.array([1.0] * 3 + [1e2] * 3)  # lever arms are some 10 mm
    turn = np.zeros((count, 6, 6))
    turn[:, :3, :3] = turn[:, 3:, 3:] = Rotation.from_quat(poses["attitude"]).as_matrix()
    errors = []
    for rings, around in ((4, 48), (32, 384)):
        surface = surface_of(Surface, CONE, rings, around, device)

        def load_at(speeds: Array, surface: Any = surface) -> tuple[Any, Array]:
            moved = poses | {"velocity": speeds[:, :3].copy(), "omega": speeds[:, 3:].copy()}
            return loaded(surface, law_of(**law), device, dt=1e-12, **moved)

        jacobian = np.zeros((count, 6, 6))
        for k in range(6):
            ends = [load_at(speeds + sign * step * scale[k] * np.eye(6)[k]) for sign in (1, -1)]
            jacobian[:, :, k] = (ends[0][1] - ends[1][1]) / (2 * step * scale[k])
        load, _ = load_at(speeds)
        damping = np.zeros((count, 6, 6))
        damping[:, :3, :3], damping[:, 3:, 3:] = load["damping_vv"], load["damping_ww"]
        damping[:, :3, 3:] = load["damping_vw"]
        damping[:, 3:, :3] = load["damping_vw"].transpose(0, 2, 1)
        damping = turn @ damping @ turn.transpose(0, 2, 1)
        jacobian, damping = (m * scale[:, None] * scale for m in (jacobian, damping))
        errors.append(np.abs(damping + jacobian / 2).max() / np.abs(jacobian).max())
        assert np.abs(jacobian).max(axis=(1, 2)).astype(bool).sum() > count / 3
        np.testing.assert_array_equal(load["damped"], damping.any(axis=(1, 2)))
    # First order in the patches, and at most an eighth of the angle of a patch.
    assert errors[1] < errors[0] / 6
    assert errors[1] < 2 * np.pi / 384 / 8
