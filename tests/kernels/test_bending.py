"""The bending moment of a rigid rod struck across its axis, against the closed form."""

from typing import Any

import numpy as np
import pytest
import warp as wp

from warpimpact.kernels import bending, structs
from warpimpact.kernels.variant import Variant
from warpimpact.scene import ProfileCore
from warpimpact.solver.rings import rings_of, sections_of

from .probes import poisoned_touches, surface_of

VARIANT = Variant(double=True, bends=True)
use, struct = VARIANT.use(bending), structs.build(VARIANT)
LENGTH, RADIUS, MASS, RINGS = 0.1, 0.1e-3, 4e-3, 201
FORCE = 1000.0
ROD = ProfileCore(s=(0.0, LENGTH), r=(RADIUS, RADIUS), mass=MASS)
Body, Load, State, Change = struct.Body, struct.Load, struct.State, struct.Change
Surface, Pose = struct.Surface, struct.Pose
Footprint, Touches = struct.Footprint, struct.Touches
Sections, Bending = struct.Sections, struct.Bending
bent = use.bending.bent


@wp.kernel(enable_backward=False)
def bend(
    surface: Surface,
    sections: Sections,
    body: Body,
    touches: Touches,
    hit_ring: wp.int32,
    force: wp.float64,
    actual: wp.array(dtype=Bending),
):
    """One step under a force across the axis, along the body's y, on one ring."""
    load = Load()
    load.force = wp.vec3d(wp.float64(0.0), force, wp.float64(0.0))
    load.moment = wp.vec3d(wp.float64(0.0), wp.float64(0.0), surface.of_rings[hit_ring] * force)
    load.touching = True
    touches.total_area[hit_ring] = wp.float64(1.0)
    sums = touches.sums[hit_ring]
    sums.force = load.force
    sums.moment = load.moment
    touches.sums[hit_ring] = sums
    state = State()
    state.attitude = wp.quatd(wp.float64(0.0), wp.float64(0.0), wp.float64(0.0), wp.float64(1.0))
    state.velocity = wp.vec3d(wp.float64(0.0), wp.float64(-1.0e3), wp.float64(0.0))  # the force slows it down
    footprint = Footprint()
    footprint.first_ring = hit_ring
    footprint.last_ring = hit_ring
    context = struct.Context()
    context.surface = surface
    context.body = body
    context.touches = touches
    context.sections = sections
    clock = struct.Clock()
    clock.step = wp.float64(1.0e-9)
    actual[0] = bent(Bending(), context, footprint, Pose(), state, load, Change(), clock)


def hit_at(share: float, device: str) -> tuple[Any, float]:
    """The bending of a rod that is struck at about this share of its length behind the nose; and the exact place
    [m]."""
    rings = rings_of(ROD, RINGS, 8)
    surface = surface_of(Surface, ROD, RINGS, 8, device)
    behind = 0.5 * LENGTH - rings.station
    ring = int(np.argmin(np.abs(behind - share * LENGTH) + (rings.area_radial == 0.0)))  # no disc
    struct = Sections()
    for name, column in vars(sections_of(ROD, rings)).items():
        setattr(struct, name, wp.array(column, dtype=wp.float64, device=device))
    body, properties = Body(), ROD.mass_properties
    body.mass, body.inertia_axial = properties.mass, properties.inertia_axial
    body.inertia_transverse = properties.inertia_transverse
    touches = poisoned_touches(Touches, 1, surface, device)
    touches.sums.zero_()
    touches.ring_area.zero_()
    actual = wp.zeros(1, dtype=Bending, device=device)
    wp.launch(bend, 1, inputs=[surface, struct, body, touches, ring, FORCE], outputs=[actual], device=device)
    return actual.numpy()[0], float(behind[ring])


def moment_of(s: Any, at: float) -> Any:
    """Bending moment [N m] at s behind the nose of a thin uniform rod struck at `at`: with ξ = L/2 − s,

    M = P (s − at)₊ − P/L ∫₀ˢ (s − s') (1 + 12 ξ(at) ξ(s')/L²) ds'.
    """
    lever = 12.0 * (0.5 * LENGTH - at) / LENGTH**2
    inertia = s**2 / 2 + lever * (0.5 * LENGTH * s**2 / 2 - s**3 / 6)
    return FORCE * (np.maximum(s - at, 0.0) - inertia / LENGTH)


@pytest.mark.parametrize("share", [0.0, 0.35, 0.9])
def test_a_thin_rod_hit_across_bends_as_in_the_closed_form(share: float, device: str) -> None:
    actual, at = hit_at(share, device)
    s = sections_of(ROD, rings_of(ROD, RINGS, 8)).station
    expected = np.abs(moment_of(s, at))
    assert actual["moment"] == pytest.approx(expected.max(), rel=1e-4)  # it is not infinitely thin
    assert np.abs(moment_of(actual["moment_station"], at)) == pytest.approx(expected.max(), rel=1e-4)
    assert actual["stress"] == pytest.approx(4.0 * actual["moment"] / (np.pi * RADIUS**3), rel=1e-12)
    assert actual["stress_station"] == actual["moment_station"]
