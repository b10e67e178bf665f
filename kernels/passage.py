"""How a core left each layer of a target, and where it came to rest."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import lanes, rigid_body, structs
from .status import Status
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the passage through the layers for one variant."""
    struct = structs.build(variant)
    real, vec3 = variant.real, variant.vec3
    use = variant.use(lanes, rigid_body)
    ENTERED = wp.constant(int(Status.ARRESTED))  # the status of a core in a layer until it leaves the layer

    @wp.func
    def begin(passage: struct.Passage, shot: wp.int32, layers: wp.int32):
        """Record that the core has reached no layer yet."""
        for k in range(layers):
            passage.status[shot, k] = Status.NOT_REACHED
            passage.velocity[shot, k] = real(wp.nan)
            passage.tilt[shot, k] = real(wp.nan)
        passage.stopped_in[shot] = -1
        passage.depth[shot] = real(wp.nan)

    @wp.func
    def enter(passage: struct.Passage, shot: wp.int32, layer: wp.int32):
        """Record that the core touches a layer."""
        if passage.status[shot, layer] == Status.NOT_REACHED:
            passage.status[shot, layer] = ENTERED

    @wp.func
    def has_left(passage: struct.Passage, shot: wp.int32, layer: wp.int32):
        """Whether the core has already left a layer through its rear face."""
        return passage.status[shot, layer] == Status.PERFORATED or passage.status[shot, layer] == Status.MISSED

    @wp.func
    def leave(context: struct.Context, layer: wp.int32, state: struct.State, speed: real, since: real, flight: vec3):
        """Record how a core left a layer at a speed [m/s], `since` [s] ago."""
        passage, shot = context.passage, context.shot
        axis = use.rigid_body.axis_of(state.attitude)
        axis = use.rigid_body.turned(context.body, axis, state.angular_momentum, -since)
        entered = passage.status[shot, layer] == ENTERED
        use.lanes.barrier()
        passage.status[shot, layer] = wp.where(entered, Status.PERFORATED, Status.MISSED)
        passage.velocity[shot, layer] = speed
        passage.tilt[shot, layer] = use.rigid_body.angle_between(axis, flight)

    @wp.func
    def conclude(
        passage: struct.Passage, shot: wp.int32, layer: wp.int32, status: wp.int32, inside: wp.bool, depth: real
    ):
        """Record how the core ended in a layer that it did not leave through the rear face. It rests there if it is
        `inside`; `depth` is the largest distance of its points behind the front face [m]."""
        if passage.status[shot, layer] == ENTERED:
            stays = status == Status.ARRESTED and inside
            other = wp.where(status >= Status.UNFINISHED, status, Status.RICOCHETED)
            passage.status[shot, layer] = wp.where(stays, Status.ARRESTED, other)
            if stays:
                passage.stopped_in[shot] = layer
                passage.depth[shot] = depth

    return SimpleNamespace(**locals())
