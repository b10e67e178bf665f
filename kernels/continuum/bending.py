"""Bending moment in the rigid core of a hit, from the forces of the contact on its slices (kernels/bending.py).

Forces of single nodes come and go within some steps, faster than a core bends: the loads are means over a window.
"""

import warp as wp

from .. import rigid_body
from ..bending import broken_if_weaker, larger_bending, moment_in
from . import choices
from .fields import RIGID, Core, Flight

body = rigid_body.build(RIGID)
ZERO, HALF, ONE = wp.float64(0.0), wp.float64(0.5), wp.float64(1.0)
WINDOW = wp.float64(choices.WINDOW.value)


@wp.func
def add_impulse(core: Core, part: wp.int32, axis: wp.vec3d, away: wp.vec3d, impulse: wp.vec3d):
    """Add an impulse on the core at a place relative to its centre of mass [N s] to that on the slice there."""
    slices = core.impulses.shape[1] // 6
    share = (core.centre_of_mass - wp.dot(away, axis)) / core.length
    place = 6 * wp.clamp(wp.int32(share * wp.float64(slices)), 0, slices - 1)
    moment = wp.cross(away, impulse)
    for k in range(3):
        core.impulses[part, place + k] = core.impulses[part, place + k] + impulse[k]
        core.impulses[part, place + 3 + k] = core.impulses[part, place + 3 + k] + moment[k]


@wp.func
def total_impulse(core: Core):
    """Impulse on all slices [N s] and its moment [N m s]; leaves those of each slice in the first part."""
    impulse, moment = wp.vec3d(), wp.vec3d()
    for column in range(core.impulses.shape[1]):
        for part in range(1, core.impulses.shape[0]):
            core.impulses[0, column] = core.impulses[0, column] + core.impulses[part, column]
            core.impulses[part, column] = ZERO
    for index in range(core.impulses.shape[1] // 6):
        for k in range(3):
            impulse[k] += core.impulses[0, 6 * index + k]
            moment[k] += core.impulses[0, 6 * index + 3 + k]
    return impulse, moment


@wp.func
def bent(core: Core, flight: Flight):
    """The larger of the bending so far and that of the mean loads of a window, which ends. Contact and inertia
    balance behind every slice as in kernels/bending.py, here in the plate frame."""
    sections, own, state, worst = core.sections, core.body, flight.state, wp.copy(flight.bending)
    span = flight.time - flight.window
    axis = body.axis_of(state.attitude)
    omega = body.angular_velocity(own, axis, state.angular_momentum)
    impulse, turn = total_impulse(core)
    spin = wp.dot(omega, axis)
    spun = spin * wp.cross(axis, omega)
    turning = (turn - wp.dot(turn, axis) * axis) / (span * own.inertia_transverse)
    turning += (own.inertia_axial / own.inertia_transverse - ONE) * spun
    push = wp.cross(axis, impulse) / (span * own.mass)
    force, moment = wp.vec3d(), wp.vec3d()
    ahead = ZERO
    for index in range(core.impulses.shape[1] // 6):
        for k in range(3):
            force[k] += core.impulses[0, 6 * index + k] / span
            moment[k] += core.impulses[0, 6 * index + 3 + k] / span
            core.impulses[0, 6 * index + k] = ZERO
            core.impulses[0, 6 * index + 3 + k] = ZERO
        inner = moment_in(sections, index, own.mass, moment, wp.cross(axis, force), push, turning, spun)
        size = wp.length(inner - wp.dot(inner, axis) * axis)
        worst, ahead = larger_bending(worst, ahead, sections, index, size)
    return broken_if_weaker(worst, flight.time - HALF * span, state.position[0] + ahead * axis[0])


@wp.func
def bent_in_time(core: Core, flight: Flight):
    """A flight with the bending of a window, where one ends; as it is, where bending is not recorded."""
    if core.impulses.shape[1] > 0 and flight.time - flight.window >= WINDOW:
        flight.bending = bent(core, flight)
        flight.window = flight.time
    return flight
