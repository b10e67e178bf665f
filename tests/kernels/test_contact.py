"""One step's load: the cells it may touch, its force and damping, and what it does to the plate (MODEL.md §4)."""

from dataclasses import dataclass
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray

from warpimpact.kernels import contact, core_surface, interaction, plate_grid, rigid_body
from warpimpact.kernels.variant import Variant
from warpimpact.scene import ConeCore, OgiveCore, ProfileCore

from .probes import attitudes, plate_of, poisoned, poisoned_fields, surface_of

Array = NDArray[np.float64]

VARIANT = Variant(double=True, rate_dependent=True)
real, vec3, quat = VARIANT.real, VARIANT.vec3, VARIANT.quat
surfaces, grid, laws, motion, contacts = (
    part.build(VARIANT) for part in (core_surface, plate_grid, interaction, rigid_body, contact)
)
Surface, Plate, Fields, Law, Load = surfaces.Surface, grid.Plate, grid.Fields, laws.Law, motion.Load
Footprint = contacts.Footprint

CELL = 0.25e-3
OGIVE = OgiveCore(diameter=6.17e-3, crh=3.0, length=27.0e-3, mass=5.25e-3)
CONE = ConeCore(diameter=6.0e-3, length=20.0e-3, cone_length=12.0e-3, mass=3.0e-3)
STRENGTH = 2.6e9
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
    window = grid.open_window(plate, fields, i, wp.float64(0.0), wp.float64(0.0))
    pose = surfaces.pose_of(surface, position[i], attitude[i], velocity, omega)
    found[i] = contacts.footprint_of(surface, plate, fields, window, pose, dt)
    for k in range(surface.rings):
        ring = surfaces.ring_at(surface, pose, k, dt)
        immersed[i, k] = 0
        for j in range(surface.around):
            patch = surfaces.patch_at(surface, pose, ring, j)
            if surfaces.immersed_area(pose, ring, patch, plate.thickness, dt) > real(0.0):
                immersed[i, k] = 1
            cell = grid.cell_at(fields, window, pose.position[1] + patch.arm[1], pose.position[2] + patch.arm[2])
            rows[i, k, j] = (cell.index - window.first) // fields.cells_z
            columns[i, k, j] = cell.index % fields.cells_z


def loads(
    surface: Surface,
    plate: Plate,
    law: Law,
    fields: Fields,
    position: wp.array(dtype=vec3),
    attitude: wp.array(dtype=quat),
    velocity: wp.array(dtype=vec3),
    omega: wp.array(dtype=vec3),
    dt: real,
    loads: wp.array(dtype=Load),
) -> None:
    """The load of one step of every pose, each on a plate of its own."""
    i = wp.tid()
    window = grid.open_window(plate, fields, i, wp.float64(0.0), wp.float64(0.0))
    pose = surfaces.pose_of(surface, position[i], attitude[i], velocity[i], omega[i])
    found = contacts.footprint_of(surface, plate, fields, window, pose, dt)
    loads[i] = contacts.load_on(surface, plate, law, fields, window, found, pose, dt)


FOOTPRINTS, LOADS = VARIANT.kernel(footprints), VARIANT.kernel(loads)


def law_of(*, a0: float = STRENGTH, a1: float = 0.0, a2: float = 0.0, **others: float) -> Any:
    law = Law()
    law.a0, law.a1, law.a2 = a0, a1, a2
    for name, value in ({"onset": 1e-3, "friction": 0.0, "decay_rate": 0.0} | others).items():
        setattr(law, name, value)
    return law


@dataclass
class Loaded:
    """Loads of poses, and the exposure [poses, cells_y, cells_z] that they leave behind."""

    load: Any
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
    cells: int = 200,
) -> Loaded:
    count = len(position)
    plate = plate_of(Plate, tile, CELL, CELL, device, thickness=thickness)
    fields = poisoned_fields(Fields, count, cells, cells, device)
    omega = np.zeros((count, 3)) if omega is None else omega
    arrays = {"position": position, "attitude": attitude, "velocity": velocity, "omega": omega}
    given = [wp.array(a, dtype=quat if n == "attitude" else vec3, device=device) for n, a in arrays.items()]
    load = poisoned(count, Load, device)
    wp.launch(LOADS, count, inputs=[surface, plate, law, fields, *given, dt], outputs=[load], device=device)
    return Loaded(load.numpy(), fields.exposure.numpy().reshape(count, cells, cells))


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
    plate = plate_of(Plate, SOLID, CELL, CELL, device)
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
    # The rim of the core, 3 mm off its axis, lies 12 or 13 cells from the hit's; 2 more are the slack of the
    # box and the reach of the filter at ℓ = 2 cells.
    pose = {"position": np.array([[2e-3, 0.0, 0.0]]), "attitude": ALIGNED}
    inside, reach = [], 1
    for cells in (32, 30, 28, 26):
        window = (cells, 64) if axis == "y" else (64, cells)
        footprint = footprints_of(pose, window, device, velocity=(800.0, 0.0, 0.0))[0][0]
        low, high = footprint["box"][f"{axis}_low"], footprint["box"][f"{axis}_high"]
        assert footprint["inside"] == (low - reach >= 0 and high + reach < cells)
        inside.append(bool(footprint["inside"]))
    assert inside == [True, True, False, False]


@pytest.mark.parametrize("friction", [0.0, 0.1])
def test_straight_flight_deep_in_a_plate_meets_the_work_per_way(friction: float, device: str) -> None:
    # §6.1, 6.2: F = −a0 [πR² + 2πη ∫ r ds over the nose]; the ogive's shank slides along itself.
    surface = surface_of(Surface, OGIVE, 128, 32, device)
    pose = {"position": np.array([[0.5, 0.0, 0.0]]), "attitude": ALIGNED, "velocity": np.array([[800.0, 0, 0]])}
    found = loaded(surface, law_of(friction=friction), device, **pose, thickness=1.0)
    s = OGIVE.nose_length * (np.arange(4000) + 0.5) / 4000
    nose = OGIVE.radius(s).mean() * OGIVE.nose_length
    expected = STRENGTH * (np.pi * OGIVE.max_radius**2 + 2 * np.pi * friction * nose)
    force, moment = found.load["force"][0], found.load["moment"][0]
    assert force[0] == pytest.approx(-expected, rel=1e-12 if friction == 0 else 2e-3)
    np.testing.assert_allclose(force[1:], 0.0, atol=1e-9 * expected)
    np.testing.assert_allclose(moment, 0.0, atol=1e-9 * expected * OGIVE.length)
    # The exposure gained, ∫ T dy dz, is the projected area in contact for one step.
    gained = found.exposure.sum() * CELL**2
    assert gained == pytest.approx(1e-6 * np.pi * OGIVE.max_radius**2, rel=1e-12)


def test_load_takes_power_from_the_core(device: str) -> None:
    poses = astride(200)
    law = law_of(a1=1e6, a2=7850.0, onset=5.0, friction=0.2, decay_rate=np.log(0.8) / 1e-6)
    tile = (np.random.default_rng(5).random((9, 13)) < 0.5).astype(float)
    found = loaded(surface_of(Surface, OGIVE, 12, 16, device), law, device, **poses, tile=tile).load
    power = (found["force"] * poses["velocity"]).sum(axis=1) + (found["moment"] * poses["omega"]).sum(axis=1)
    assert (power <= 0).all()
    np.testing.assert_array_equal(power < 0, found["touching"])
    assert found["touching"].sum() > 100


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
        loaded(surface, law_of(decay_rate=rate), device, **pose).load["force"][0, 0]
        for rate in (0.0, np.log(0.8) / 1e-6)
    )
    assert fresh == pytest.approx(-STRENGTH * np.pi * disc.max_radius**2, rel=1e-12)
    assert weak / fresh == pytest.approx(np.sqrt(0.8), rel=4e-3)


@pytest.mark.parametrize(
    "law", [{"onset": 1e5}, {"onset": 1e-7, "a1": 4e6, "a2": 7850.0}], ids=["ramp of the contact", "rate"]
)
def test_damping_is_half_the_derivative_of_the_load(law: dict[str, float], device: str) -> None:
    # The trapezoid rule: (M + ½ dt J) Δu = dt F, J = −∂F/∂u.
    poses, step, count = astride(30), 1e-4, 30
    poses["omega"] = poses["omega"] / 10
    surface = surface_of(Surface, CONE, 8, 12, device)
    speeds = np.concatenate([poses["velocity"], poses["omega"]], axis=1)

    def load_at(speeds: Array) -> Any:
        moved = poses | {"velocity": speeds[:, :3].copy(), "omega": speeds[:, 3:].copy()}
        return loaded(surface, law_of(**law), device, **moved, dt=1e-12).load

    jacobian = np.zeros((count, 6, 6))
    scale = np.array([1.0] * 3 + [1e2] * 3)  # lever arms are some 10 mm
    for k in range(6):
        ends = [load_at(speeds + sign * step * scale[k] * np.eye(6)[k]) for sign in (1, -1)]
        ends = [np.concatenate([end["force"], end["moment"]], axis=1) for end in ends]
        jacobian[:, :, k] = (ends[0] - ends[1]) / (2 * step * scale[k])
    load = load_at(speeds)
    damping = np.zeros((count, 6, 6))
    damping[:, :3, :3], damping[:, 3:, 3:] = load["damping_vv"], load["damping_ww"]
    damping[:, :3, 3:] = load["damping_vw"]
    damping[:, 3:, :3] = load["damping_vw"].transpose(0, 2, 1)
    jacobian, damping = (m * scale[:, None] * scale for m in (jacobian, damping))
    # Contact's threshold, 1e-5 of the core's speed, depends on the speeds too.
    np.testing.assert_allclose(damping, -jacobian / 2, rtol=0, atol=2e-4 * np.abs(jacobian).max())
    assert np.abs(jacobian).max(axis=(1, 2)).astype(bool).sum() > count / 3
    np.testing.assert_array_equal(load["damped"], damping.any(axis=(1, 2)))
