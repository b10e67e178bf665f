"""Bending moment in a rigid core: external against inertial loads (D'Alembert's principle).

Contact loads and the inertia of its slices act on the part of the core ahead of a section. The bending moment in the
section balances them. Loads are known ring by ring, so the moment is known behind every ring. It is a running sum from
the nose, and it ends at zero at the base.
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from . import contact, core_surface, damping, footprint, rigid_body
from .variant import Variant


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the bending for one variant."""
    real, vec3 = variant.real, variant.vec3
    zero, half, one = real(0.0), real(0.5), real(1.0)
    use = variant.use(core_surface, rigid_body, damping, contact, footprint)
    Surface, Pose = use.core_surface.Surface, use.core_surface.Pose
    Body, State, Load = use.rigid_body.Body, use.rigid_body.State, use.rigid_body.Load
    Change = use.rigid_body.Change
    Touches, Footprint, Sums = use.contact.Touches, use.footprint.Footprint, use.damping.Sums

    @wp.struct
    class Sections:
        """The sections behind the rings; arrays of shape [rings]. `station` is the distance behind the nose [m],
        `ahead` the distance ahead of the centre of mass [m]. `stress` is the stress per bending moment, 4/(π r³)
        [1/m³]; it is 0 where no stress is computed.

        ξ is the distance of a slice ahead of the centre of mass, x that of the section. The integrals run over all
        slices ahead of the section, per mass of the core: first = ∫ (ξ − x) dm [m], second = ∫ (ξ − x) ξ dm [m²] and
        rotary = ∫ r²/4 dm [m²].
        """

        station: wp.array(dtype=real)
        ahead: wp.array(dtype=real)
        stress: wp.array(dtype=real)
        first: wp.array(dtype=real)
        second: wp.array(dtype=real)
        rotary: wp.array(dtype=real)

    @wp.struct
    class Bending:
        """The largest bending moment [N m] and nominal stress [Pa] so far, and where behind the nose [m].

        A core is broken from the first step on in which the stress is above its `strength` [Pa]: the middle of that
        step [s], the most stressed section then behind the nose [m], and that section ahead of the hit point along x.
        """

        moment: real
        moment_station: real
        stress: real
        stress_station: real
        strength: real
        broken: wp.int32
        broken_time: real
        broken_station: real
        broken_x: real

    @wp.func
    def mean_force(sums: Sums, dv: vec3, dw: vec3):
        """Force on a ring [N], mean over the step, if the velocities change by (dv, dw) more than foreseen."""
        slopes = sums.slopes
        return sums.force - half * (use.damping.damping_vv(slopes) * dv + use.damping.damping_vw(slopes) * dw)

    @wp.func
    def mean_moment(sums: Sums, dv: vec3, dw: vec3):
        """Moment of a ring about the centre of mass [N m], likewise."""
        slopes = sums.slopes
        coupled = wp.transpose(use.damping.damping_vw(slopes)) * dv
        return sums.moment - half * (coupled + use.damping.damping_ww(slopes) * dw)

    @wp.func
    def across(vector: vec3):
        """The axis × the vector, along the body axes."""
        return vec3(zero, -vector[2], vector[1])

    @wp.func
    def bent(
        before: Bending,
        surface: Surface,
        sections: Sections,
        body: Body,
        touches: Touches,
        slot: wp.int32,
        found: Footprint,
        pose: Pose,
        state: State,
        load: Load,
        foreseen: Change,
        dt: real,
        time: real,
    ):
        """The larger of `before` and the bending in one step, whose load changes the velocities in `state`. The loads
        on the rings are those at half of the foreseen change. `time` is that of the middle of the step.

        A slice at ξ ahead of the centre of mass accelerates across the axis by a + (α + ω_x J ω) × ξ. Its moment per
        rotary inertia is α − ω_x J ω. Here J ω = axis × ω. The terms with ω_x come from the spin: Euler's equations for
        a disc, whose axial moment of inertia is twice the transverse one.
        """
        worst = before
        dv, dw, felt_v, felt_w = use.rigid_body.velocity_change(body, load, dt)
        share = use.rigid_body.restraint_of(body, state, dv, dw)
        gyration = (pose.omega[0] * (body.inertia_axial / body.inertia_transverse - one)) * across(pose.omega)
        spun = pose.omega[0] * across(pose.omega)
        turning = (share / dt) * dw + gyration
        push = across((share / dt) * dv)
        force, moment = vec3(), vec3()
        ahead = zero
        for index in range(surface.rings):
            here = use.core_surface.rings_before(surface, slot) + index
            area = zero
            if index >= found.first_ring and index <= found.last_ring:
                area = touches.total_area[here]
            if area > zero:
                sums = touches.sums[here]
                force += share * mean_force(sums, felt_v - foreseen.velocity, felt_w - foreseen.omega)
                moment += share * mean_moment(sums, felt_v - foreseen.velocity, felt_w - foreseen.omega)
            inertial = body.mass * (
                sections.first[index] * push
                + sections.second[index] * (turning + spun)
                + sections.rotary[index] * (turning - spun)
            )
            inner = moment - sections.ahead[index] * across(force) - inertial
            size = wp.sqrt(inner[1] * inner[1] + inner[2] * inner[2])
            if size > worst.moment:
                worst.moment = size
                worst.moment_station = sections.station[index]
            if size * sections.stress[index] > worst.stress:
                worst.stress = size * sections.stress[index]
                worst.stress_station = sections.station[index]
                ahead = sections.ahead[index]
        if worst.broken == 0 and worst.stress > worst.strength:
            worst.broken = 1
            worst.broken_time = time
            worst.broken_station = worst.stress_station
            worst.broken_x = state.position[0] + ahead * pose.axis[0]
        return worst

    return SimpleNamespace(**locals())
