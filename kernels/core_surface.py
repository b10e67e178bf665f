"""The core's surface: rings of equal patches, where they are, how they move, how much is in the slab."""

import math
from functools import cache
from types import SimpleNamespace

import warp as wp

from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the surface for one variant."""
    real, vec3, quat = variant.real, variant.vec3, variant.quat
    zero, half, one = real(0.0), real(0.5), real(1.0)
    two, eight, half_turn = real(2.0), real(8.0), real(math.pi)
    widest_ratio, flattest = real(0.02), real(1.0e-3)  # floors that keep the convolution's quotient finite

    @wp.struct
    class Surface:
        """Rings from nose to base, the discs that close them included.

        Per ring: station ahead of the centre of mass and radius [m], area of one patch [m²], its normal along
        the axis and outwards, half of the ring's extent along the meridian, axially and radially [m].
        Per patch of a ring: cosine and sine of its azimuth.
        """

        station: wp.array(dtype=real)
        radius: wp.array(dtype=real)
        area: wp.array(dtype=real)
        normal_axial: wp.array(dtype=real)
        normal_radial: wp.array(dtype=real)
        half_axial: wp.array(dtype=real)
        half_radial: wp.array(dtype=real)
        cosine: wp.array(dtype=real)
        sine: wp.array(dtype=real)
        rings: wp.int32
        around: wp.int32
        bounding_radius: real

    @wp.struct
    class Pose:
        """Where the core is and how it moves: body axes in the plate frame, centre of mass, velocities.

        No point of the core is faster than `speed`.
        """

        position: vec3
        axis: vec3
        right: vec3
        up: vec3
        velocity: vec3
        omega: vec3
        speed: real

    @wp.struct
    class Ring:
        """One ring in a pose. `motion` is the half-way along x that it makes within the step [m]."""

        centre: vec3
        station: real
        radius: real
        area: real
        normal_axial: real
        normal_radial: real
        half_axial: real
        half_radial: real
        half_around: real
        motion: real

    @wp.struct
    class Patch:
        """One patch: arm about the centre of mass [m], outward unit normal, velocity and its part along the
        normal [m/s], and the radial direction it lies in."""

        arm: vec3
        normal: vec3
        velocity: vec3
        closing: real
        outward: vec3

    @wp.func
    def pose_of(surface: Surface, position: vec3, attitude: quat, velocity: vec3, omega: vec3):
        pose = Pose()
        pose.position = position
        pose.axis = wp.quat_rotate(attitude, vec3(one, zero, zero))
        pose.right = wp.quat_rotate(attitude, vec3(zero, one, zero))
        pose.up = wp.quat_rotate(attitude, vec3(zero, zero, one))
        pose.velocity = velocity
        pose.omega = omega
        pose.speed = wp.length(velocity) + surface.bounding_radius * wp.length(omega)
        return pose

    @wp.func
    def ring_at(surface: Surface, pose: Pose, index: wp.int32, dt: real):
        ring = Ring()
        ring.station = surface.station[index]
        ring.radius = surface.radius[index]
        ring.area = surface.area[index]
        ring.normal_axial = surface.normal_axial[index]
        ring.normal_radial = surface.normal_radial[index]
        ring.half_axial = surface.half_axial[index]
        ring.half_radial = surface.half_radial[index]
        ring.half_around = ring.radius * half_turn / real(surface.around)
        offset = ring.station * pose.axis
        ring.centre = pose.position + offset
        ring.motion = half * dt * wp.abs(pose.velocity[0] + wp.cross(pose.omega, offset)[0])
        return ring

    @wp.func
    def broadside(pose: Pose):
        """Share of a ring's radius that reaches along x: sin of the angle between core and plate normal."""
        return wp.sqrt(wp.max(zero, one - pose.axis[0] * pose.axis[0]))

    @wp.func
    def reach_along_x(surface: Surface, ring: Ring, pose: Pose, dt: real):
        """How far from its centre along x any part of the ring can get within the step [m]."""
        turning = half * dt * ring.radius * wp.length(pose.omega)
        return (
            (ring.radius + wp.abs(ring.half_radial) + ring.half_around) * broadside(pose)
            + wp.abs(ring.half_axial * pose.axis[0])
            + ring.motion
            + turning
        )

    @wp.func
    def behind_face(depth: real, extent: real, motion: real):
        """Share of a patch beyond a face at x = 0, averaged over the step.

        The patch spreads evenly over ±extent about its mid-step depth and moves evenly by ±motion; their
        convolution keeps the sum over steps of what is immersed exact in straight flight.
        """
        wide = wp.max(extent, motion)
        narrow = wp.max(wp.min(extent, motion), widest_ratio * wide)
        rest = wp.max(zero, wide + narrow - wp.abs(depth))
        edge = half - rest * rest / (eight * wide * narrow)
        share = wp.where(depth < zero, -edge, edge)
        if wp.abs(depth) < wide - narrow:
            share = depth / (two * wide)
        return half + share

    @wp.func
    def patch_at(surface: Surface, pose: Pose, ring: Ring, index: wp.int32):
        patch = Patch()
        patch.outward = surface.cosine[index] * pose.right + surface.sine[index] * pose.up
        patch.arm = ring.station * pose.axis + ring.radius * patch.outward
        patch.normal = ring.normal_axial * pose.axis + ring.normal_radial * patch.outward
        patch.velocity = pose.velocity + wp.cross(pose.omega, patch.arm)
        patch.closing = wp.dot(patch.velocity, patch.normal)
        return patch

    @wp.func
    def immersed_area(pose: Pose, ring: Ring, patch: Patch, thickness: real, dt: real):
        """Area of a patch within the slab, averaged over the step [m²]."""
        depth = pose.position[0] + patch.arm[0]
        meridian = ring.half_axial * pose.axis[0] + ring.half_radial * patch.outward[0]
        around = ring.half_around * wp.cross(pose.axis, patch.outward)[0]
        smallest = flattest * (wp.abs(ring.half_axial) + wp.abs(ring.half_radial))
        extent = wp.max(wp.sqrt(meridian * meridian + around * around), smallest)
        motion = half * dt * wp.abs(patch.velocity[0])
        return ring.area * (behind_face(depth, extent, motion) - behind_face(depth - thickness, extent, motion))

    return SimpleNamespace(
        Surface=Surface,
        Pose=Pose,
        Ring=Ring,
        Patch=Patch,
        pose_of=pose_of,
        ring_at=ring_at,
        broadside=broadside,
        reach_along_x=reach_along_x,
        behind_face=behind_face,
        patch_at=patch_at,
        immersed_area=immersed_area,
    )
