"""Contact between bodies: nodes against the faces of live elements of others, a penalty in both directions.

A face is a side of an element without a live neighbour: number 6 element + side. From time to time the faces near
other bodies enter the cells of a grid of their body, and every node takes from its cell those of other bodies that it
may reach. Bounds of a face say where that is: the foot on a face that is long and twisted may lie anywhere. In each
step a node presses the nearest one that it is behind of, and the four corners of the face take the reaction.

Nodes of a core of elements press no faces. On it, others press the surface of cubic B-splines through its nodes, which
goes on round edges; the sixteen nodes of the patch take the reaction. Where faces were flat, nodes that slide from one
to the next took ten per cent of what a core lost, and loads on four nodes drove more into hourglasses.

Sums have a fixed order. A part of the threads of a hit owns some of the cells, and some of the nodes; it looks at all
faces, or at all pushes, in their order, and adds what is its own. So no two threads add to the same place.
"""

from typing import Any

import warp as wp

from ..memory import read, write
from . import choices
from .fields import CELLS_ALONG, CORE, FACES_IN_CELL, FACES_OF_NODE, Contacts, Flight, Push, put_vector, vector_at
from .stages import live_about

ZERO, HALF, ONE, QUARTER = wp.float64(0.0), wp.float64(0.5), wp.float64(1.0), wp.float64(0.25)
TWO, SIX, FLAT = wp.float64(2.0), wp.float64(6.0), wp.float64(1.0e-40)
FAR = wp.float64(1.0e3)
STABLE = wp.float64(choices.STABLE_CONTACT.value)
DEEPEST = wp.float64(choices.DEEPEST.value)
DAMPING, SLIP = wp.float64(2.0 * choices.DAMPING.value), wp.float64(choices.SLIP.value)
ALIKE = wp.float64(0.7)
AT_FACE = wp.float64(choices.AT_FACE.value)


@wp.func
def is_due(mesh: Any, flight: Flight):
    """Whether the faces enter the grid anew."""
    return flight.sorted < ZERO or flight.time - flight.sorted >= mesh.contacts.interval


@wp.func
def place_of(mesh: Any, node: wp.int32):
    """Position of a node [m]."""
    return wp.vec3d(vector_at(mesh.position, mesh.size, node))


# --- Bound, expose, enter, choose: which faces a node may reach ---


@wp.func
def bound(mesh: Any, body: wp.int32):
    """The box about the live elements of a body.

    Data in: mesh.position, mesh.alive. Data out: mesh.contacts.boxes.
    """
    least, most = wp.vec3d(FAR, FAR, FAR), wp.vec3d(-FAR, -FAR, -FAR)
    for run in range(mesh.runs.shape[0] // 3):
        block = mesh.blocks[mesh.runs[3 * run + 2]]
        element, last = wp.int32(mesh.runs[3 * run]), wp.int32(mesh.runs[3 * run + 1])
        while element < last and block.body == body:
            if read(mesh.alive, element) > type(mesh.kick)(0.0):
                near, far = place_of(mesh, element), place_of(mesh, element + block.plane + block.row + 1)
                least = wp.min(least, wp.min(near, far))
                most = wp.max(most, wp.max(near, far))
            element += 1
    for k in range(3):
        mesh.contacts.boxes[6 * body + k] = least[k]
        mesh.contacts.boxes[6 * body + 3 + k] = most[k]


@wp.func
def deepest(mesh: Any, face: wp.int32):
    """How far behind a face a node touches it at most [m]."""
    return DEEPEST * wp.float64(mesh.blocks[mesh.block[face // 6]].spacing)


@wp.func
def is_by(mesh: Any, other: wp.int32, place: wp.vec3d):
    """Whether a place is in the box of a body that is awake."""
    boxes, margin = mesh.contacts.boxes, mesh.contacts.reach + mesh.contacts.cell
    within = mesh.awake[other] != 0
    for k in range(3):
        within = within and place[k] > boxes[6 * other + k] - margin
        within = within and place[k] < boxes[6 * other + 3 + k] + margin
    return within


@wp.func
def is_by_another(mesh: Any, body: wp.int32, place: wp.vec3d):
    """Whether a place is in the box of a body that is awake, of any but one."""
    inside = wp.bool(False)
    for other in range(mesh.bodies.shape[0]):
        inside = inside or (other != body and is_by(mesh, other, place))
    return inside


@wp.func
def frame_of(mesh: Any, face: wp.int32):
    """Distance in memory inwards from a face, its first node, and distances to its neighbours, anticlockwise as seen
    from outside."""
    element, side = face // 6, face % 6
    block = mesh.blocks[mesh.block[element]]
    plane, row = wp.int32(block.plane), wp.int32(block.row)
    ahead = wp.where(side < 2, plane, wp.where(side < 4, row, 1))
    first = wp.where(side < 2, row, wp.where(side < 4, 1, plane))
    second = wp.where(side < 2, 1, wp.where(side < 4, plane, row))
    inwards, start = wp.where(side % 2 == 1, -ahead, ahead), element + wp.where(side % 2 == 1, ahead, 0)
    return inwards, start, wp.where(side % 2 == 1, first, second), wp.where(side % 2 == 1, second, first)


@wp.func
def corners_of(mesh: Any, face: wp.int32):
    """The four nodes of a face, anticlockwise as seen from outside."""
    _, start, left, right = frame_of(mesh, face)
    return wp.vec4i(start, start + left, start + left + right, start + right)


@wp.func
def put_bounds(mesh: Any, face: wp.int32):
    """Write between which coordinates a face may be touched before the next time.

    Data in: mesh.position. Data out: mesh.contacts.bounds.
    """
    corners, margin = corners_of(mesh, face), mesh.contacts.margin
    a, b = place_of(mesh, corners[0]), place_of(mesh, corners[1])
    c, d = place_of(mesh, corners[2]), place_of(mesh, corners[3])
    inwards = -deepest(mesh, face) * wp.normalize(wp.cross(c - a, d - b))
    least, most = wp.min(wp.min(a, b), wp.min(c, d)), wp.max(wp.max(a, b), wp.max(c, d))
    least, most = wp.min(least, least + inwards), wp.max(most, most + inwards)
    for k in range(3):
        mesh.contacts.bounds[6 * face + k] = wp.float32(least[k] - margin)
        mesh.contacts.bounds[6 * face + 3 + k] = wp.float32(most[k] + margin)


@wp.func
def expose(mesh: Any, block: Any, element: wp.int32):
    """Bits of the sides of an element that are faces: those before and beyond along planes, rows and columns.

    Data in: mesh.alive, mesh.position, mesh.contacts.boxes. Data out: mesh.contacts.exposed, mesh.contacts.bounds.
    """
    nil, bits = type(mesh.kick)(0.0), wp.int32(0)
    if read(mesh.alive, element) > nil and is_by_another(mesh, block.body, place_of(mesh, element)):
        bits += wp.where(read(mesh.alive, element - block.plane_before) > nil, 0, 1)
        bits += wp.where(read(mesh.alive, element + block.plane) > nil, 0, 2)
        bits += wp.where(read(mesh.alive, element - block.row) > nil, 0, 4)
        bits += wp.where(read(mesh.alive, element + block.row) > nil, 0, 8)
        bits += wp.where(read(mesh.alive, element - 1) > nil, 0, 16)
        bits += wp.where(read(mesh.alive, element + 1) > nil, 0, 32)
    mesh.contacts.exposed[element] = bits
    for side in range(6):
        if (bits >> side) & 1 == 1:
            put_bounds(mesh, 6 * element + side)


@wp.func
def enter(mesh: Any, part: wp.int32, parts: wp.int32):
    """Enter all faces into the cells of their bodies that belong to a part: those that a face may be touched in.

    Data in: mesh.contacts.exposed, mesh.contacts.bounds. Data out: mesh.contacts.counts, mesh.contacts.cells.
    """
    contacts = mesh.contacts
    cell = wp.int32(part)
    while cell < contacts.counts.shape[0]:
        contacts.counts[cell] = 0
        cell += parts
    for run in range(mesh.runs.shape[0] // 3):
        element, last = wp.int32(mesh.runs[3 * run]), wp.int32(mesh.runs[3 * run + 1])
        own = mesh.blocks[mesh.runs[3 * run + 2]].body
        while element < last and mesh.awake[own] != 0:
            bits = contacts.exposed[element]
            if bits != 0:
                for side in range(6):
                    if (bits >> side) & 1 == 1:
                        enter_face(mesh, own, 6 * element + side, part, parts)
            element += 1


@wp.func
def cell_at(body: wp.int32, i: wp.int32, j: wp.int32, k: wp.int32):
    """Number of a cell of the grid of a body; cells far apart share one."""
    most = wp.static(CELLS_ALONG - 1)
    return ((body * CELLS_ALONG + (i & most)) * CELLS_ALONG + (j & most)) * CELLS_ALONG + (k & most)


@wp.func
def cell_along(contacts: Contacts, bound: wp.int32):
    """Number along an axis of the cell in which a bound of a face lies."""
    return wp.int32(wp.floor(wp.float64(contacts.bounds[bound]) / contacts.cell))


@wp.func
def enter_face(mesh: Any, body: wp.int32, face: wp.int32, part: wp.int32, parts: wp.int32):
    """Enter a face of a body into the cells of a part; a full cell takes no more, and the hit fails."""
    contacts = mesh.contacts
    i, last_i = cell_along(contacts, 6 * face), cell_along(contacts, 6 * face + 3)
    first_j, last_j = cell_along(contacts, 6 * face + 1), cell_along(contacts, 6 * face + 4)
    first_k, last_k = cell_along(contacts, 6 * face + 2), cell_along(contacts, 6 * face + 5)
    while i <= last_i:
        j = wp.int32(first_j)
        while j <= last_j:
            k = wp.int32(first_k)
            while k <= last_k:
                cell = cell_at(body, i, j, k)
                if cell % parts == part:
                    count = contacts.counts[cell]
                    if count < FACES_IN_CELL:
                        contacts.cells[FACES_IN_CELL * cell + count] = face
                        contacts.counts[cell] = count + 1
                    else:
                        contacts.crowded[0] = 1
                k += 1
            j += 1
        i += 1


@wp.struct
class Foot:
    """The place of a face that is nearest to a node, from there [m]: its share of each corner, its outward normal, how
    deep the node lies behind it, and how far beside it [m]."""

    way: wp.vec3d
    shares: wp.vec4d
    normal: wp.vec3d
    depth: wp.float64
    overhang: wp.float64


@wp.func
def foot_of(mesh: Any, corners: wp.vec4i, place: wp.vec3d):
    """The foot of a place on a face, which is bilinear between its corners."""
    a, b = place_of(mesh, corners[0]), place_of(mesh, corners[1])
    c, d = place_of(mesh, corners[2]), place_of(mesh, corners[3])
    along, across, twist = QUARTER * (b + c - a - d), QUARTER * (c + d - a - b), QUARTER * (a - b + c - d)
    middle, foot = place - QUARTER * (a + b + c + d), Foot()
    normal = wp.cross(along, across)
    square = wp.dot(normal, normal)
    foot.overhang = FAR
    if square > ZERO:
        to_u, to_v = wp.cross(across, normal) / square, wp.cross(normal, along) / square
        u, v = wp.dot(to_u, middle), wp.dot(to_v, middle)
        rest = middle - (u * v) * twist  # what the twist leaves for the plane of both directions
        u, v = wp.dot(to_u, rest), wp.dot(to_v, rest)
        foot.overhang = wp.max((wp.abs(u) - ONE) * wp.length(along), (wp.abs(v) - ONE) * wp.length(across))
        u, v = wp.clamp(u, -ONE, ONE), wp.clamp(v, -ONE, ONE)
        foot.normal = wp.normalize(wp.cross(along + v * twist, across + u * twist))
        foot.way = u * along + v * across + (u * v) * twist - middle
        foot.depth = wp.dot(foot.way, foot.normal)
        less_u, more_u, less_v, more_v = ONE - u, ONE + u, ONE - v, ONE + v
        foot.shares = QUARTER * wp.vec4d(less_u * less_v, more_u * less_v, more_u * more_v, less_u * more_v)
    return foot


@wp.func
def is_within_bounds(contacts: Contacts, face: wp.int32, place: wp.vec3):
    """Whether a face may be touched at a place."""
    bounds, least, off = contacts.bounds, 6 * face, wp.float32(-1.0)
    for k in range(3):
        off = wp.max(off, wp.max(bounds[least + k] - place[k], place[k] - bounds[least + 3 + k]))
    return off < wp.float32(0.0)


@wp.func
def choose(mesh: Any, block: Any, node: wp.int32):
    """Choose the faces of other bodies that a node may touch before the next time: a node of the surface those of all,
    others that may push a core those of the core.

    Data in: mesh.position, mesh.contacts.counts, mesh.contacts.cells, mesh.contacts.bounds.
    Data out: mesh.contacts.near, mesh.contacts.faces; mesh.contacts.normals and depths, 0 where no face is near.
    """
    contacts, place, count = mesh.contacts, place_of(mesh, node), wp.int32(0)
    live, has_mass = live_about(mesh, block, node), read(mesh.inverse_mass, node) > type(mesh.kick)(0.0)
    is_outer = live > type(live)(0.0) and live < type(live)(8.0)
    is_to_choose = live > type(live)(0.0) or (block.debris == 1 and has_mass)
    if mesh.bodies[block.body].layer == CORE:
        is_to_choose = False
    spot, at = wp.vec3(place), place / contacts.cell
    i, j, k = wp.int32(wp.floor(at[0])), wp.int32(wp.floor(at[1])), wp.int32(wp.floor(at[2]))
    for other in range(mesh.bodies.shape[0]):
        may_touch = is_to_choose and other != block.body and (is_outer or mesh.bodies[other].layer == CORE)
        cell = cell_at(other, i, j, k)
        if may_touch and is_by(mesh, other, place):
            for entry in range(contacts.counts[cell]):
                face = contacts.cells[FACES_IN_CELL * cell + entry]
                if is_within_bounds(contacts, face, spot):
                    foot = foot_of(mesh, corners_of(mesh, face), place)
                    is_off = foot.overhang > contacts.margin or foot.depth < -contacts.margin
                    if not is_off and foot.depth < deepest(mesh, face) + contacts.margin:
                        if count < FACES_OF_NODE:
                            contacts.faces[count * mesh.size + node] = face
                            count += 1
                        else:
                            contacts.crowded[0] = 1
    if count == 0:
        put_vector(contacts.normals, mesh.size, node, wp.vec3d())
        write(contacts.depths, node, ZERO)
    contacts.near[node] = count


# --- Touch and react: the force of a face on a node ---


@wp.func
def sliding_at(mesh: Any, node: wp.int32, corners: wp.vec4i, shares: wp.vec4d):
    """Velocity of a node over that of a place on a face [m/s]."""
    sliding = wp.vec3d(vector_at(mesh.velocity, mesh.size, node))
    for k in range(4):
        sliding -= shares[k] * wp.vec3d(vector_at(mesh.velocity, mesh.size, corners[k]))
    return sliding


@wp.func
def sliding_over(mesh: Any, push: Push):
    """Velocity of a node over that of its place on a face, or on the smooth surface of a core [m/s]."""
    sliding = wp.vec3d()
    if is_of_core(mesh, push.face):
        sliding = smooth_sliding(mesh, push)
    else:
        sliding = sliding_at(mesh, push.node, push.corners, push.shares)
    return sliding


@wp.func
def touch(mesh: Any, block: Any, flight: Flight, node: wp.int32):
    """The push of the face that a node has come through; its force is 0 if there is none.

    Of a node that comes, it is the face that it has been behind of for the shortest time; of one that touched before,
    the nearest of those that face the same way. Else a node at an edge would slip from one face to the other. A depth
    grows by no more than the node has come since the last step: where an element fails, what lies behind its
    neighbours does not leap out.

    Model: mesh.blocks, mesh.inverse_mass.
    Data in: mesh.position, mesh.velocity, mesh.alive, mesh.contacts.near, mesh.contacts.faces.
    Data in and out: mesh.contacts.normals, mesh.contacts.depths. Data out: mesh.touched.
    """
    contacts, place, nil = mesh.contacts, place_of(mesh, node), type(mesh.kick)(0.0)
    push, least, best = Push(), FAR + FAR, Foot()  # a sum, as the variable changes
    before, margin = vector_at(contacts.normals, mesh.size, node), AT_FACE * contacts.reach
    known, normal = read(contacts.depths, node), wp.vec3d()
    for number in range(contacts.near[node]):
        face = contacts.faces[number * mesh.size + node]
        corners = corners_of(mesh, face)
        foot = foot_of(mesh, corners, place)
        is_behind = foot.depth > -margin and foot.depth < deepest(mesh, face) and foot.overhang < margin
        if is_behind and read(mesh.alive, face // 6) > nil:
            closing = wp.max(-wp.dot(sliding_at(mesh, node, corners, foot.shares), foot.normal), SLIP)
            rank = foot.depth
            if wp.dot(foot.normal, before) < ALIKE:
                rank = ONE + (foot.depth + margin) / closing
            goes_on = wp.dot(foot.normal, best.normal) > ALIKE and wp.abs(foot.depth - best.depth) < margin
            if goes_on:
                normal += foot.normal
            if rank < least:
                normal = wp.where(goes_on, normal, foot.normal)
                least = rank
                best = foot
                push.node = node
                push.face = face
                push.corners = corners
    if least < FAR:  # at an edge, between the normals of the faces that it parts
        push.shares = best.shares
        best.normal = wp.normalize(normal)
        smooth = is_of_core(mesh, push.face)
        if smooth and best.depth > ZERO:
            best = smooth_foot(mesh, push.face, place, best)
            push.shares = best.shares
        if best.depth > ZERO or not smooth:  # in front of a core, which bulges outwards, there is no force
            sliding = sliding_over(mesh, push)
            closing = -wp.dot(sliding, best.normal)
            best.depth = wp.min(wp.dot(best.way, best.normal), known + closing * flight.step)
            push.force = force_of(mesh, block, flight, push, best, sliding)
        best.depth = wp.max(best.depth, ZERO)
        if wp.dot(push.force, push.force) > ZERO:
            meet(mesh, block.body, mesh.blocks[mesh.block[push.face // 6]].body, flight)
    put_vector(contacts.normals, mesh.size, node, best.normal)
    write(contacts.depths, node, best.depth)
    return push


@wp.func
def spline_shares(place: wp.float64):
    """Shares of four nodes in a row at a place between the middle ones, 0 to 1: a cubic B-spline."""
    rest = ONE - place
    before, beyond = rest * rest * rest / SIX, place * place * place / SIX
    return wp.vec4d(before, rest + beyond - TWO * before, place + before - TWO * beyond, beyond)


@wp.func
def spline_slopes(place: wp.float64):
    """Slopes of these shares over the place."""
    rest = ONE - place
    before, beyond = -HALF * rest * rest, HALF * place * place
    return wp.vec4d(before, beyond - ONE - TWO * before, ONE + before - TWO * beyond, beyond)


@wp.struct
class Patch:
    """Nodes about a face of a core, four by four: the first one of the face, distances in memory from it to the left
    and to the right, and inwards. Where the surface goes round an edge, the node beyond is one inwards, and a turn is
    1."""

    start: wp.int32
    inwards: wp.int32
    left: wp.vec4i
    right: wp.vec4i
    left_turns: wp.vec4i
    right_turns: wp.vec4i


@wp.func
def steps_along(mesh: Any, element: wp.int32, stride: wp.int32, inwards: wp.int32):
    """Distances to four nodes in a row along one direction, and turns."""
    nil, steps, turns = type(mesh.kick)(0.0), wp.vec4i(-stride, 0, stride, 2 * stride), wp.vec4i(0, 0, 0, 0)
    if read(mesh.alive, element - stride) <= nil:
        steps[0] = inwards
        turns[0] = 1
    if read(mesh.alive, element + stride) <= nil:
        steps[3] = stride + inwards
        turns[3] = 1
    return steps, turns


@wp.func
def patch_of(mesh: Any, face: wp.int32):
    """The nodes about a face of a core."""
    patch, element = Patch(), face // 6
    inwards, start, left, right = frame_of(mesh, face)
    left_steps, left_turns = steps_along(mesh, element, left, inwards)
    right_steps, right_turns = steps_along(mesh, element, right, inwards)
    patch.start = start
    patch.inwards = inwards
    patch.left = left_steps
    patch.right = right_steps
    patch.left_turns = left_turns
    patch.right_turns = right_turns
    return patch


@wp.func
def node_of(patch: Patch, i: wp.int32, j: wp.int32):
    """A node of a patch; at a corner it is one inwards, not two, as there may be no more."""
    return patch.start + patch.left[i] + patch.right[j] - patch.left_turns[i] * patch.right_turns[j] * patch.inwards


@wp.func
def smooth_foot(mesh: Any, face: wp.int32, place: wp.vec3d, foot: Foot):
    """The foot of a place on the smooth surface of a core, near that on one of its faces."""
    patch = patch_of(mesh, face)
    u, v = foot.shares[1] + foot.shares[2], foot.shares[2] + foot.shares[3]
    way, normal = wp.vec3d(), wp.vec3d()
    for _ in range(2):
        to_left, to_right, by_left, by_right = spline_shares(u), spline_shares(v), spline_slopes(u), spline_slopes(v)
        way = -place
        along, across = wp.vec3d(), wp.vec3d()
        for i in range(4):
            for j in range(4):
                own = place_of(mesh, node_of(patch, i, j))
                way += to_left[i] * to_right[j] * own
                along += by_left[i] * to_right[j] * own
                across += to_left[i] * by_right[j] * own
        normal = wp.cross(along, across)
        square = wp.max(wp.dot(normal, normal), FLAT)
        u = wp.clamp(u - wp.dot(wp.cross(across, normal), way) / square, ZERO, ONE)
        v = wp.clamp(v - wp.dot(wp.cross(normal, along), way) / square, ZERO, ONE)
    foot.way = way
    foot.normal = wp.normalize(normal)
    foot.depth = wp.dot(foot.way, foot.normal)
    foot.shares = wp.vec4d((ONE - u) * (ONE - v), u * (ONE - v), u * v, (ONE - u) * v)
    return foot


@wp.func
def smooth_sliding(mesh: Any, push: Push):
    """Velocity of a node over that of the smooth surface of a core [m/s]."""
    patch, sliding = patch_of(mesh, push.face), wp.vec3d(vector_at(mesh.velocity, mesh.size, push.node))
    to_left = spline_shares(push.shares[1] + push.shares[2])
    to_right = spline_shares(push.shares[2] + push.shares[3])
    for i in range(4):
        for j in range(4):
            own = node_of(patch, i, j)
            sliding -= to_left[i] * to_right[j] * wp.vec3d(vector_at(mesh.velocity, mesh.size, own))
    return sliding


@wp.func
def is_of_core(mesh: Any, face: wp.int32):
    """Whether a face is one of a core."""
    return mesh.bodies[mesh.blocks[mesh.block[face // 6]].body].layer == CORE


@wp.func
def meet(mesh: Any, one: wp.int32, other: wp.int32, flight: Flight):
    """Note the time at which a core touches a layer, and a part of the bullet any layer."""
    if mesh.bodies[other].layer == CORE:
        if mesh.bodies[one].layer >= 0:
            mesh.touched[one] = flight.time
    elif mesh.bodies[one].layer < 0:
        mesh.touched[one] = flight.time
    elif mesh.bodies[other].layer < 0:
        mesh.touched[other] = flight.time


@wp.func
def force_of(mesh: Any, block: Any, flight: Flight, push: Push, foot: Foot, velocity: wp.vec3d):
    """Force of a face on a node behind it [N]: a spring of both stiffnesses in a row, damping and friction against the
    velocity of the node over its foot [m/s]."""
    lightness = wp.float64(read(mesh.inverse_mass, push.node))
    for k in range(4):
        lightness += foot.shares[k] * foot.shares[k] * wp.float64(read(mesh.inverse_mass, push.corners[k]))
    across = mesh.blocks[mesh.block[push.face // 6]]
    mine, other = wp.float64(block.stiffness), wp.float64(across.stiffness)
    stiffness = wp.min(mine * other / (mine + other), STABLE / (lightness * flight.step * flight.step))
    leaving = wp.dot(velocity, foot.normal)
    damped = DAMPING * wp.sqrt(stiffness / lightness) * leaving
    pressure = wp.where(foot.depth > ZERO, wp.max(stiffness * foot.depth - damped, ZERO), ZERO)
    sliding = velocity - leaving * foot.normal
    rub = mesh.bodies[across.body].friction * pressure / wp.max(wp.length(sliding), SLIP)
    return pressure * foot.normal - rub * sliding


@wp.func
def take(mesh: Any, push: Push, place: wp.int32, part: wp.int32, parts: wp.int32):
    """Keep a push at a place of the list of a part, if it has a force. Returns the number of pushes then.

    Data out: mesh.contacts.pushes.
    """
    count = place
    if wp.dot(push.force, push.force) > ZERO:
        contacts = mesh.contacts
        contacts.pushes[part * (contacts.pushes.shape[0] // parts) + place] = push
        count = place + 1
    return count


@wp.func
def add_force(mesh: Any, node: wp.int32, force: wp.vec3d):
    """Add to the contact of a node [N]."""
    put_vector(
        mesh.contact, mesh.size, node, vector_at(mesh.contact, mesh.size, node) + type(mesh.cylinder.centre)(force)
    )


@wp.func
def spread(mesh: Any, push: Push, part: wp.int32, parts: wp.int32):
    """Add the reaction on a face of a core to the nodes of a part, of those about the face. Loads of single nodes would
    drive hourglasses, which have no stiffness."""
    patch = patch_of(mesh, push.face)
    to_left = spline_shares(push.shares[1] + push.shares[2])
    to_right = spline_shares(push.shares[2] + push.shares[3])
    for i in range(4):
        for j in range(4):
            node = node_of(patch, i, j)
            if node % parts == part:
                add_force(mesh, node, -to_left[i] * to_right[j] * push.force)


@wp.func
def react(mesh: Any, part: wp.int32, parts: wp.int32):
    """Add the forces of all pushes, and their reactions, to the nodes that belong to a part.

    Data in: mesh.contacts.pushes. Data out: mesh.contact.
    """
    contacts = mesh.contacts
    room = contacts.pushes.shape[0] // parts
    for owner in range(parts):
        for place in range(contacts.pushing[owner]):
            push = contacts.pushes[owner * room + place]
            if push.node % parts == part:
                add_force(mesh, push.node, push.force)
            if is_of_core(mesh, push.face):
                spread(mesh, push, part, parts)
            else:
                for k in range(4):
                    if push.corners[k] % parts == part:
                        add_force(mesh, push.corners[k], -push.shares[k] * push.force)
