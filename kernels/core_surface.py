"""The core's surface: rings of equal patches, their positions, velocities and areas in the slab."""

import math
from functools import cache
from types import SimpleNamespace

import warp as wp

from . import constants, lanes, structs
from .memory import read
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the surface for one variant."""
    struct = structs.build(variant)
    real, reals, vec3, quat = variant.real, variant.reals, variant.vec3, variant.quat
    zero, half, one = real(0.0), real(0.5), real(1.0)
    use = variant.use(lanes)
    quarter, half_turn = real(0.25), real(math.pi)
    narrowest, flattest = real(constants.LEAST_EXTENT_RATIO.value), real(constants.LEAST_PATCH_EXTENT.value)
    far = constants.FAR_AWAY.value

    @wp.func
    def rings_before(surface: struct.Surface, slot: wp.int32):
        """Number of rings in the slots before this one."""
        return slot * surface.rings

    @wp.func
    def patches_before(surface: struct.Surface, slot: wp.int32):
        """Number of patches in the slots before this one."""
        return slot * (surface.rings * surface.around)

    @wp.func
    def pose_of(surface: struct.Surface, position: vec3, attitude: quat, velocity: vec3, omega: vec3):
        """The pose of a core with a velocity [m/s] and an angular velocity [rad/s] in the plate frame."""
        pose = struct.Pose()
        pose.position = position
        pose.axis = wp.quat_rotate(attitude, vec3(one, zero, zero))
        pose.right = wp.quat_rotate(attitude, vec3(zero, one, zero))
        pose.up = wp.quat_rotate(attitude, vec3(zero, zero, one))
        pose.velocity = wp.quat_rotate_inv(attitude, velocity)
        pose.omega = wp.quat_rotate_inv(attitude, omega)
        pose.speed = wp.length(velocity) + surface.bounding_radius * wp.length(omega)
        return pose

    @wp.func
    def ring_in(table: reals, surface: struct.Surface, pose: struct.Pose, number: wp.int32, stride: wp.int32):
        """The ring of a number in a table of the members of rings, `stride` from each other."""
        ring = struct.Ring()
        ring.station = read(table, number)
        ring.radius = read(table, number + stride)
        ring.area = read(table, number + 2 * stride)
        ring.normal_axial = read(table, number + 3 * stride)
        ring.normal_radial = read(table, number + 4 * stride)
        ring.half_axial = read(table, number + 5 * stride)
        ring.half_radial = read(table, number + 6 * stride)
        ring.turn_axial = read(table, number + 7 * stride)
        ring.turn_radial = read(table, number + 8 * stride)
        ring.centre = pose.position + ring.station * pose.axis
        ring.sector = half_turn / real(surface.around)
        return ring

    @wp.func
    def ring_at(surface: struct.Surface, pose: struct.Pose, index: wp.int32):
        """Ring number `index`, from the nose on."""
        return ring_in(surface.of_rings, surface, pose, index, surface.rings)

    @wp.func
    def ring_of(surface: struct.Surface, pose: struct.Pose, patch: wp.int32):
        """The ring of a patch, from a table in which neighbours in memory belong to neighbouring patches."""
        return ring_in(surface.of_patches, surface, pose, patch, surface.rings * surface.around)

    @wp.func
    def broadside(pose: struct.Pose):
        """Share of a ring's radius that reaches along x: sin of the angle between core and plate normal."""
        return wp.sqrt(wp.max(zero, one - pose.axis[0] * pose.axis[0]))

    @wp.func
    def ends_of(surface: struct.Surface, pose: struct.Pose):
        """The lowest and the highest x of the core [m]."""
        rearmost, foremost = real(far), real(-far)
        wide = broadside(pose)
        index = use.lanes.lane()
        while index < surface.rings:
            ring = ring_at(surface, pose, index)
            aslant, along = ring.half_radial * wide, ring.half_axial * pose.axis[0]
            rearmost = wp.min(rearmost, ring.centre[0] - ring.radius * wide - wp.abs(along - aslant))
            foremost = wp.max(foremost, ring.centre[0] + ring.radius * wide + wp.abs(along + aslant))
            index += use.lanes.count()
        return use.lanes.lowest(rearmost), use.lanes.highest(foremost)

    @wp.func
    def reach_along_x(ring: struct.Ring, pose: struct.Pose, broadside: real, advance: real, turning: real):
        """Largest distance along x between the ring's centre and any part of the ring within the step [m]. `advance` is
        half of the way of the centre of mass along x in the step [m], `turning` half of the step's rotation [rad]."""
        around = (one + ring.sector) * ring.radius
        return (
            (around + wp.abs(ring.half_radial)) * broadside
            + wp.abs(ring.half_axial * pose.axis[0])
            + advance
            + turning * (wp.abs(ring.station) * broadside + ring.radius)
        )

    @wp.func
    def patch_at(pose: struct.Pose, ring: struct.Ring, cosine: real, sine: real):
        """The patch of a ring at an azimuth with this cosine and sine."""
        patch = struct.Patch()
        patch.outward_x = cosine * pose.right[0] + sine * pose.up[0]
        patch.around_x = cosine * pose.up[0] - sine * pose.right[0]
        patch.x = ring.centre[0] + ring.radius * patch.outward_x
        patch.y = ring.centre[1] + ring.radius * (cosine * pose.right[1] + sine * pose.up[1])
        patch.z = ring.centre[2] + ring.radius * (cosine * pose.right[2] + sine * pose.up[2])
        # v + ω × arm, arm = station along the axis + radius outwards.
        patch.swing = cosine * pose.omega[2] - sine * pose.omega[1]
        lift = cosine * pose.omega[1] + sine * pose.omega[2]
        patch.velocity_axial = pose.velocity[0] - ring.radius * patch.swing
        patch.velocity_outward = cosine * pose.velocity[1] + sine * pose.velocity[2] + ring.station * patch.swing
        patch.velocity_around = (
            cosine * pose.velocity[2] - sine * pose.velocity[1] + ring.radius * pose.omega[0] - ring.station * lift
        )
        patch.closing = ring.normal_axial * patch.velocity_axial + ring.normal_radial * patch.velocity_outward
        return patch

    @wp.func
    def half_lever(ring: struct.Ring):
        """Half of the change of the closing speed over a ring, along the meridian, per rate of swing [m]."""
        return ring.normal_radial * ring.half_axial - ring.normal_axial * ring.half_radial

    @wp.func
    def closes(pose: struct.Pose, ring: struct.Ring):
        """Whether any part of a ring may advance along its normal. This is a bound: if it is False, the ring cannot
        touch."""
        along = pose.velocity[0]
        across = wp.sqrt(pose.velocity[1] * pose.velocity[1] + pose.velocity[2] * pose.velocity[2])
        rate = wp.sqrt(pose.omega[1] * pose.omega[1] + pose.omega[2] * pose.omega[2])
        outwards = across + wp.abs(ring.station) * rate
        around = outwards + ring.radius * wp.abs(pose.omega[0])
        swing = ring.radius * rate
        return (
            ring.normal_axial * along
            + wp.abs(ring.normal_axial) * swing
            + ring.normal_radial * (outwards + ring.sector * around)
            + wp.abs(ring.turn_axial) * (wp.abs(along) + swing)
            + wp.abs(ring.turn_radial) * outwards
            + wp.abs(half_lever(ring)) * rate
        ) > zero

    @wp.func
    def behind_face(depth: real, wide: real, narrow: real, per_area: real):
        """Share of a patch beyond a face at x = 0, averaged over the step, minus 1/2.

        The patch spreads evenly over ±extent about its mid-step depth and moves evenly by ±motion. `wide` is the larger
        of extent and motion, `narrow` the smaller, and per_area = 1 / (2 wide narrow). The convolution of both makes
        the sum of the immersed area over the steps exact in straight flight.
        """
        rest = wp.max(zero, wide + narrow - wp.abs(depth))
        edge = half - quarter * rest * rest * per_area
        corner = wp.where(depth < zero, -edge, edge)
        return wp.where(wp.abs(depth) < wide - narrow, depth * narrow * per_area, corner)

    @wp.func
    def immersed_area(pose: struct.Pose, ring: struct.Ring, patch: struct.Patch, thickness: real, dt: real):
        """Area of a patch within the slab, averaged over the step [m²]."""
        meridian = ring.half_axial * pose.axis[0] + ring.half_radial * patch.outward_x
        around = ring.sector * ring.radius * patch.around_x
        smallest = flattest * (wp.abs(ring.half_axial) + wp.abs(ring.half_radial))
        extent = wp.max(wp.sqrt(meridian * meridian + around * around), smallest)
        advance = (
            patch.velocity_axial * pose.axis[0]
            + patch.velocity_outward * patch.outward_x
            + patch.velocity_around * patch.around_x
        )
        motion = half * dt * wp.abs(advance)
        wide = wp.max(extent, motion)
        narrow = wp.max(wp.min(extent, motion), narrowest * wide)
        per_area = half / (wide * narrow)
        front = behind_face(patch.x, wide, narrow, per_area)
        return ring.area * (front - behind_face(patch.x - thickness, wide, narrow, per_area))

    return SimpleNamespace(**locals())
