"""A small march of rigid cores under any local law: what tests/validation/laws.py fits.

It has nothing but the law, friction and a narrow onset: no weakening, no layers. So a law takes some lines, and a hit a
few milliseconds.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact import Core

Array = NDArray[np.float64]
real = wp.float64
FAR = 0.02
"""Where no edge is nearer along the normal [m]."""
ONSET = 0.01
"""Onset of contact as a share of the speed."""
EDGE = 5e-5
"""Over which a hole's edge is blurred [m]."""


@wp.struct
class Near:
    """What is near a surface element. Lengths are in metres.

    Attributes:
        ahead: distance in the plane of the plate along the normal to the edge of a hole; 0 in a hole.
        gap: way back through a hole to material that the core has pushed into it; 0 in material, the radius or more
            where there is none.
        carried: length of material behind the element that the core has pushed ahead of it, at most the radius.
        radius: of the core there.
        thickness: of the plate.
        closing: speed of the element along its normal [m/s].
        attack: closing speed over the speed of the core: the sine of the angle of attack, if the core does not turn.
    """

    ahead: real
    gap: real
    carried: real
    radius: real
    thickness: real
    closing: real
    attack: real


@wp.func
def distance_at(tile: wp.array2d(dtype=real), cell: wp.vec2d, y: real, z: real):
    """Distance from the nearest edge at a point [m], negative in a hole; bilinear in a periodic tile."""
    across, along = y / cell[0], z / cell[1]
    row, column = wp.floor(across), wp.floor(along)
    b, c = across - row, along - column
    rows, columns = tile.shape[0], tile.shape[1]
    i, j = ((wp.int32(row) % rows) + rows) % rows, ((wp.int32(column) % columns) + columns) % columns
    k, m = (i + 1) % rows, (j + 1) % columns
    one = real(1.0)
    return (one - b) * ((one - c) * tile[i, j] + c * tile[i, m]) + b * ((one - c) * tile[k, j] + c * tile[k, m])


@wp.func
def way_through(
    tile: wp.array2d(dtype=real), cell: wp.vec2d, y: real, z: real, unit_y: real, unit_z: real, sign: real, most: real
):
    """Way from a point in a direction through material (sign 1) or through a hole (−1) [m], about `most` at most."""
    way, tries = real(0.0), int(0)
    left = sign * distance_at(tile, cell, y, z)
    while tries < 16 and way < most and left > real(1e-5):
        way += wp.max(left, real(2e-5))
        left = sign * distance_at(tile, cell, y + way * unit_y, z + way * unit_z)
        tries += 1
    return wp.min(way, most)


def built(law: Any, pushes: bool = False, lip: float = 0.0) -> Any:
    """The march under a law, a function of the parameters and of what is near.

    Args:
        pushes: material that the core has pushed into a hole presses on it, too; the law says how much.
        lip: how far the plate bulges behind its rear face, where its stress falls to nothing, in radii of the core.
    """

    bulging = real(lip)

    @wp.kernel(module="unique")
    def march(
        start: wp.array2d(dtype=real),
        hits: wp.array2d(dtype=real),
        rings: wp.array2d(dtype=real),
        around: wp.int32,
        tile: wp.array2d(dtype=real),
        cell: wp.vec2d,
        body: wp.array(dtype=real),
        parameters: wp.array(dtype=real),
        ends: wp.array2d(dtype=real),
    ):
        i = wp.tid()
        zero, half, one = real(0.0), real(0.5), real(1.0)
        mass, axial, transverse, thickness = body[0], body[1], body[2], body[3]
        place = wp.vec3d(start[i, 0], start[i, 1], start[i, 2])
        axis = wp.vec3d(start[i, 3], start[i, 4], start[i, 5])
        velocity = wp.vec3d(start[i, 6], start[i, 7], start[i, 8])
        momentum = wp.vec3d()
        first = wp.length(velocity)
        dt = body[4] / first
        sector = real(2.0 * math.pi) / real(around)
        status = int(-1)
        steps = int(0)
        drift = half * dt
        while status < 0 and steps < 4000:
            steps += 1
            place = place + drift * velocity
            size = wp.length(momentum)
            if size > real(1e-12):
                angle, about = size / transverse * drift, momentum / size
                along = wp.dot(about, axis) * about
                axis = wp.normalize(along + wp.cos(angle) * (axis - along) + wp.sin(angle) * wp.cross(about, axis))
            drift = dt
            aside = wp.where(wp.abs(axis[2]) < real(0.9), wp.vec3d(zero, zero, one), wp.vec3d(zero, one, zero))
            right = wp.normalize(wp.cross(axis, aside))
            up = wp.cross(axis, right)
            spin = momentum / transverse + (wp.dot(momentum, axis) * (one / axial - one / transverse)) * axis
            speed = wp.length(velocity)
            onset = wp.max(real(ONSET) * speed, body[6] * dt)
            force = wp.vec3d()
            moment = wp.vec3d()
            rear = real(1.0)
            front = real(-1.0)
            for k in range(rings.shape[0]):
                station, radius, length = rings[k, 0], rings[k, 1], rings[k, 5]
                middle = place[0] + station * axis[0]
                extent = radius * wp.sqrt(wp.max(zero, one - axis[0] * axis[0])) + length
                rear, front = wp.min(rear, middle - extent), wp.max(front, middle + extent)
                if middle + extent > zero and middle - extent < thickness + bulging * radius:
                    for j in range(around):
                        azimuth = (real(j) + half) * sector
                        outward = wp.cos(azimuth) * right + wp.sin(azimuth) * up
                        arm = station * axis + radius * outward
                        x = place + arm
                        normal = rings[k, 2] * axis + rings[k, 3] * outward
                        moving = velocity + wp.cross(spin, arm)
                        closing = wp.dot(moving, normal)
                        share = wp.clamp(closing / onset, zero, one)
                        share *= wp.clamp(half + half * x[0] / length, zero, one)
                        bulge = half * bulging * radius
                        share *= wp.clamp(half + half * (thickness + bulge - x[0]) / (length + bulge), zero, one)
                        y, z = x[1] + hits[i, 0], x[2] + hits[i, 1]
                        if share > zero:
                            near = Near()
                            if wp.static(pushes):
                                wide = wp.max(wp.sqrt(normal[1] * normal[1] + normal[2] * normal[2]), real(1e-6))
                                to_y, to_z = normal[1] / wide, normal[2] / wide
                                near.gap = way_through(tile, cell, y, z, -to_y, -to_z, -one, radius)
                                near.carried = way_through(
                                    tile,
                                    cell,
                                    y - (near.gap + real(2e-5)) * to_y,
                                    z - (near.gap + real(2e-5)) * to_z,
                                    -to_y,
                                    -to_z,
                                    one,
                                    radius - near.gap,
                                )
                                near.ahead = way_through(tile, cell, y, z, to_y, to_z, one, real(FAR))
                            else:
                                inside = distance_at(tile, cell, y, z)
                                share *= wp.clamp(inside / real(EDGE) + half, zero, one)
                            near.radius = radius
                            near.thickness = thickness
                            near.closing = closing
                            near.attack = closing / speed
                            sliding = moving - closing * normal
                            rubbing = parameters[0] / wp.max(wp.length(sliding), real(1e-5) * speed)
                            pressing = law(parameters, near) * share * rings[k, 4]
                            part = -pressing * (normal + rubbing * sliding)
                            force += part
                            moment += wp.cross(arm, part)
            if rear > thickness + bulging * body[5] and velocity[0] > zero:
                status = 0
            elif (front < zero and velocity[0] < zero) or speed < real(0.01) * first:
                status = 1
            velocity = velocity + dt / mass * force
            momentum = momentum + dt * moment
        ends[i, 0] = real(status)
        for m in range(3):
            ends[i, 1 + m] = place[m]
            ends[i, 4 + m] = axis[m]
            ends[i, 7 + m] = velocity[m]
            ends[i, 10 + m] = momentum[m]

    return march


def rings_of(core: Core, axial: int, around: int) -> Array:
    """Station ahead of the centre of mass and radius [m], normal along the axis and outwards, area of an element [m²],
    half its length [m]; shape [rings, 6]."""
    stations = np.linspace(0.0, core.length, 4001)
    widest = stations[core.radius(stations).argmax()]
    fore = max(1, round(axial * widest / core.length))
    behind = np.linspace(widest, core.length, max(1, axial - fore) + 1)[1:]
    edges = np.append(np.linspace(0.0, widest, fore + 1), behind)
    edges = edges[np.append(True, np.diff(edges) > 1e-9)]
    radii, middle, half = core.radius(edges), 0.5 * (edges[1:] + edges[:-1]), 0.5 * np.diff(edges)
    forward = 0.5 * np.diff(radii**2)
    outward = (radii[1:] + radii[:-1] + 4.0 * core.radius(middle)) / 6.0 * np.diff(edges)
    middle, radius = np.append(0.0, middle), np.append(2.0 / 3.0 * radii[0], core.radius(middle))
    forward, outward, half = np.append(0.5 * radii[0] ** 2, forward), np.append(0.0, outward), np.append(2e-5, half)
    kept = np.hypot(forward, outward) > 0.0
    area = np.hypot(forward, outward)[kept]
    columns = (core.mass_properties.centre_of_mass - middle[kept], radius[kept])
    normal = (forward[kept] / area, outward[kept] / area)
    return np.stack([*columns, *normal, 2.0 * np.pi / around * area, np.maximum(0.9 * half[kept], 2e-5)], axis=1)
