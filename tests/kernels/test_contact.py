"""One step's load: the cells it may touch, its force and damping, and what it does to the plate (MODEL.md §4)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from warpimpact.kernels import contact, core_surface, interaction, plate_grid, rigid_body
from warpimpact.kernels.variant import Variant
from warpimpact.scene import ConeCore, OgiveCore, ProfileCore

from .probes import attitudes, plate_of, poisoned, poisoned_fields, poisoned_touches, records, surface_of

Array = NDArray[np.float64]

VARIANT = Variant(double=True, rate_dependent=True)
real, vec3, quat = VARIANT.real, VARIANT.vec3, VARIANT.quat
surfaces, grid, laws, motion, contacts = (
    part.build(VARIANT) for part in (core_surface, plate_grid, interaction, rigid_body, contact)
)
Surface, Plate, Fields, Law, Load = surfaces.Surface, grid.Plate, grid.Fields, laws.Law, motion.Load
Footprint, Touches = contacts.Footprint, contacts.Touches
Ring, Patch, Grip = surfaces.Ring, surfaces.Patch, contacts.Grip

CELL = 0.25e-3
OGIVE = OgiveCore(diameter=6.17e-3, crh=3.0, length=27.0e-3, mass=5.25e-3)
CONE = ConeCore(diameter=6.0e-3, length=20.0e-3, cone_length=12.0e-3, mass=3.0e-3)
STRENGTH = 2.6e9
SLIDING = 100.0  # [m/s]
SOLID, HOLE = np.ones((1, 1)), np.zeros((1, 1))  # tiles of a single cell
ALIGNED = np.array([[0.0, 0.0, 0.0, 1.0]])


def footprints(
    surface: Surface,
    plate: Plate,
    fields: Fields,
    position: wp.array(dtype=vec3),
    attitude: wp.array(dtype=quat),
    velocity: vec3,
    omega: vec3,
    dt: real,
    found: wp.array(dtype=Footprint),
    immersed: wp.array2d(dtype=wp.int32),
    rows: wp.array3d(dtype=wp.int32),
    columns: wp.array3d(dtype=wp.int32),
) -> None:
    """The footprints of poses; per ring whether anything is immersed, per patch its first cell."""
    i = wp.tid()
    window = contacts.open_window(plate, fields, i, wp.float64(0.0), wp.float64(0.0))
    pose = surfaces.pose_of(surface, position[i], attitude[i], velocity, omega)
    found[i] = contacts.footprint_of(surface, plate, fields, window, pose, dt)
    for k in range(surface.rings):
        ring = surfaces.ring_at(surface, pose, k)
        immersed[i, k] = 0
        for j in range(surface.around):
            patch = surfaces.patch_at(pose, ring, surface.cosine[ring.first + j], surface.sine[ring.first + j])
            if surfaces.immersed_area(pose, ring, patch, plate.thickness, dt) > real(0.0):
                immersed[i, k] = 1
            cell = grid.cell_at(fields, window, patch.y, patch.z)
            rows[i, k, j] = (cell.index - window.first) // fields.cells_z
            columns[i, k, j] = (cell.index - window.first) % fields.cells_z


def loads(
    surface: Surface,
    plate: Plate,
    law: Law,
    fields: Fields,
    touches: Touches,
    first: wp.int32,
    position: wp.array(dtype=vec3),
    attitude: wp.array(dtype=quat),
    velocity: wp.array(dtype=vec3),
    omega: wp.array(dtype=vec3),
    dt: real,
    loads: wp.array(dtype=Load),
) -> None:
    """The load of one step of every pose, each on a plate of its own, from slot `first` on."""
    i = wp.tid()
    slot = first + i
    window = contacts.open_window(plate, fields, slot, wp.float64(0.0), wp.float64(0.0))
    pose = surfaces.pose_of(surface, position[i], attitude[i], velocity[i], omega[i])
    found = contacts.footprint_of(surface, plate, fields, window, pose, dt)
    loads[i] = contacts.load_on(surface, plate, law, fields, window, touches, slot, found, pose, dt)


def grips(
    law: Law,
    speed: real,
    rings: wp.array(dtype=Ring),
    patches: wp.array(dtype=Patch),
    grips: wp.array(dtype=Grip),
) -> None:
    i = wp.tid()
    pose = surfaces.Pose()
    pose.speed = speed
    grips[i] = contacts.grip_of(law, pose, rings[i], patches[i])


FOOTPRINTS, LOADS, GRIPS = (VARIANT.kernel(function) for function in (footprints, loads, grips))


def law_of(*, a0: float = STRENGTH, a1: float = 0.0, a2: float = 0.0, **others: float) -> Any:
    law = Law()
    law.a0, law.a1, law.a2 = a0, a1, a2
    for name, value in ({"onset": 1e-3, "friction": 0.0, "decay_rate": 0.0} | others).items():
        setattr(law, name, value)
    return law


@dataclass
class Loaded:
    """Loads of poses, along the body axes; force and moment [poses, 3] in the plate frame; the exposure
    [poses, cells_y, cells_z] that they leave behind."""

    load: Any
    force: Array
    moment: Array
    exposure: Array


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
    """Loads of poses in windows of some cells, with as many spare slots before and behind, never opened."""
    count = len(position)
    plate = plate_of(Plate, tile, np.array(tile.shape) * CELL, CELL, device, thickness=thickness, length=length)
    fields = poisoned_fields(Fields, count + 2 * spare, *cells, device)
    touches = poisoned_touches(Touches, count + 2 * spare, surface, device)
    omega = np.zeros((count, 3)) if omega is None else omega
    arrays = {"position": position, "attitude": attitude, "velocity": velocity, "omega": omega}
    given = [wp.array(a, dtype=quat if n == "attitude" else vec3, device=device) for n, a in arrays.items()]
    inputs = [surface, plate, law, fields, touches, spare, *given, dt]
    loads = poisoned(count, Load, device)
    wp.launch(LOADS, count, inputs=inputs, outputs=[loads], device=device)
    load, turned = loads.numpy(), Rotation.from_quat(attitude)
    return Loaded(
        load,
        turned.apply(load["force"]),
        turned.apply(load["moment"]),
        fields.exposure.numpy().reshape(-1, *cells)[spare : spare + count],
    )


def astride(count: int) -> dict[str, Array]:
    """Random poses and motions of a core near the slab."""
    rng = np.random.default_rng(count)
    return {
        "position": rng.uniform(-8e-3, 8e-3, (count, 3)),
        "attitude": attitudes(rng, count),
        "velocity": 500.0 * rng.standard_normal((count, 3)),
        "omega": 2e4 * rng.standard_normal((count, 3)),
    }


def footprints_of(
    poses: dict[str, Array], cells: tuple[int, int], device: str, *, velocity: Any, omega: Any = (0.0, 0.0, 0.0)
) -> tuple[Any, ...]:
    """Footprints of a cone in windows of cells_y × cells_z; per ring and patch what the kernel says of them."""
    surface = surface_of(Surface, CONE, 12, 24, device)
    plate = plate_of(Plate, SOLID, (CELL, CELL), CELL, device)
    count, per_patch = len(poses["position"]), (surface.rings, surface.around)
    outputs = [
        poisoned(count, Footprint, device),
        poisoned((count, surface.rings), wp.int32, device),
        *(poisoned((count, *per_patch), wp.int32, device) for _ in range(2)),
    ]
    inputs = [
        surface,
        plate,
        poisoned_fields(Fields, count, *cells, device),
        wp.array(poses["position"], dtype=vec3, device=device),
        wp.array(poses["attitude"], dtype=quat, device=device),
        vec3(*velocity),
        vec3(*omega),
        1e-6,
    ]
    wp.launch(FOOTPRINTS, count, inputs=inputs, outputs=outputs, device=device)
    return tuple(array.numpy() for array in outputs)


def test_footprint_holds_every_cell_and_ring_that_a_step_touches(device: str) -> None:
    count, cells = 200, 240
    motion = {"velocity": (600.0, 300.0, -90.0), "omega": (2e4, 5e4, -3e4)}
    found, immersed, rows, columns = footprints_of(astride(count), (cells, cells), device, **motion)
    ring = np.arange(immersed.shape[1])
    within = (ring >= found["first_ring"][:, None]) & (ring <= found["last_ring"][:, None])
    touched = immersed == 1
    some = touched.any(axis=1)
    assert some.sum() > count / 2
    assert not (touched & ~within).any()
    assert found["inside"].all()
    for cell, low, high in ((rows, "y_low", "y_high"), (columns, "z_low", "z_high")):
        lowest = np.where(touched, cell.min(axis=2), cells).min(axis=1)
        highest = np.where(touched, cell.max(axis=2) + 1, -1).max(axis=1)
        assert (found["box"][low] <= lowest)[some].all()
        assert (found["box"][high] >= highest)[some].all()
        # Nor far too large: every step works through the whole box.
        tight = some & (touched.sum(axis=1) == within.sum(axis=1))
        assert tight.sum() > count / 10
        assert (found["box"][low] >= lowest - 4)[tight].all()
        assert (found["box"][high] <= highest + 4)[tight].all()


@pytest.mark.parametrize("axis", ["y", "z"])
def test_footprint_tells_when_the_window_is_too_small(axis: str, device: str) -> None:
    # The rim of the core, 3 mm off its axis, lies 12 or 13 cells from the hit's; the slack of the box and the reach of
    # the filter, 1 at ℓ = 2 cells, come on top. The filter's second pass looks at rows twice its reach away.
    pose = {"position": np.array([[2e-3, 0.0, 0.0]]), "attitude": ALIGNED}
    inside, margin = [], 2 if axis == "y" else 1
    for cells in (34, 32, 30, 28):
        window = (cells, 64) if axis == "y" else (64, cells)
        footprint = footprints_of(pose, window, device, velocity=(800.0, 0.0, 0.0))[0][0]
        low, high = footprint["box"][f"{axis}_low"], footprint["box"][f"{axis}_high"]
        assert footprint["inside"] == (low - margin >= 0 and high + margin < cells)
        inside.append(bool(footprint["inside"]))
    assert inside == [True, axis == "z", False, False]


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
    found = loaded(surface, law_of(friction=friction), device, **pose, thickness=1.0)
    length = core.cone_length if core is CONE else core.nose_length
    nose = core.radius(length * (np.arange(4000) + 0.5) / 4000).mean() * length
    expected = STRENGTH * (np.pi * core.max_radius**2 + 2 * np.pi * friction * nose)
    force, moment = found.force[0], found.moment[0]
    assert force[0] == pytest.approx(-expected, rel=tolerance)
    np.testing.assert_allclose(force[1:], 0.0, atol=1e-9 * expected)
    np.testing.assert_allclose(moment, 0.0, atol=1e-9 * expected * core.length)
    # The exposure gained, ∫ T dy dz, is the projected area in contact for one step.
    gained = found.exposure.sum() * CELL**2
    assert gained == pytest.approx(1e-6 * np.pi * core.max_radius**2, rel=min(tolerance, 1e-5))
    if friction == 0:
        assert gained == pytest.approx(-1e-6 * force[0] / STRENGTH, rel=1e-12)


def test_load_takes_power_from_the_core(device: str) -> None:
    poses = astride(200)
    law = law_of(a1=1e6, a2=7850.0, onset=5.0, friction=0.2, decay_rate=np.log(0.8) / 1e-6)
    tile = (np.random.default_rng(5).random((9, 13)) < 0.5).astype(float)
    found = loaded(surface_of(Surface, OGIVE, 12, 16, device), law, device, **poses, tile=tile)
    power = (found.force * poses["velocity"]).sum(axis=1) + (found.moment * poses["omega"]).sum(axis=1)
    assert (power <= 0).all()
    # What closes in no faster than the contact's threshold touches without a load.
    assert not (power < 0)[~found.load["touching"]].any()
    assert found.load["touching"].sum() > 100


def test_hole_carries_and_remembers_nothing(device: str) -> None:
    found = loaded(surface_of(Surface, OGIVE, 12, 16, device), law_of(), device, **astride(50), tile=HOLE)
    assert not found.load["touching"].any()
    assert not found.load["force"].any()
    assert not found.exposure.any()


def test_load_sees_half_of_the_step_s_own_exposure(device: str) -> None:
    # Under a disc much wider than ℓ, T grows by dt: the mid-step force has lost β^(½ dt/Δt_β).
    disc = ProfileCore(s=(0.0, 5e-3), r=(12e-3, 12e-3), mass=1e-3)
    surface = surface_of(Surface, disc, 24, 384, device)
    pose = {"position": np.array([[0.5e-3, 0.0, 0.0]]), "attitude": ALIGNED, "velocity": np.array([[800.0, 0, 0]])}
    fresh, weak = (
        loaded(surface, law_of(decay_rate=rate), device, **pose).force[0, 0] for rate in (0.0, np.log(0.8) / 1e-6)
    )
    assert fresh == pytest.approx(-STRENGTH * np.pi * disc.max_radius**2, rel=1e-12)
    assert weak / fresh == pytest.approx(np.sqrt(0.8), rel=4e-3)


@pytest.mark.parametrize(
    "law", [{"onset": 1e5}, {"onset": 1e-7, "a1": 4e6, "a2": 7850.0}], ids=["ramp of the contact", "rate"]
)
def test_damping_tends_to_half_the_derivative_of_the_load(law: dict[str, float], device: str) -> None:
    # The trapezoid rule: (M + ½ dt J) Δu = dt F, J = −∂F/∂u. The damping takes the normals of the rings, the load those
    # of the parts of curved patches that touch: they differ by the angle of a patch.
    poses, step, count = astride(30), 1e-4, 30
    poses["omega"] = poses["omega"] / 10
    speeds = np.concatenate([poses["velocity"], poses["omega"]], axis=1)
    scale = np.array([1.0] * 3 + [1e2] * 3)  # lever arms are some 10 mm
    turn = np.zeros((count, 6, 6))
    turn[:, :3, :3] = turn[:, 3:, 3:] = Rotation.from_quat(poses["attitude"]).as_matrix()
    errors = []
    for around in (96, 768):
        surface = surface_of(Surface, CONE, 8, around, device)

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
    # First order in the patches around, and the angle of a patch, 2π/768 = 8e-3, at most.
    assert errors[1] < errors[0] / 4
    assert errors[1] < 2 * np.pi / 768


# --- Curved patches ---


def gripped(device: str, *, speed: float, onset: float = 1e-9, **columns: Any) -> Any:
    """Grips of patches, from members of rings and patches of shape [n]; the onset far below their speeds."""
    members = {struct: struct.numpy_dtype()["names"] for struct in (Ring, Patch)}
    rings, patches = (
        records(struct, device, **{name: value for name, value in columns.items() if name in names})
        for struct, names in members.items()
    )
    found = poisoned(len(rings), Grip, device)
    inputs = [law_of(onset=onset), speed, rings, patches]
    wp.launch(GRIPS, len(rings), inputs=inputs, outputs=[found], device=device)
    return found.numpy()


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
    """Share of the bent patches that closes in, its mean normal [n, 3] and mean closing speed, of so many elements."""
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
        found = gripped(device, speed=1e-3, **bent(slant, bend, sector, velocity))
        share, normal, closing = closing_part(slant, bend, sector, velocity, cells)
        some = (share > 0.01) & (found["share"] > 0.01)
        assert (some & (share < 0.99)).sum() > 100
        means = np.stack([found["axial"], found["outward"], found["around"]], axis=1)
        tolerance = 0.4 * (angle**2 if way == "meridian" else angle)
        np.testing.assert_allclose(found["share"], share, rtol=0, atol=tolerance)
        np.testing.assert_allclose(means[some], normal[some], rtol=0, atol=angle**2 / 2)
        np.testing.assert_allclose(found["closing"][some], closing[some], rtol=0, atol=SLIDING * angle**2 / 8)


def test_part_of_a_doubly_curved_patch_that_touches_is_that_of_a_strip(device: str) -> None:
    # Closing speeds of a square patch on the diagonal have a triangular distribution over ±√2 V, the strip's an even
    # one over ±V, of the same variance: shares differ by (√2 − 1)²/4 at most, and their power by (3 − 2√2)/12 V.
    angle = 0.05
    slant, velocity = grazing(300, angle, angle)
    found = gripped(device, speed=1e-3, **bent(slant, angle, angle, velocity))
    share, _, closing = closing_part(slant, angle, angle, velocity, (400, 400))
    assert np.abs(found["share"] - share).max() < 0.25 * (np.sqrt(2) - 1) ** 2 + angle**2 + 2 / 400
    power = np.where(share > 0, share * np.nan_to_num(closing), 0.0)
    off = np.abs(found["share"] * found["closing"] - power)
    assert off.max() < (3 - 2 * np.sqrt(2)) / 12 * angle * SLIDING + angle**2 * SLIDING / 20


def test_patch_that_closes_in_or_moves_away_as_a_whole_is_flat(device: str) -> None:
    # Straight flight: all of a nose's patches close in, and carry the ring's own exact normal.
    slant, velocity = grazing(500, 0.1, 0.1)
    members = bent(slant, 0.1, 0.1, velocity)
    meridian = members["turn_axial"] * velocity[:, 0] + members["turn_radial"] * velocity[:, 1]
    variation = np.hypot(meridian, 0.1 * np.cos(slant) * velocity[:, 2])
    for sign, share in ((1.0, 1.0), (-1.0, 0.0)):
        members["closing"] = sign * variation * np.random.default_rng(12).uniform(1.01, 9.0, 500)
        found = gripped(device, speed=1e-3, **members)
        np.testing.assert_array_equal(found["share"], share)
        if share:
            np.testing.assert_array_equal(found["axial"], members["normal_axial"])
            np.testing.assert_array_equal(found["outward"], members["normal_radial"])
            np.testing.assert_array_equal(found["around"], 0.0)
            np.testing.assert_array_equal(found["closing"], members["closing"])


@pytest.mark.parametrize("onset", [1e-9, 5.0, 1e3])
def test_curved_patch_takes_power_from_the_core(onset: float, device: str) -> None:
    # With the velocity of the patch's centre, the normal's power is the closing speed's: never negative in contact.
    slant, velocity = grazing(2000, 0.4, 0.4)
    found = gripped(device, speed=100.0, onset=onset, **bent(slant, 0.4, 0.4, velocity))
    normal = np.stack([found["axial"], found["outward"], found["around"]], axis=1)
    power = (normal * velocity).sum(axis=1)
    np.testing.assert_allclose(power, found["closing"], rtol=1e-9, atol=1e-9)
    assert (found["closing"][found["share"] > 0] > 0).all()
    assert ((found["share"] > 0) & (found["share"] < 1)).sum() > 500
    # Friction is against what is left of the velocity: v·(v − c n) ≥ 0 as long as no patch spans a quarter turn.
    sliding = velocity - found["closing"][:, None] * normal
    assert ((sliding * velocity).sum(axis=1)[found["share"] > 0] > 0).all()


# --- Windows ---


@pytest.mark.parametrize("length", [0.3e-3, 0.5e-3, 1.6e-3])
def test_window_that_just_holds_a_step_gives_what_a_wide_one_gives(length: float, device: str) -> None:
    # Neighbouring slots are poisoned: a look across the edge shows.
    surface = surface_of(Surface, OGIVE, 12, 16, device)
    pose = {"position": np.array([[-3e-3, 0.0, 0.0]]), "attitude": ALIGNED, "velocity": np.array([[800.0, 0, 0]])}
    plate = plate_of(Plate, SOLID, (CELL, CELL), CELL, device, length=length)
    law, wide = law_of(decay_rate=np.log(0.8) / 1e-6), 96
    expected = loaded(surface, law, device, **pose, cells=(wide, wide), length=length)
    assert expected.load["touching"].all()
    for axis in ("y", "z"):
        cells = wide
        while True:
            window = (cells - 2, wide) if axis == "y" else (wide, cells - 2)
            inputs = [surface, plate, poisoned_fields(Fields, 1, *window, device)]
            inputs += [wp.array(pose[n], dtype=t, device=device) for n, t in (("position", vec3), ("attitude", quat))]
            inputs += [vec3(800.0, 0.0, 0.0), vec3(), 1e-6]
            patches = (1, surface.rings, surface.around)
            outputs = [poisoned(1, Footprint, device), poisoned(patches[:2], wp.int32, device)]
            outputs += [poisoned(patches, wp.int32, device) for _ in range(2)]
            wp.launch(FOOTPRINTS, 1, inputs=inputs, outputs=outputs, device=device)
            if not outputs[0].numpy()["inside"][0]:
                break
            cells -= 2
        assert cells < wide
        window = (cells, wide) if axis == "y" else (wide, cells)
        found = loaded(surface, law, device, **pose, cells=window, length=length, spare=1)
        np.testing.assert_array_equal(found.force, expected.force)
        cut = tuple(slice(wide // 2 - n // 2, wide // 2 + n // 2) for n in window)
        np.testing.assert_array_equal(found.exposure[0], expected.exposure[0][cut])
