"""Rings and patches in a pose: areas, velocities, and how much of a patch is in the slab (docs/model.md §4)."""

from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from warpimpact.kernels import core_surface, structs
from warpimpact.kernels.variant import Variant

from .probes import CONE, PAPER, poisoned, surface_of

Array = NDArray[np.float64]

VARIANT = Variant(double=True)
real, vec3, quat = VARIANT.real, VARIANT.vec3, VARIANT.quat
use, struct = VARIANT.use(core_surface), structs.build(VARIANT)
Surface = struct.Surface

THICKNESS = 4.0e-3
EVERYWHERE = 1.0e3  # [m], a slab that holds the whole core


def share(
    depth: wp.array(dtype=real),
    extent: wp.array(dtype=real),
    motion: wp.array(dtype=real),
    shares: wp.array(dtype=real),
) -> None:
    """Share beyond the front face of patches that stand across it and move by ±motion in a step of 2 s."""
    i = wp.tid()
    pose = struct.Pose()
    pose.axis = vec3(real(1.0), real(0.0), real(0.0))
    ring, patch = struct.Ring(), struct.Patch()
    ring.area = real(1.0)
    ring.half_axial = extent[i]
    patch.x = depth[i]
    patch.velocity_axial = motion[i]
    shares[i] = use.core_surface.immersed_area(pose, ring, patch, real(EVERYWHERE), real(2.0))


def patches(
    surface: Surface,
    position: wp.array(dtype=vec3),
    attitude: wp.array(dtype=quat),
    velocity: vec3,
    omega: vec3,
    thickness: real,
    dt: real,
    normal_x: wp.array3d(dtype=real),
    immersed: wp.array3d(dtype=real),
    areas: wp.array2d(dtype=real),
    low: wp.array2d(dtype=real),
    high: wp.array2d(dtype=real),
) -> None:
    """Every patch of every pose: its normal along x, and its area in the slab; area of a patch, and bounds along x, of
    every ring."""
    i = wp.tid()
    pose = use.core_surface.pose_of(surface, position[i], attitude[i], velocity, omega)
    advance, turning = real(0.5) * dt * wp.abs(velocity[0]), real(0.5) * dt * wp.length(omega)
    for k in range(surface.rings):
        ring = use.core_surface.ring_at(surface, pose, k)
        reach = use.core_surface.reach_along_x(ring, pose, use.core_surface.broadside(pose), advance, turning)
        areas[i, k] = ring.area
        low[i, k] = ring.centre[0] - reach
        high[i, k] = ring.centre[0] + reach
        for j in range(surface.around):
            patch = use.core_surface.patch_at(
                pose, ring, surface.cosine[k * surface.around + j], surface.sine[k * surface.around + j]
            )
            normal_x[i, k, j] = ring.normal_axial * pose.axis[0] + ring.normal_radial * patch.outward_x
            immersed[i, k, j] = use.core_surface.immersed_area(pose, ring, patch, thickness, dt)


SHARE, PATCHES = VARIANT.kernel(share), VARIANT.kernel(patches)


def share_behind(depth: Array, extent: Array, motion: Array, device: str) -> Array:
    inputs = [wp.array(a, dtype=real, device=device) for a in np.broadcast_arrays(depth, extent, motion)]
    shares = poisoned(len(inputs[0]), real, device)
    wp.launch(SHARE, len(shares), inputs=inputs, outputs=[shares], device=device)
    return shares.numpy()


def posed(
    surface: Any,
    device: str,
    *,
    position: Array,
    attitude: Array,
    velocity: Any = (800.0, 0.0, 0.0),
    omega: Any = (0.0, 0.0, 0.0),
    thickness: float = THICKNESS,
    dt: float = 1e-6,
) -> dict[str, Array]:
    """The kernel's results for poses; arrays of shape [poses, rings, (patches around,) ...]."""
    shape = len(position), surface.rings, surface.around
    outputs = {name: poisoned(shape, real, device) for name in ("normal_x", "immersed")}
    outputs |= {name: poisoned(shape[:2], real, device) for name in ("area", "low", "high")}
    inputs = [
        surface,
        wp.array(position, dtype=vec3, device=device),
        wp.array(attitude, dtype=quat, device=device),
        vec3(*velocity),
        vec3(*omega),
        thickness,
        dt,
    ]
    wp.launch(PATCHES, len(position), inputs=inputs, outputs=list(outputs.values()), device=device)
    return {name: array.numpy() for name, array in outputs.items()}


# --- Share of a patch behind a face ---


@pytest.mark.parametrize("ratio", [0.02, 0.5, 1.0, 50.0])
def test_share_is_that_of_two_boxes_convolved(ratio: float, device: str) -> None:
    # Mean over the motion, at 20 000 midpoints, of the sharp share of a box of ±extent.
    extent, motion = 2e-4, 2e-4 * ratio
    depth = np.linspace(-1.1, 1.1, 301) * (extent + motion)
    steps = motion * ((np.arange(20_000) + 0.5) / 10_000 - 1)
    expected = [np.clip(0.5 + (d + steps) / (2 * extent), 0, 1).mean() for d in depth]
    np.testing.assert_allclose(share_behind(depth, extent, motion, device), expected, atol=1e-7)


@pytest.mark.parametrize(("extent", "motion"), [(1e-4, 0.0), (0.0, 1e-4), (1e-4, 1e-7)])
def test_share_of_a_box_alone_has_its_corners_rounded_only(extent: float, motion: float, device: str) -> None:
    wide = max(extent, motion)
    depth = np.linspace(-1.5, 1.5, 301) * wide
    sharp = np.clip(0.5 + depth / (2 * wide), 0, 1)
    shares = share_behind(depth, extent, motion, device)
    np.testing.assert_allclose(shares, sharp, atol=0.0026)  # narrow/(8 wide) at the corners
    away = np.abs(np.abs(depth) - wide) > 0.021 * wide
    np.testing.assert_allclose(shares[away], sharp[away], atol=1e-12)


# --- Patches in a pose ---


def test_passage_immerses_every_patch_for_the_thickness(device: str) -> None:
    # Straight flight of a tilted core: Σ over steps of immersed area × way = area × h, patch by patch.
    surface = surface_of(Surface, PAPER, 12, 16, device)
    attitude = Rotation.from_euler("zy", [20.0, -10.0], degrees=True).as_quat()
    speed, dt = 800.0, 1.3e-6
    x = np.arange(-0.03, 0.04, speed * dt)
    position = np.stack([x, 0 * x, 0 * x], axis=1)
    attitude = np.broadcast_to(attitude, (len(x), 4))
    actual = posed(surface, device, position=position, attitude=attitude, velocity=(speed, 0, 0), dt=dt)
    swept = speed * dt * actual["immersed"].sum(axis=0)
    expected = np.broadcast_to(actual["area"][0][:, None] * THICKNESS, swept.shape)
    np.testing.assert_allclose(swept, expected, rtol=1e-11)


@pytest.mark.parametrize("ring", ["even", "odd"])
def test_patch_along_the_face_is_in_or_out_at_once(ring: str, device: str) -> None:
    # A cone that lies with one line of its mantle in the face: patches there, of every other ring, have no extent
    # across it.
    around = 16
    half_angle = np.arctan2(CONE.max_radius, CONE.cone_length)
    azimuth = np.pi / around if ring == "even" else 0.0
    axis = np.array([np.sin(half_angle), 0.0, np.cos(half_angle)])
    outward = np.array([np.cos(half_angle), 0.0, -np.sin(half_angle)])
    sideways = np.cross(axis, outward)
    right = np.cos(azimuth) * outward - np.sin(azimuth) * sideways
    up = np.sin(azimuth) * outward + np.cos(azimuth) * sideways
    attitude = Rotation.from_matrix(np.stack([axis, right, up], axis=1)).as_quat()
    tip = CONE.mass_properties.centre_of_mass * axis[0]  # all of the line is as deep
    gaps = np.array([-5e-6, 5e-6])
    position = np.stack([gaps - tip, 0 * gaps, 0 * gaps], axis=1)
    surface = surface_of(Surface, CONE, 20, around, device)
    actual = posed(surface, device, position=position, attitude=np.stack([attitude] * 2), dt=0.0)
    mantle = actual["normal_x"][0, :, 0] > 0.999
    assert mantle.sum() == 6
    out, inside = actual["immersed"][:, mantle, 0]
    np.testing.assert_allclose(out, 0.0, atol=1e-15)
    np.testing.assert_allclose(inside, actual["area"][0, mantle], rtol=1e-12)


@pytest.mark.parametrize("slant", [0.1, np.pi])
def test_ring_out_of_reach_of_the_slab_has_nothing_immersed(slant: float, device: str) -> None:
    # Nearly straight cores and cores in any attitude, which turn fast in a long step.
    rng = np.random.default_rng(6)
    turned = Rotation.from_rotvec(rng.uniform(-slant, slant, (400, 3)))
    poses = {"position": rng.uniform(-0.015, 0.015, (400, 3)), "attitude": turned.as_quat()}
    surface = surface_of(Surface, CONE, 16, 16, device)
    actual = posed(surface, device, **poses, velocity=(100.0, 50.0, 0.0), omega=(3e4, -5e4, 4e4), dt=1e-5)
    out_of_reach = (actual["high"] <= 0) | (actual["low"] >= THICKNESS)
    touching = (actual["immersed"] > 0).any(axis=2)
    assert touching.sum() > 1000
    assert not (out_of_reach & touching).any()
    assert (~out_of_reach & ~touching).sum() < touching.sum() / 2  # and the reach is not far too large
