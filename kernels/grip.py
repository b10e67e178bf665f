"""How a curved patch touches: normal and velocity vary linearly over it, and only its part that closes in touches."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import core_surface, interaction, structs
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of a patch's contact for one variant."""
    struct = structs.build(variant)
    real = variant.real
    use = variant.use(core_surface, interaction)

    @wp.func
    def variations(ring: struct.Ring, patch: struct.Patch):
        """Half of the variation of the closing speed over a patch, along the meridian and around [m/s]. Along the
        meridian the swing of the core counts, too: at 10⁴ rad/s it is more than the bend of a slender core's
        surface."""
        meridian = ring.turn_axial * patch.velocity_axial + ring.turn_radial * patch.velocity_outward
        meridian += use.core_surface.half_lever(ring) * patch.swing
        return meridian, ring.sector * ring.normal_radial * patch.velocity_around

    @wp.func
    def grip_of(law: struct.Law, pose: struct.Pose, ring: struct.Ring, patch: struct.Patch):
        """Contact of a curved patch: normal and velocity vary linearly over it, and only the part that closes in
        touches. Without this, contact along a shank would come and go by whole patches."""
        meridian, around = variations(ring, patch)
        return use.interaction.contact_of(
            law, patch.closing, wp.sqrt(meridian * meridian + around * around), pose.speed
        )

    @wp.func
    def face_of(ring: struct.Ring, patch: struct.Patch, shift: real):
        """The part of a patch in contact, from its grip's shift. Its power is taken at its own closing speed, so the
        load of a part that closes in never drives the core."""
        meridian, around = variations(ring, patch)
        face = struct.Face()
        face.axial = ring.normal_axial + shift * meridian * ring.turn_axial
        face.outward = ring.normal_radial + shift * meridian * ring.turn_radial
        face.around = shift * around * ring.sector * ring.normal_radial
        face.closing = patch.closing + shift * (meridian * meridian + around * around)
        face.station = ring.station + shift * meridian * ring.half_axial
        face.radius = ring.radius + shift * meridian * ring.half_radial
        return face

    @wp.func
    def normal_along_x(pose: struct.Pose, patch: struct.Patch, face: struct.Face):
        """Component along x of the normal of the part in contact."""
        return face.axial * pose.axis[0] + face.outward * patch.outward_x + face.around * patch.around_x

    return SimpleNamespace(**locals())
