"""The consistent law (docs/model.md §4) in Numba, written for speed: the peer of the CPU kernels.

It uses float32 and fast-math. Hits run in parallel; each thread has its own window of the plate. Rings outside the slab
are skipped. Terms that do not depend on the ring are computed once per azimuth and step. A list of the patches in
contact passes data from the first pass to the second. The march allocates no memory. It covers only what the benchmark
needs: a plate without rim that weakens through its thickness, stress Y, β < 1. Contact sets in over the law's share of
the core's speed; the slope of this ramp enters the step by the trapezoid rule.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from bench import Array, launch_state, tilt_behind
from numba import get_num_threads, get_thread_id, njit, prange, set_num_threads
from numpy.typing import NDArray

from warpimpact.scene import Core, Interaction, Plate, Shots

PERFORATED, ARRESTED, RICOCHETED, UNFINISHED, LEFT_WINDOW = 0, 1, 2, 4, 5  # warpimpact's codes
RAMP = 0.02  # narrowest onset of contact that a step bears, in units of what a full wall does to the core in one step

f4 = np.float32
ZERO, HALF, ONE, TWO = f4(0.0), f4(0.5), f4(1.0), f4(2.0)
LANES = 272  # azimuths at most: rows of a constant length are what lets LLVM see that they do not overlap
AT_REST = f4(1.0e-5)  # of the speed: a wall that slides along itself does not touch
STILL = f4(1.0e-4)  # of the impact energy: at rest


@dataclass(frozen=True)
class Setting:
    """Resolution: rings × azimuths, grid cells per degradation length, time step [s]."""

    axial: int
    around: int
    cells: float
    step: float

    def __str__(self) -> str:
        return f"{self.axial}×{self.around}, ℓ/{self.cells:g}, {self.step * 1e6:g} µs"


SETTINGS = (
    Setting(16, 32, 1.5, 1.8e-6),
    Setting(24, 48, 2.0, 1.8e-6),
    Setting(32, 48, 2.0, 1.8e-6),
    Setting(32, 48, 2.0, 1.2e-6),
    Setting(32, 64, 3.0, 1.2e-6),
    Setting(40, 64, 3.0, 0.8e-6),
    Setting(40, 80, 4.0, 1.2e-6),
    Setting(64, 128, 5.0, 0.8e-6),
    Setting(64, 128, 5.0, 0.5e-6),
)
"""Settings near the best ones of 23 that were measured on three scenes, coarse to fine."""


class Peer:
    """A scene at one resolution, ready to march."""

    def __init__(self, core: Core, plate: Plate, interaction: Interaction, setting: Setting) -> None:
        assert setting.around <= LANES
        self.core, self.plate, self.setting = core, plate, setting
        self.rings = rings_of(core, setting.axial, setting.around).astype(f4)
        azimuth = (np.arange(setting.around) + 0.5) * (2.0 * np.pi / setting.around)
        self.circle = np.stack([np.cos(azimuth), np.sin(azimuth)]).astype(f4)
        self.tile, self.cell = tile_of(plate, plate.degradation_length / setting.cells)
        self.taps = [tent(plate.degradation_length, width).astype(f4) for width in self.cell]
        body = core.mass_properties
        wall = 2.0 * core.max_radius * min(plate.thickness, core.length)
        self.numbers = np.array(
            [
                body.mass,
                body.inertia_axial,
                body.inertia_transverse,
                plate.thickness,
                plate.resistance,
                plate.shear_coefficient,
                math.log(plate.degradation) / plate.degradation_interval,
                interaction.onset,
                RAMP * plate.resistance * wall * setting.step / body.mass,
                setting.step,
            ],
            dtype=f4,
        )

    def __call__(self, shots: Shots, standoff: float, threads: int) -> tuple[NDArray[np.int64], Array, Array]:
        """Status, residual velocity [m/s] and tilt [rad] at a stand-off [m], each of shape [shots]."""
        set_num_threads(threads)
        flight, axis, position = launch_state(self.core, shots)
        out = np.empty((len(shots), 13), dtype=f4)
        start = np.concatenate([position, axis, shots.velocity[:, None] * flight, shots.spin[:, None]], axis=1)
        hits = np.stack([shots.hit_y, shots.hit_z], axis=1)
        which, half = np.arange(len(shots)), self._half_window(shots)
        while len(which):
            cells = [2 * (math.ceil(half / width) + 4) for width in self.cell]
            out[which] = march(
                hits[which],
                start[which].astype(f4),
                self.rings,
                self.circle,
                self.tile,
                np.array(self.cell),
                self.taps[0],
                self.taps[1],
                self.numbers,
                cells[0],
                cells[1],
            )
            which, half = np.flatnonzero(out[:, 0] == LEFT_WINDOW), 2.0 * half
        status, ended = out[:, 0].astype(int), out[:, 1:].astype(float)
        state = (ended[:, 0:3], ended[:, 3:6], ended[:, 6:9], ended[:, 9:12])
        tilt = tilt_behind(self.core, self.plate.thickness, standoff, flight, state)
        return status, np.linalg.norm(state[2], axis=1), tilt

    def _half_window(self, shots: Shots) -> float:
        """Half the width of the part of the plate that a core reaches if it keeps its attitude [m]."""
        core, plate, steepest = self.core, self.plate, float(shots.obliquity.max())
        turned = float(np.sin(np.hypot(shots.pitch, shots.yaw).max()))
        across = 1.3 * core.max_radius / math.cos(steepest) + plate.thickness * math.tan(steepest)
        return across + core.bounding_radius * turned + 2.0 * plate.degradation_length


def rings_of(core: Core, axial: int, around: int) -> Array:
    """Rings of patches, nose to base, with the discs at both ends: station ahead of the centre of mass and radius [m],
    area of a patch [m²], its normal along the axis and outwards, half extents along the axis, outwards and around [m].

    The widest section is an edge, so that no ring faces both ways.
    """
    s = np.linspace(0.0, core.length, 20001)
    widest = s[core.radius(s).argmax()]
    fore = min(max(1, round(axial * widest / core.length)), axial - 1)
    edges = np.append(np.linspace(0.0, widest, fore + 1), np.linspace(widest, core.length, axial - fore + 1)[1:])
    edges = edges[np.append(True, np.diff(edges) > 0.0)]
    nose, base = core.radius(np.array([0.0, core.length]))
    width = core.length / axial
    parts = [
        _rings(core, 0.0, np.linspace(0.0, nose, math.ceil(nose / width) + 1)),
        _rings(core, edges, core.radius(edges)),
        _rings(core, core.length, np.linspace(base, 0.0, math.ceil(base / width) + 1)),
    ]
    station, radius, axial, lateral, half_s, half_r = np.concatenate(parts, axis=1)
    sector = 2.0 * np.pi / around
    axial, lateral = sector * axial, 2.0 * math.sin(0.5 * sector) * lateral
    area = np.hypot(axial, lateral)
    ahead = core.mass_properties.centre_of_mass - station
    columns = [ahead, radius, area, axial / area, lateral / area, half_s, half_r, 0.5 * sector * radius]
    return np.stack(columns, axis=1)


def _rings(core: Core, s: Array | float, r: Array) -> Array:
    """Between consecutive (s, r): station, radius, ∫ r dr, ∫ r ds, half of ds and dr."""
    s = np.broadcast_to(s, r.shape)
    middle = 0.5 * (s[1:] + s[:-1])
    mean = 0.5 * (r[1:] + r[:-1])
    radius = np.where(np.diff(s) > 0.0, core.radius(middle), mean)
    lateral = (r[1:] + r[:-1] + 4.0 * radius) / 6.0 * np.diff(s)  # Simpson
    return np.stack([middle, radius, 0.5 * np.diff(r**2), lateral, 0.5 * np.diff(s), 0.5 * np.diff(r)])


def tile_of(plate: Plate, spacing: float) -> tuple[NDArray[np.float32], tuple[float, float]]:
    """One period of the plate as area fractions of material, shape [cells_y, cells_z], and the cells' widths [m]."""
    period = plate.pattern.period
    count = [math.ceil(extent / spacing - 1e-9) for extent in period]
    fine = 12
    y, z = ((np.arange(n * fine) + 0.5) * extent / (n * fine) for n, extent in zip(count, period, strict=True))
    solid = ~plate.pattern.is_hole(y[:, None], z)
    share = solid.reshape(count[0], fine, count[1], fine).mean(axis=(1, 3))
    return share.astype(f4), (period[0] / count[0], period[1] / count[1])


def tent(length: float, width: float) -> Array:
    """The tent K at the nodes of a grid; its half-width is rounded to a multiple of the cell."""
    reach = max(1, round(length / width))
    weights = 1.0 - np.abs(np.arange(1 - reach, reach)) / reach
    return weights / weights.sum()


@njit(parallel=True, fastmath=True, error_model="numpy")
def march(hits, start, rings, circle, tile, cell, taps_y, taps_z, numbers, cells_y, cells_z):
    """March every hit; rows of status, position, axis, velocity, angular momentum."""
    out = np.empty((len(hits), 13), dtype=f4)
    threads = get_num_threads()
    fields = np.zeros((threads, 4, cells_y * cells_z), dtype=f4)
    patches = np.empty((threads, 4, rings.shape[0] * circle.shape[1]), dtype=f4)
    places = np.empty((threads, 3, rings.shape[0] * circle.shape[1]), dtype=np.int32)
    damping = np.empty((threads, 6, 7))
    for k in prange(len(hits)):
        own = get_thread_id()
        march_one(
            hits[k],
            start[k],
            rings,
            circle,
            tile,
            cell,
            taps_y,
            taps_z,
            numbers,
            cells_y,
            cells_z,
            fields[own],
            patches[own],
            places[own],
            damping[own],
            out[k],
        )
    return out


@njit(fastmath=True, error_model="numpy")
def lay_window(hit, tile, cell, cells_y, cells_z, fields):
    """Material around a hit, no exposure; returns the centre of the window's cell (0, 0) relative to the hit [m]."""
    first_y = math.floor(hit[0] / cell[0]) - cells_y // 2
    first_z = math.floor(hit[1] / cell[1]) - cells_z // 2
    tile_y, tile_z = tile.shape
    for i in range(cells_y):
        row = (first_y + i) % tile_y
        column = first_z % tile_z
        for j in range(cells_z):
            fields[0, i * cells_z + j] = tile[row, column]
            column += 1
            if column == tile_z:
                column = 0
    fields[1:] = ZERO
    return f4((first_y + 0.5) * cell[0] - hit[0]), f4((first_z + 0.5) * cell[1] - hit[1])


@njit(fastmath=True, error_model="numpy", inline="always")
def bilinear(field, index, stride, y, z):
    low = field[index] + z * (field[index + 1] - field[index])
    high = field[index + stride] + z * (field[index + stride + 1] - field[index + stride])
    return low + y * (high - low)


@njit(fastmath=True, error_model="numpy")
def spread(fields, stride, box, taps_y, taps_z):
    """Filter the gain with the tent and add half of it to the exposure. The box holds the cells with a gain."""
    exposure, gain, work = fields[1], fields[2], fields[3]
    low_y, high_y, low_z, high_z = box
    reach_y, reach_z = len(taps_y) // 2, len(taps_z) // 2
    left = low_z - reach_z
    width = high_z + reach_z + 1 - left
    for i in range(low_y, high_y + 1):
        row = work[i * stride + left : i * stride + left + width]
        row[:] = ZERO
        for k in range(-reach_z, reach_z + 1):
            weight = taps_z[k + reach_z]
            source = gain[i * stride + left + k : i * stride + left + k + width]
            for j in range(width):
                row[j] += weight * source[j]
    for i in range(low_y - reach_y, high_y + reach_y + 1):
        row = gain[i * stride + left : i * stride + left + width]
        row[:] = ZERO
        for k in range(max(low_y, i - reach_y), min(high_y, i + reach_y) + 1):
            weight = taps_y[k - i + reach_y]
            source = work[k * stride + left : k * stride + left + width]
            for j in range(width):
                row[j] += weight * source[j]
        into = exposure[i * stride + left : i * stride + left + width]
        for j in range(width):
            into[j] += HALF * row[j]


@njit(fastmath=True, error_model="numpy")
def settle(fields, stride, box, reach_y, reach_z):
    """Add the other half, and clear the gain."""
    low_y, high_y, low_z, high_z = box
    for i in range(low_y - reach_y, high_y + reach_y + 1):
        start, end = i * stride + low_z - reach_z, i * stride + high_z + reach_z + 1
        into, row = fields[1, start:end], fields[2, start:end]
        for j in range(len(row)):
            into[j] += HALF * row[j]
            row[j] = ZERO


@njit(error_model="numpy")
def solve(system):
    """Solve a symmetric positive definite 6 × 6 system in place, right-hand side in the last column."""
    for i in range(6):
        for j in range(i):
            factor = system[i, j] / system[j, j]
            for k in range(j, 7):
                system[i, k] -= factor * system[j, k]
    for i in range(5, -1, -1):
        for k in range(i + 1, 6):
            system[i, 6] -= system[i, k] * system[k, 6]
        system[i, 6] /= system[i, i]


@njit(fastmath=True, error_model="numpy", inline="always")
def turn(qx, qy, qz, qw, vx, vy, vz, dt):
    """The quaternion turned by dt × (vx, vy, vz) from the left."""
    angle = dt * math.sqrt(vx * vx + vy * vy + vz * vz)
    s = HALF * dt
    if angle > f4(1e-4):
        s = dt * math.sin(HALF * angle) / angle
    c = math.cos(HALF * angle)
    x, y, z = s * vx, s * vy, s * vz
    return (
        c * qx + qw * x + y * qz - z * qy,
        c * qy + qw * y + z * qx - x * qz,
        c * qz + qw * z + x * qy - y * qx,
        c * qw - x * qx - y * qy - z * qz,
    )


@njit(fastmath=True, error_model="numpy")
def march_one(
    hit,
    start,
    rings,
    circle,
    tile,
    cell,
    taps_y,
    taps_z,
    numbers,
    cells_y,
    cells_z,
    fields,
    patches,
    places,
    system,
    out,
):
    """March one hit: kicks at mid-step, exact drifts between them."""
    mass, inertia_a, inertia_t = numbers[0], numbers[1], numbers[2]
    thickness, resistance, friction, decay, onset_share, ramp, dt = numbers[3:10]
    y0, z0 = lay_window(hit, tile, cell, cells_y, cells_z, fields)
    material, exposure, gain = fields[0], fields[1], fields[2]
    per_y, per_z = f4(1.0 / cell[0]), f4(1.0 / cell[1])
    per_cell = dt * per_y * per_z
    count, around = rings.shape[0], circle.shape[1]
    reach_y, reach_z = len(taps_y) // 2, len(taps_z) // 2
    lanes = np.empty((13, LANES), dtype=f4)
    ox, oy, oz, turning, sideways = lanes[0], lanes[1], lanes[2], lanes[3], lanes[4]
    wx, wy, wz = lanes[5], lanes[6], lanes[7]
    closing, touching, at_y, at_z, pressed = lanes[8], lanes[9], lanes[10], lanes[11], lanes[12]
    weight_y, weight_z, areas, onsets = patches
    cells, azimuth_of, begins = places
    half_dt, stride = HALF * dt, np.int32(cells_z)

    px, py, pz = start[0], start[1], start[2]
    # The shortest turn from the plate normal to the axis.
    qx, qy, qz, qw = ZERO, -start[5], start[4], ONE + start[3]
    size = ONE / math.sqrt(qy * qy + qz * qz + qw * qw)
    qy, qz, qw = size * qy, size * qz, size * qw
    vx, vy, vz = start[6], start[7], start[8]
    lx, ly, lz = inertia_a * start[9] * start[3], inertia_a * start[9] * start[4], inertia_a * start[9] * start[5]
    speed2 = vx * vx + vy * vy + vz * vz
    slowest2 = STILL * speed2
    steps = int(200.0 * (float(thickness) + 0.1) / (math.sqrt(speed2) * dt)) + 1

    drift = HALF * dt  # to the first mid-step
    status, touched = UNFINISHED, False
    for _ in range(steps):
        # Torque-free drift: the axis precesses about L at |L|/I_t and the body rolls about the axis.
        px, py, pz = px + drift * vx, py + drift * vy, pz + drift * vz
        ax, ay, az = ONE - TWO * (qy * qy + qz * qz), TWO * (qx * qy + qw * qz), TWO * (qx * qz - qw * qy)
        own = (lx * ax + ly * ay + lz * az) * (ONE / inertia_a - ONE / inertia_t)
        qx, qy, qz, qw = turn(qx, qy, qz, qw, own * ax, own * ay, own * az, drift)
        qx, qy, qz, qw = turn(qx, qy, qz, qw, lx / inertia_t, ly / inertia_t, lz / inertia_t, drift)
        size = ONE / math.sqrt(qx * qx + qy * qy + qz * qz + qw * qw)
        qx, qy, qz, qw = size * qx, size * qy, size * qz, size * qw
        drift = dt
        ax, ay, az = ONE - TWO * (qy * qy + qz * qz), TWO * (qx * qy + qw * qz), TWO * (qx * qz - qw * qy)
        bx, by, bz = TWO * (qx * qy - qw * qz), ONE - TWO * (qx * qx + qz * qz), TWO * (qy * qz + qw * qx)
        cx, cy, cz = TWO * (qx * qz + qw * qy), TWO * (qy * qz - qw * qx), ONE - TWO * (qx * qx + qy * qy)
        own = (lx * ax + ly * ay + lz * az) * (ONE / inertia_a - ONE / inertia_t)
        wx0, wy0, wz0 = lx / inertia_t + own * ax, ly / inertia_t + own * ay, lz / inertia_t + own * az
        # ω × axis: how the sections move relative to the centre of mass, per station
        tx, ty, tz = wy0 * az - wz0 * ay, wz0 * ax - wx0 * az, wx0 * ay - wy0 * ax
        speed2 = vx * vx + vy * vy + vz * vz
        speed = math.sqrt(speed2)
        rest = AT_REST * speed
        # Contact sets in over a share of the core's speed (the law), or over what the step bears.
        onset = max(onset_share * speed, ramp)
        forward = ax * vx + ay * vy + az * vz
        broadside = math.sqrt(max(ZERO, ONE - ax * ax))
        across_y, across_z = math.sqrt(max(ZERO, ONE - ay * ay)), math.sqrt(max(ZERO, ONE - az * az))
        spin = math.sqrt(wx0 * wx0 + wy0 * wy0 + wz0 * wz0)

        rear, front = thickness + ONE, -ONE
        first, last = count, -1
        for k in range(count):
            middle = px + rings[k, 0] * ax
            reach = (rings[k, 1] + abs(rings[k, 6]) + rings[k, 7]) * broadside + rings[k, 5] * abs(ax)
            reach += half_dt * (abs(vx + rings[k, 0] * tx) + rings[k, 1] * spin)
            rear, front = min(rear, middle - reach), max(front, middle + reach)
            if middle + reach > ZERO and middle - reach < thickness:
                first, last = min(first, k), k
        if rear > thickness and vx > ZERO:
            status = PERFORATED
            break
        if front < ZERO and vx < ZERO:
            status = RICOCHETED
            break
        if touched and speed2 + inertia_t / mass * spin * spin < slowest2:
            status = ARRESTED
            break
        if last < 0:
            continue

        for j in range(around):
            ox[j] = circle[0, j] * bx + circle[1, j] * cx
            oy[j] = circle[0, j] * by + circle[1, j] * cy
            oz[j] = circle[0, j] * bz + circle[1, j] * cz
            sideways[j] = ox[j] * vx + oy[j] * vy + oz[j] * vz
            turning[j] = ox[j] * tx + oy[j] * ty + oz[j] * tz
            wx[j] = wy0 * oz[j] - wz0 * oy[j]
            wy[j] = wz0 * ox[j] - wx0 * oz[j]
            wz[j] = wx0 * oy[j] - wy0 * ox[j]

        # First pass: which patches touch, and what they tell the plate. The loop over the azimuths vectorises.
        active = 0
        low_y, high_y, low_z, high_z = np.int32(cells_y), np.int32(0), stride, np.int32(0)
        for k in range(first, last + 1):
            station, radius, area, na, no = rings[k, 0], rings[k, 1], rings[k, 2], rings[k, 3], rings[k, 4]
            lever = no * station - na * radius
            middle_x, middle_y, middle_z = px + station * ax, py + station * ay - y0, pz + station * az - z0
            along, out_extent, around_extent = rings[k, 5] * ax, rings[k, 6], rings[k, 7]
            velocity_x = vx + station * tx
            for j in range(around):
                closing[j] = na * forward + no * sideways[j] + lever * turning[j] - rest
                x = middle_x + radius * ox[j]
                meridian = out_extent * ox[j] - along
                across = around_extent * (ay * oz[j] - az * oy[j])
                motion = half_dt * (velocity_x + radius * wx[j])
                # A box with the variance of patch and motion together stands for their convolution.
                extent = math.sqrt(meridian * meridian + across * across + motion * motion) + f4(1e-9)
                inside = max(ZERO, min(x + extent, thickness) - max(x - extent, ZERO))
                touching[j] = inside / (TWO * extent) * min(ONE, max(ZERO, closing[j] / onset))
                y = (middle_y + radius * oy[j]) * per_y
                z = (middle_z + radius * oz[j]) * per_z
                at_y[j], at_z[j] = y, z
            begins[k] = active
            spread_y, spread_z = radius * across_y * per_y, radius * across_z * per_z
            middle_y, middle_z = middle_y * per_y, middle_z * per_z
            if (
                middle_y - spread_y < f4(reach_y + 2)
                or middle_z - spread_z < f4(reach_z + 2)
                or middle_y + spread_y > f4(cells_y - reach_y - 4)
                or middle_z + spread_z > f4(cells_z - reach_z - 4)
            ):
                status = LEFT_WINDOW
                break
            for j in range(around):
                if touching[j] > ZERO:
                    row, column = np.int32(at_y[j]), np.int32(at_z[j])
                    index, y, z = row * stride + column, at_y[j] - f4(row), at_z[j] - f4(column)
                    touched_area = area * touching[j] * bilinear(material, index, cells_z, y, z)
                    upper = touched_area * per_cell * abs(na * ax + no * ox[j]) * y
                    lower = touched_area * per_cell * abs(na * ax + no * ox[j]) * (ONE - y)
                    gain[index] += lower * (ONE - z)
                    gain[index + 1] += lower * z
                    gain[index + cells_z] += upper * (ONE - z)
                    gain[index + cells_z + 1] += upper * z
                    cells[active], azimuth_of[active] = index, j
                    weight_y[active], weight_z[active] = y, z
                    areas[active], onsets[active] = touched_area, closing[j] / onset
                    if touched_area > ZERO:
                        active += 1
                        low_y, high_y = min(low_y, row), max(high_y, row)
                        low_z, high_z = min(low_z, column), max(high_z, column)
        if status == LEFT_WINDOW:
            break
        if active == 0:
            continue
        box = (int(low_y), int(high_y) + 1, int(low_z), int(high_z) + 1)
        begins[last + 1] = active
        touched = True
        spread(fields, cells_z, box, taps_y, taps_z)

        # Second pass: the load on the plate as it is at mid-step.
        fx, fy, fz, mx, my, mz = ZERO, ZERO, ZERO, ZERO, ZERO, ZERO
        damped = False
        for k in range(first, last + 1):
            if begins[k] == begins[k + 1]:
                continue
            station, radius, na, no = rings[k, 0], rings[k, 1], rings[k, 3], rings[k, 4]
            pressed[:] = ZERO
            for n in range(begins[k], begins[k + 1]):
                j = azimuth_of[n]
                exposed = bilinear(exposure, cells[n], cells_z, weight_y[n], weight_z[n])
                pressed[j] = resistance * areas[n] * math.exp(decay * exposed)
                if onsets[n] < ONE:
                    if not damped:
                        system[:] = 0.0
                        damped = True
                    nx, ny, nz = na * ax + no * ox[j], na * ay + no * oy[j], na * az + no * oz[j]
                    rx, ry, rz = (
                        station * ax + radius * ox[j],
                        station * ay + radius * oy[j],
                        station * az + radius * oz[j],
                    )
                    slope = half_dt * pressed[j] / (onsets[n] * onset)
                    push = (nx, ny, nz, ry * nz - rz * ny, rz * nx - rx * nz, rx * ny - ry * nx)
                    for i in range(6):
                        for m in range(i + 1):
                            system[i, m] += slope * push[i] * push[m]
            sum_x, sum_y, sum_z, turn_x, turn_y, turn_z = ZERO, ZERO, ZERO, ZERO, ZERO, ZERO
            base_x, base_y, base_z = vx + station * tx, vy + station * ty, vz + station * tz
            lever = no * station - na * radius
            for j in range(around):
                nx, ny, nz = na * ax + no * ox[j], na * ay + no * oy[j], na * az + no * oz[j]
                normal = na * forward + no * sideways[j] + lever * turning[j]
                sx = base_x + radius * wx[j] - normal * nx
                sy = base_y + radius * wy[j] - normal * ny
                sz = base_z + radius * wz[j] - normal * nz
                sliding = friction / math.sqrt(sx * sx + sy * sy + sz * sz + rest * rest)
                gx, gy, gz = (
                    pressed[j] * (nx + sliding * sx),
                    pressed[j] * (ny + sliding * sy),
                    pressed[j] * (nz + sliding * sz),
                )
                sum_x, sum_y, sum_z = sum_x + gx, sum_y + gy, sum_z + gz
                turn_x += oy[j] * gz - oz[j] * gy
                turn_y += oz[j] * gx - ox[j] * gz
                turn_z += ox[j] * gy - oy[j] * gx
            fx, fy, fz = fx - sum_x, fy - sum_y, fz - sum_z
            mx -= station * (ay * sum_z - az * sum_y) + radius * turn_x
            my -= station * (az * sum_x - ax * sum_z) + radius * turn_y
            mz -= station * (ax * sum_y - ay * sum_x) + radius * turn_z
        if damped:
            # (M + ½ dt D) Δu = dt F: the trapezoid rule for walls within the onset of contact.
            for i in range(3):
                system[i, i] += mass
                system[i + 3, i + 3] += inertia_t
            axis = (ax, ay, az)
            for i in range(3):
                for m in range(3):
                    system[i + 3, m + 3] += (inertia_a - inertia_t) * axis[i] * axis[m]
            right = (fx, fy, fz, mx, my, mz)
            for i in range(6):
                system[i, 6] = dt * right[i]
            for i in range(6):
                for m in range(i):
                    system[m, i] = system[i, m]
            solve(system)
            vx, vy, vz = vx + f4(system[0, 6]), vy + f4(system[1, 6]), vz + f4(system[2, 6])
            dx, dy, dz = f4(system[3, 6]), f4(system[4, 6]), f4(system[5, 6])
            own = (inertia_a - inertia_t) * (dx * ax + dy * ay + dz * az)
            lx, ly, lz = lx + inertia_t * dx + own * ax, ly + inertia_t * dy + own * ay, lz + inertia_t * dz + own * az
        else:
            vx, vy, vz = vx + dt / mass * fx, vy + dt / mass * fy, vz + dt / mass * fz
            lx, ly, lz = lx + dt * mx, ly + dt * my, lz + dt * mz
        settle(fields, cells_z, box, reach_y, reach_z)

    out[0] = status
    out[1], out[2], out[3] = px, py, pz
    out[4], out[5], out[6] = ax, ay, az
    out[7], out[8], out[9] = vx, vy, vz
    out[10], out[11], out[12] = lx, ly, lz
