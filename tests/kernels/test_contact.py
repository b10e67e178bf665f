"""The load of one step: its force, its damping and its effect on the plate (docs/model.md §4)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from warpimpact.kernels import contact, structs
from warpimpact.kernels.variant import Variant

from .probes import CONE, OGIVE, astride, plate_of, poisoned, poisoned_fields, poisoned_touches, stepping, surface_of

Array = NDArray[np.float64]

VARIANT = Variant(double=True, rate_dependent=True)
vec3, quat = VARIANT.vec3, VARIANT.quat
struct = structs.build(VARIANT)
Surface, Plate, Fields, Law, Load = struct.Surface, struct.Plate, struct.Fields, struct.Law, struct.Load
Touches = struct.Touches

CELL = 0.25e-3
STRENGTH = 2.6e9
SOLID = np.ones((1, 1))  # a tile of a single cell
ALIGNED = np.array([[0.0, 0.0, 0.0, 1.0]])


LOADS = stepping(VARIANT, contact)


def law_of(*, a0: float = STRENGTH, a1: float = 0.0, a2: float = 0.0, **others: float) -> Any:
    law = Law()
    law.a0, law.a1, law.a2 = a0, a1, a2
    for name, value in ({"onset": 1e-3, "friction": 0.0, "decay_rate": 0.0} | others).items():
        setattr(law, name, value)
    return law


@dataclass
class Loaded:
    """Loads of poses, along the body axes; force and moment [poses, 3] in the plate frame; the exposure [poses,
    cells_y, cells_z] that they cause; and whether the windows hold the poses. If not, loads are NaN."""

    load: Any
    force: Array
    moment: Array
    exposure: Array
    inside: NDArray[np.bool_]


def loaded(
    surface: Any,
    law: Any,
    device: str,
    *,
    position: Array,
    attitude: Array,
    velocity: Array,
    omega: Array | None = None,
    thickness: float = 4.0e-3,
    dt: float = 1e-6,
    tile: Array = SOLID,
    cells: tuple[int, int] = (200, 200),
    length: float = 0.5e-3,
    spare: int = 0,
) -> Loaded:
    """Loads of poses in windows of some cells. There are as many spare slots before and behind, which are never
    opened."""
    count = len(position)
    plate = plate_of(Plate, tile, np.array(tile.shape) * CELL, CELL, device, length=length)
    fields = poisoned_fields(Fields, count + 2 * spare, *cells, device)
    touches = poisoned_touches(Touches, count + 2 * spare, surface, device)
    omega = np.zeros((count, 3)) if omega is None else omega
    arrays = {"position": position, "attitude": attitude, "velocity": velocity, "omega": omega}
    given = [wp.array(a, dtype=quat if n == "attitude" else vec3, device=device) for n, a in arrays.items()]
    inputs = [surface, plate, thickness, law, fields, touches, spare, *given, dt]
    inside, loads = poisoned(count, wp.bool, device), poisoned(count, Load, device)
    wp.launch(LOADS, count, inputs=inputs, outputs=[inside, loads], device=device)
    load, turned = loads.numpy(), Rotation.from_quat(attitude)
    return Loaded(
        load,
        turned.apply(load["force"]),
        turned.apply(load["moment"]),
        fields.exposure.numpy().reshape(-1, *cells)[spare : spare + count],
        inside.numpy(),
    )


@pytest.mark.parametrize(
    ("core", "friction", "tolerance"), [(CONE, 0.0, 1e-12), (OGIVE, 0.0, 1e-5), (CONE, 0.1, 2e-3), (OGIVE, 0.1, 2e-3)]
)
def test_straight_flight_deep_in_a_plate_meets_the_work_per_way(
    core: Any, friction: float, tolerance: float, device: str
) -> None:
    # §6.1, 6.2: F = −a0 [πR² + 2πη ∫ r ds over the nose]; the shank slides along itself. Rings straight along the
    # meridian are exact; closing speeds of the ogive's last ring reach down to 0, within the threshold of contact,
    # 1e-5 of the speed, and the second order of its bend.
    surface = surface_of(Surface, core, 128, 32, device)
    pose = {"position": np.array([[0.5, 0.0, 0.0]]), "attitude": ALIGNED, "velocity": np.array([[800.0, 0, 0]])}
    actual = loaded(surface, law_of(friction=friction), device, **pose, thickness=1.0)
    nose = core.radius(core.nose_length * (np.arange(4000) + 0.5) / 4000).mean() * core.nose_length
    expected = STRENGTH * (np.pi * core.max_radius**2 + 2 * np.pi * friction * nose)
    force, moment = actual.force[0], actual.moment[0]
    assert force[0] == pytest.approx(-expected, rel=tolerance)
    np.testing.assert_allclose(force[1:], 0.0, atol=1e-9 * expected)
    np.testing.assert_allclose(moment, 0.0, atol=1e-9 * expected * core.length)
    # The exposure gained, ∫ T dy dz, is the projected area in contact for one step.
    gained = actual.exposure.sum() * CELL**2
    assert gained == pytest.approx(1e-6 * np.pi * core.max_radius**2, rel=min(tolerance, 1e-5))
    if friction == 0:
        assert gained == pytest.approx(-1e-6 * force[0] / STRENGTH, rel=1e-12)


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

        def load_at(speeds: Array, surface: Any = surface) -> Loaded:
            moved = poses | {"velocity": speeds[:, :3].copy(), "omega": speeds[:, 3:].copy()}
            return loaded(surface, law_of(**law), device, **moved, dt=1e-12)

        jacobian = np.zeros((count, 6, 6))
        for k in range(6):
            ends = [load_at(speeds + sign * step * scale[k] * np.eye(6)[k]) for sign in (1, -1)]
            ends = [np.concatenate([end.force, end.moment], axis=1) for end in ends]
            jacobian[:, :, k] = (ends[0] - ends[1]) / (2 * step * scale[k])
        load = load_at(speeds).load
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
