"""Bending moment in a rigid core: external against inertial loads (D'Alembert's principle).

Contact loads and the inertia of its slices act on the part of the core ahead of a section. The bending moment in the
section balances them. Loads are known ring by ring, so the moment is known behind every ring. It is a running sum from
the nose, and it ends at zero at the base.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from . import contact, core_surface, rigid_body, structs, trace
from .variant import Variant


@wp.func
def moment_in(sections: Any, index: wp.int32, mass: Any, moment: Any, lever: Any, push: Any, turning: Any, spun: Any):
    """Moment in a section [N m], by the loads and the inertia of the slices ahead of it.

    A slice at ξ ahead of the centre of mass accelerates across the axis by a + (α + ω_x J ω) × ξ. Its moment per rotary
    inertia is α − ω_x J ω. Here J ω = axis × ω. The terms with ω_x come from the spin: Euler's equations for a disc,
    whose axial moment of inertia is twice the transverse one.

    Args:
        moment, lever: of the loads about the centre of mass [N m], and axis × their force [N].
        push, turning, spun: axis × a, α and ω_x J ω.
    """
    inertial = mass * (
        sections.first[index] * push
        + sections.second[index] * (turning + spun)
        + sections.rotary[index] * (turning - spun)
    )
    return moment - sections.ahead[index] * lever - inertial


@wp.func
def larger_bending(worst: Any, ahead: Any, sections: Any, index: wp.int32, size: Any):
    """The larger of a bending and that of a moment in a section [N m]; and how far ahead of the centre of mass the
    section of its stress is, `ahead` before [m]."""
    if size > worst.moment:
        worst.moment = size
        worst.moment_station = sections.station[index]
    if size * sections.stress[index] > worst.stress:
        worst.stress = size * sections.stress[index]
        worst.stress_station = sections.station[index]
        ahead = sections.ahead[index]
    return worst, ahead


@wp.func
def broken_if_weaker(worst: Any, now: Any, x: Any):
    """A bending, whose core breaks now where its stress is, at x [m], if this is above its strength."""
    if worst.broken == 0 and worst.stress > worst.strength:
        worst.broken = 1
        worst.broken_time = now
        worst.broken_station = worst.stress_station
        worst.broken_x = x
    return worst


@cache
def build(variant: Variant) -> SimpleNamespace:
    """Device functions of the bending for one variant."""
    struct = structs.build(variant)
    real, vec3 = variant.real, variant.vec3
    zero, half, one = real(0.0), real(0.5), real(1.0)
    use = variant.use(contact, core_surface, rigid_body, trace)

    @wp.func
    def mean_force(sums: struct.Sums, dv: vec3, dw: vec3):
        """Mean force on a ring over the step [N], if the velocities change by (dv, dw) more than predicted."""
        return sums.force - half * (use.contact.damping_vv(sums) * dv + use.contact.damping_vw(sums) * dw)

    @wp.func
    def mean_moment(sums: struct.Sums, dv: vec3, dw: vec3):
        """Mean moment of a ring about the centre of mass over the step [N m], for the same change."""
        coupled = wp.transpose(use.contact.damping_vw(sums)) * dv
        return sums.moment - half * (coupled + use.contact.damping_ww(sums) * dw)

    @wp.func
    def across(vector: vec3):
        """The axis × the vector, along the body axes."""
        return vec3(zero, -vector[2], vector[1])

    @wp.func
    def bent(
        before: struct.Bending,
        context: struct.Context,
        footprint: struct.Footprint,
        pose: struct.Pose,
        state: struct.State,
        load: struct.Load,
        predicted: struct.Change,
        clock: struct.Clock,
    ):
        """The larger of `before` and the bending in one step, whose load changes the velocities in `state`. The loads
        on the rings are taken at half of the predicted change."""
        surface, sections, body, touches = context.surface, context.sections, context.body, context.touches
        dt = clock.step
        worst = before
        dv, dw, felt_v, felt_w = use.rigid_body.velocity_change(body, load, dt)
        share = use.rigid_body.restraint(body, state, dv, dw)
        gyration = (pose.omega[0] * (body.inertia_axial / body.inertia_transverse - one)) * across(pose.omega)
        spun = pose.omega[0] * across(pose.omega)
        turning = (share / dt) * dw + gyration
        push = across((share / dt) * dv)
        force, moment = vec3(), vec3()
        ahead = zero
        for index in range(surface.rings):
            here = use.core_surface.rings_before(surface, context.slot) + index
            area = zero
            if index >= footprint.first_ring and index <= footprint.last_ring:
                area = touches.total_area[here]
            if area > zero:
                sums = touches.sums[here]
                force += share * mean_force(sums, felt_v - predicted.velocity, felt_w - predicted.omega)
                moment += share * mean_moment(sums, felt_v - predicted.velocity, felt_w - predicted.omega)
            inner = moment_in(sections, index, body.mass, moment, across(force), push, turning, spun)
            size = wp.sqrt(inner[1] * inner[1] + inner[2] * inner[2])
            worst, ahead = larger_bending(worst, ahead, sections, index, size)
        return broken_if_weaker(worst, use.trace.now(clock), state.position[0] + ahead * pose.axis[0])

    return SimpleNamespace(bent=bent)
