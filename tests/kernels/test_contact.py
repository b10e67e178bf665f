"""The contact law: when an element or a part of a curved patch touches, what it carries, and how a step damps it
(docs/model.md §4).
"""

import math
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from warpimpact.kernels import contact, core_surface, footprint, interaction, structs
from warpimpact.kernels.variant import Variant

from .probes import CONE, astride, plate_of, poisoned, poisoned_fields, poisoned_touches, records, surface_of

Array = NDArray[np.float64]

VARIANT = Variant(double=True, rate_dependent=True)
real, vec3, quat = VARIANT.real, VARIANT.vec3, VARIANT.quat
use, struct = VARIANT.use(contact, core_surface, footprint, interaction), structs.build(VARIANT)
Surface, Plate, Fields, Law, Load = struct.Surface, struct.Plate, struct.Fields, struct.Law, struct.Load
Touches, Contact = struct.Touches, struct.Contact
Ring, Patch, Face = struct.Ring, struct.Patch, struct.Face

CELL, CELLS = 0.25e-3, (200, 200)


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


ONSET = 4.0
SINGLE = Variant()
single = SINGLE.use(interaction)
SingleLaw = structs.build(SINGLE).Law


def law(
    law: Law,
    closing: wp.array(dtype=real),
    variation: wp.array(dtype=real),
    speed: wp.array(dtype=real),
    contacts: wp.array(dtype=Contact),
) -> None:
    i = wp.tid()
    actual = use.interaction.contact_of(law, closing[i], variation[i], speed[i])
    touching = closing[i] + actual.shift * variation[i] * variation[i]
    actual.slope = use.interaction.steady_slope(law, actual.share, actual.slope, touching)
    contacts[i] = actual


def onset(law: Law, dt: real, velocity: wp.array(dtype=real), impact: real, onsets: wp.array(dtype=real)) -> None:
    i = wp.tid()
    onsets[i] = use.interaction.onset_speed(law, dt, velocity[i], impact)


def exponential(law: SingleLaw, x: wp.array(dtype=wp.float32), values: wp.array(dtype=wp.float32)) -> None:
    i = wp.tid()
    values[i] = single.interaction.remaining(law, x[i])


LAW, ONSET_SPEED = VARIANT.kernel(law), VARIANT.kernel(onset)
EXPONENTIAL = SINGLE.kernel(exponential)


def filled(struct: Any) -> Any:
    law = struct()
    law.onset = ONSET
    return law


def applied(
    closing: Any,
    device: str,
    *,
    variation: Any = 0.0,
    speed: Any = 1.0,
    steadied: float = 0.0,
) -> SimpleNamespace:
    given = [np.array(a) for a in np.broadcast_arrays(closing, variation, speed)]
    contacts = poisoned(len(given[0]), Contact, device)
    law = filled(Law)
    law.steadied = steadied
    inputs = [law, *(wp.array(a, dtype=real, device=device) for a in given)]
    wp.launch(LAW, len(given[0]), inputs=inputs, outputs=[contacts], device=device)
    actual = contacts.numpy()
    return SimpleNamespace(fraction=actual["share"], rise=actual["slope"], shift=actual["shift"])


VARIATIONS = pytest.mark.parametrize("variation", [1e-3 * ONSET, 0.5 * ONSET, 50.0 * ONSET])


def spread(closing: Array, variation: float) -> tuple[Array, Array, Array]:
    """Places within patches, in halves of them, their closing speeds and their shares of contact; [patches, places]."""
    places = (2 * (np.arange(4000) + 0.5) / 4000 - 1)[None, :]
    speeds = closing[:, None] + variation * places
    return places, speeds, (speeds / ONSET).clip(0, 1)


@VARIATIONS
def test_share_of_a_patch_is_the_mean_of_its_parts(variation: float, device: str) -> None:
    # Mean of min(1, x/w) for x > 0 over x = closing ± variation. The numerical mean is good to 1/4000 of the slope; the
    # threshold is 1e-5 of a speed of 1 m/s.
    closing = (variation + ONSET) * np.linspace(-2, 2, 401)
    _, _, shares = spread(closing, variation)
    fraction = applied(closing, device, variation=variation).fraction
    np.testing.assert_allclose(fraction, shares.mean(axis=1), rtol=0, atol=1e-5 / ONSET + 1e-6 * variation / ONSET)


def test_small_variation_leaves_the_ramp_as_it_is(device: str) -> None:
    closing = ONSET * np.linspace(-1, 2, 301)
    for variation in (0.0, 1e-30, 1e-12):
        actual = applied(closing, device, variation=variation)
        np.testing.assert_allclose(actual.fraction, (closing / ONSET).clip(0, 1), rtol=0, atol=1e-5)
        assert np.abs(actual.shift * variation).max() < 1e-9


def test_wall_that_slides_along_itself_does_not_touch(device: str) -> None:
    # Rounding in float32 gives v_p·n of some 1e-7 of the speed (docs/model.md §4: a small stated threshold).
    speed = 800.0
    fraction = applied(speed * np.array([1e-7, -1e-7, 1e-6, 1e-4]), device, speed=speed).fraction
    np.testing.assert_array_equal(fraction[:3], 0.0)
    assert 0 < fraction[3] < 0.1 * speed / ONSET


def test_onset_follows_the_step_and_a_core_that_slows_down(device: str) -> None:
    law = filled(Law)
    law.onset_jump, law.onset_limit = 1e7, 0.02
    velocity = np.array([800.0, 100.0, 1.0, 0.0])
    onsets = poisoned(4, real, device)
    inputs = [law, 2e-7, wp.array(velocity, dtype=real, device=device), 800.0]
    wp.launch(ONSET_SPEED, 4, inputs=inputs, outputs=[onsets], device=device)
    # The jump times the step, at most 2 % of the velocity, at least 1e-4 of the impact velocity.
    np.testing.assert_allclose(onsets.numpy(), [2.0, 2.0, 0.08, 0.08], rtol=1e-12)
    # The law's own where that is wider.
    law.onset_share = 0.005
    wp.launch(ONSET_SPEED, 4, inputs=inputs, outputs=[onsets], device=device)
    np.testing.assert_allclose(onsets.numpy(), [4.0, 2.0, 0.08, 0.08], rtol=1e-12)


def single_exponential(x: Array, device: str) -> Array:
    """e^x in single precision, computed as the share that is left at a rate of 1/s."""
    law = SingleLaw()
    law.decay_rate = 1.0
    values = poisoned(len(x), wp.float32, device)
    given = wp.array(x, dtype=wp.float32, device=device)
    wp.launch(EXPONENTIAL, len(x), inputs=[law, given], outputs=[values], device=device)
    return values.numpy()


def test_single_precision_exponential_is_numpy_s(device: str) -> None:
    x = np.concatenate([np.linspace(-87.3, 87.3, 200_001), np.linspace(-1e-3, 1e-3, 2001)]).astype(np.float32)
    actual, expected = single_exponential(x, device).astype(float), np.exp(x.astype(float))
    # x log2(e) is rounded: half a unit of the last place of up to 126 is 126 ln 2 × 2^-24 at the ends.
    bound = 3e-7 + np.abs(x) * 2.0**-23
    assert (np.abs(actual / expected - 1) < bound).all()
    assert single_exponential(np.array([0.0, -0.0]), device).tolist() == [1.0, 1.0]


SLIDING = 100.0  # [m/s]


def grips(
    law: Law,
    speed: real,
    rings: wp.array(dtype=Ring),
    patches: wp.array(dtype=Patch),
    grips: wp.array(dtype=Contact),
    faces: wp.array(dtype=Face),
) -> None:
    i = wp.tid()
    pose = struct.Pose()
    pose.speed = speed
    grips[i] = use.interaction.grip_of(law, pose, rings[i], patches[i])
    faces[i] = use.interaction.face_of(rings[i], patches[i], grips[i].shift)


GRIPS = VARIANT.kernel(grips)


def bounds(
    law: Law,
    velocities: wp.array(dtype=VARIANT.vec3),
    omegas: wp.array(dtype=VARIANT.vec3),
    rings: wp.array(dtype=Ring),
    shares: wp.array(dtype=real),
    closes: wp.array(dtype=wp.bool),
) -> None:
    i = wp.tid()
    pose = struct.Pose()
    pose.velocity = velocities[i]
    pose.omega = omegas[i]
    share = real(0.0)
    for k in range(64):
        azimuth = real(k) * real(2.0 * math.pi / 64.0)
        patch = use.core_surface.patch_at(pose, rings[i], wp.cos(azimuth), wp.sin(azimuth))
        share = wp.max(share, use.interaction.grip_of(law, pose, rings[i], patch).share)
    shares[i] = share
    closes[i] = use.core_surface.closes(pose, rings[i])


BOUNDS = VARIANT.kernel(bounds)


def gripped(device: str, *, speed: float, onset: float = 1e-9, **columns: Any) -> Any:
    """Contacts of patches and the parts that touch, from members of rings and patches of shape [n]; the onset far below
    their speeds."""
    members = {struct: struct.numpy_dtype()["names"] for struct in (Ring, Patch)}
    rings, patches = (
        records(struct, device, **{name: value for name, value in columns.items() if name in names})
        for struct, names in members.items()
    )
    law, results = Law(), [poisoned(len(rings), struct, device) for struct in (Contact, Face)]
    law.onset = onset
    wp.launch(GRIPS, len(rings), inputs=[law, speed, rings, patches], outputs=results, device=device)
    return {name: array.numpy()[name] for array in results for name in array.numpy().dtype.names}


def bent(slant: Array, bend: Any, sector: Any, velocity: Array) -> dict[str, Any]:
    """Members of rings and patches [n]: normals at angles `slant` to the plane of the ring, ±`bend` along the meridian
    and ±`sector` around; velocity (axial, outward, around) of shape [n, 3]."""
    normal_axial, normal_radial = np.sin(slant), np.cos(slant)
    return {
        "normal_axial": normal_axial,
        "normal_radial": normal_radial,
        "turn_axial": np.sin(bend) * normal_radial,
        "turn_radial": -np.sin(bend) * normal_axial,
        "sector": np.broadcast_to(sector, slant.shape),
        "velocity_axial": velocity[:, 0],
        "velocity_outward": velocity[:, 1],
        "velocity_around": velocity[:, 2],
        "closing": normal_axial * velocity[:, 0] + normal_radial * velocity[:, 1],
    }


def closing_part(
    slant: Array, bend: float, sector: float, velocity: Array, cells: tuple[int, int]
) -> tuple[Array, ...]:
    """Share of the bent patches that closes in, its mean normal [n, 3] and mean closing speed, from so many
    elements."""
    along = bend * (2 * (np.arange(cells[0]) + 0.5) / cells[0] - 1)[:, None]
    around = sector * (2 * (np.arange(cells[1]) + 0.5) / cells[1] - 1)[None, :]
    shares, normals, speeds = [], [], []
    for angle, v in zip(slant, velocity, strict=True):
        radial = np.cos(angle + along)
        normal = np.stack(
            np.broadcast_arrays(np.sin(angle + along), radial * np.cos(around), radial * np.sin(around)), axis=-1
        )
        closing = normal @ v
        touching = closing > 0
        shares.append(touching.mean())
        normals.append(normal[touching].mean(axis=0) if touching.any() else np.full(3, np.nan))
        speeds.append(closing[touching].mean() if touching.any() else np.nan)
    return np.array(shares), np.array(normals), np.array(speeds)


def grazing(count: int, bend: float, sector: float) -> tuple[Array, Array]:
    """Slants of normals, and velocities along which parts of so bent patches close in while they slide at `SLIDING`,
    within 60° of the way of the (greater) bend."""
    rng = np.random.default_rng(11)
    slant = rng.uniform(-1.0, 1.0, count)
    normal = np.stack([np.sin(slant), np.cos(slant), 0 * slant], axis=1)
    meridian = np.stack([np.cos(slant), -np.sin(slant), 0 * slant], axis=1)
    angle = rng.uniform(-np.pi / 3, np.pi / 3, count) + np.pi * rng.integers(0, 2, count)
    along, around = (np.cos(angle), np.sin(angle)) if bend > 0 else (np.sin(angle), np.cos(angle))
    sideways = along[:, None] * meridian + around[:, None] * np.array([0.0, 0.0, 1.0])
    closing = rng.uniform(-1.3, 1.3, count) * np.hypot(along * np.sin(bend), around * sector * np.cos(slant))
    return slant, SLIDING * (sideways + closing[:, None] * normal)


@pytest.mark.parametrize("way", ["meridian", "around"])
def test_part_of_a_patch_bent_one_way_that_touches_is_the_part_that_closes_in(way: str, device: str) -> None:
    # Normals vary linearly but for ½ angle² of their length. So do closing speeds: a bend along the meridian leaves
    # ½ angle² of the speed at the centre; one around, ½ angle² of the speed outwards, which is at most 1.5 times that
    # around here and shifts the edge of contact by up to 0.4 angle of the patch.
    for angle in (0.2, 0.1, 0.05):
        bend, sector, cells = (angle, 0.0, (20_000, 1)) if way == "meridian" else (0.0, angle, (1, 20_000))
        slant, velocity = grazing(200, bend, sector)
        results = gripped(device, speed=1e-3, **bent(slant, bend, sector, velocity))
        share, normal, closing = closing_part(slant, bend, sector, velocity, cells)
        some = (share > 0.01) & (results["share"] > 0.01)
        assert (some & (share < 0.99)).sum() > 100
        means = np.stack([results["axial"], results["outward"], results["around"]], axis=1)
        tolerance = 0.4 * (angle**2 if way == "meridian" else angle)
        np.testing.assert_allclose(results["share"], share, rtol=0, atol=tolerance)
        np.testing.assert_allclose(means[some], normal[some], rtol=0, atol=angle**2 / 2)
        np.testing.assert_allclose(results["closing"][some], closing[some], rtol=0, atol=SLIDING * angle**2 / 8)


@pytest.mark.parametrize("flank", [True, False])
def test_no_ring_is_left_out_of_which_a_part_closes_in(flank: bool, device: str) -> None:
    # Cores that move away from their own flank, or back, and of which the ends of a ring swing the other way.
    count = 20_000
    rng = np.random.default_rng(14)
    slant, half = rng.uniform(-0.3, 0.3, count), rng.uniform(1e-4, 2e-3, count)
    slant = slant if flank else 0.5 * np.pi - np.abs(slant)  # normals point outwards
    members = bent(slant, rng.uniform(-0.02, 0.02, count), 0.05, np.zeros((count, 3)))
    place = {"station": rng.uniform(-1e-3, 1e-3, count), "radius": rng.uniform(1e-4, 4e-3, count)}
    halves = {"half_axial": -half * members["normal_radial"], "half_radial": half * members["normal_axial"]}
    names = Ring.numpy_dtype()["names"]
    rings = records(Ring, device, **{k: v for k, v in (members | place | halves).items() if k in names})
    away = -np.sign(np.sin(slant))[:, None] * np.array([1.0, 0.0, 0.0])
    velocities, omegas = away * rng.uniform(0.0, 30.0, (count, 1)), rng.normal(0.0, 1e4, (count, 3))
    omegas[:, 0] = 0.0
    law, results = Law(), (wp.empty(count, dtype=real, device=device), wp.empty(count, dtype=wp.bool, device=device))
    law.onset = 1e-9
    given = [wp.array(x, dtype=VARIANT.vec3, device=device) for x in (velocities, omegas)]
    wp.launch(BOUNDS, count, inputs=[law, *given, rings], outputs=list(results), device=device)
    touching, closes = (array.numpy() for array in results)
    assert closes[touching > 0.0].all()
    assert 100 < (touching > 0.0).sum() < count
    assert not closes.all()
