"""Grip of a curved patch: the part that closes in, its normal and its closing speed (docs/model.md §4)."""

import math
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray

from warpimpact.kernels import core_surface, interaction, structs
from warpimpact.kernels.variant import Variant

from .probes import poisoned, records

Array = NDArray[np.float64]

VARIANT = Variant(double=True, rate_dependent=True)
real = VARIANT.real
use, struct = VARIANT.use(core_surface, interaction), structs.build(VARIANT)
Ring, Patch, Law, Grip, Face = (
    struct.Ring,
    struct.Patch,
    struct.Law,
    struct.Contact,
    struct.Face,
)

SLIDING = 100.0  # [m/s]


def grips(
    law: Law,
    speed: real,
    rings: wp.array(dtype=Ring),
    patches: wp.array(dtype=Patch),
    grips: wp.array(dtype=Grip),
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
    """Grips of patches and the parts that touch, from members of rings and patches of shape [n]; the onset far below
    their speeds."""
    members = {struct: struct.numpy_dtype()["names"] for struct in (Ring, Patch)}
    rings, patches = (
        records(struct, device, **{name: value for name, value in columns.items() if name in names})
        for struct, names in members.items()
    )
    law, results = Law(), [poisoned(len(rings), struct, device) for struct in (Grip, Face)]
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
