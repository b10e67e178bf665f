"""How a core left each layer of a target, and where it came to rest."""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import lanes, rigid_body
from .status import Status
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the passage through the layers for one variant."""
    real, vec3 = variant.real, variant.vec3
    one = real(1.0)
    use = variant.use(lanes, rigid_body)
    Body, State = use.rigid_body.Body, use.rigid_body.State
    ENTERED = wp.constant(int(Status.ARRESTED))  # what a core that touches a layer is until it leaves

    @wp.struct
    class Passage:
        """How each core left each layer: arrays of shape [shots, layers], SI and radians.

        Velocity, tilt and time are those at the instant when the last point of the core leaves the layer through its
        rear face; NaN where that does not happen. Per shot: the layer that the core came to rest in, or −1, and how far
        behind this layer's front face any of its points came [m].

        `deflection` is that of the velocity at that instant; `standoff_tilt`, `standoff_pitch` and `standoff_yaw`, of
        shape [shots, layers, stand-offs], are those of a core that flies on free from there.
        """

        status: wp.array2d(dtype=wp.int32)
        velocity: wp.array2d(dtype=real)
        tilt: wp.array2d(dtype=real)
        time: wp.array2d(dtype=real)
        deflection: wp.array2d(dtype=real)
        standoff_tilt: wp.array3d(dtype=real)
        standoff_pitch: wp.array3d(dtype=real)
        standoff_yaw: wp.array3d(dtype=real)
        stopped_in: wp.array(dtype=wp.int32)
        depth: wp.array(dtype=real)

    @wp.func
    def begin(passage: Passage, shot: wp.int32, layers: wp.int32):
        """No layer is reached yet."""
        for k in range(layers):
            passage.status[shot, k] = Status.NOT_REACHED
            passage.velocity[shot, k] = real(wp.nan)
            passage.tilt[shot, k] = real(wp.nan)
            passage.time[shot, k] = real(wp.nan)
            passage.deflection[shot, k] = real(wp.nan)
            for m in range(passage.standoff_tilt.shape[2]):
                passage.standoff_tilt[shot, k, m] = real(wp.nan)
                passage.standoff_pitch[shot, k, m] = real(wp.nan)
                passage.standoff_yaw[shot, k, m] = real(wp.nan)
        passage.stopped_in[shot] = -1
        passage.depth[shot] = real(wp.nan)

    @wp.func
    def enter(passage: Passage, shot: wp.int32, layer: wp.int32):
        """Record that the core touches a layer."""
        if passage.status[shot, layer] == Status.NOT_REACHED:
            passage.status[shot, layer] = ENTERED

    @wp.func
    def has_left(passage: Passage, shot: wp.int32, layer: wp.int32):
        """Whether the core has left a layer through its rear face before."""
        return passage.status[shot, layer] == Status.PERFORATED or passage.status[shot, layer] == Status.MISSED

    @wp.func
    def angle_between(a: vec3, b: vec3):
        return wp.atan2(wp.length(wp.cross(a, b)), wp.dot(a, b))

    @wp.func
    def fly_on(
        passage: Passage,
        body: Body,
        standoffs: wp.array(dtype=real),
        ahead: real,
        shot: wp.int32,
        layer: wp.int32,
        state: State,
        rear: real,
        flight: vec3,
    ):
        """Record the attitude at distances behind a layer's rear face [m], of a core that touches nothing on its way.
        The point of the axis that passes them is `ahead` of the centre of mass, towards the nose [m]."""
        axis = use.rigid_body.axis_of(state.attitude)
        for m in range(standoffs.shape[0]):
            distance = standoffs[m] + (rear - state.position[0])
            then = use.rigid_body.axis_at(
                body, axis, state.angular_momentum, ahead, wp.max(state.velocity[0], one), distance
            )
            passage.standoff_tilt[shot, layer, m] = angle_between(then, flight)
            passage.standoff_pitch[shot, layer, m] = wp.atan2(then[2], then[0])
            passage.standoff_yaw[shot, layer, m] = wp.atan2(then[1], then[0])

    @wp.func
    def leave(
        passage: Passage,
        body: Body,
        shot: wp.int32,
        layer: wp.int32,
        state: State,
        speed: real,
        since: real,
        time: real,
        flight: vec3,
    ):
        """Record how a core left a layer at a speed [m/s], `since` [s] before the time."""
        axis = use.rigid_body.turned(body, use.rigid_body.axis_of(state.attitude), state.angular_momentum, -since)
        entered = passage.status[shot, layer] == ENTERED
        use.lanes.barrier()
        passage.status[shot, layer] = wp.where(entered, Status.PERFORATED, Status.MISSED)
        passage.velocity[shot, layer] = speed
        passage.tilt[shot, layer] = angle_between(axis, flight)
        passage.time[shot, layer] = time - since
        passage.deflection[shot, layer] = angle_between(state.velocity, flight)

    @wp.func
    def conclude(passage: Passage, shot: wp.int32, layer: wp.int32, status: wp.int32, inside: wp.bool, depth: real):
        """Say how the core ended in a layer that it did not leave through the rear face. It rests there if it is
        `inside`; `depth` is how far it came behind the front face [m]."""
        if passage.status[shot, layer] == ENTERED:
            stays = status == Status.ARRESTED and inside
            other = wp.where(status >= Status.UNFINISHED, status, Status.RICOCHETED)
            passage.status[shot, layer] = wp.where(stays, Status.ARRESTED, other)
            if stays:
                passage.stopped_in[shot] = layer
                passage.depth[shot] = depth

    return SimpleNamespace(**locals())
