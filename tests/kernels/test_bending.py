"""The bending moment of a rigid rod struck across its axis, against the closed form: by rings, and by impulses."""

from typing import Any

import numpy as np
import pytest
import warp as wp
from scipy.spatial.transform import Rotation

from warpimpact.continuum.meshing import BodyMesh
from warpimpact.continuum.one_hit import OneHit, Start
from warpimpact.kernels import bending, structs
from warpimpact.kernels.continuum.bending import add_impulse
from warpimpact.kernels.continuum.bending import bent as bent_by_impulses
from warpimpact.kernels.continuum.fields import Core, Flight
from warpimpact.kernels.variant import Variant
from warpimpact.scene import ProfileCore
from warpimpact.scene.flow import Flow
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


SPAN = 1.0e-6


@wp.kernel(enable_backward=False)
def push(
    core: Core,
    flights: wp.array(dtype=Flight),
    places: wp.array(dtype=wp.vec3d),
    forces: wp.array(dtype=wp.vec3d),
    actual: wp.array(dtype=Bending),
):
    """A window of forces at places relative to the centre of mass."""
    flight = flights[0]
    axis = wp.quat_rotate(flight.state.attitude, wp.vec3d(wp.float64(1.0), wp.float64(0.0), wp.float64(0.0)))
    flight.time = wp.float64(SPAN)
    for k in range(places.shape[0]):
        add_impulse(core, 0, axis, places[k], wp.float64(SPAN) * forces[k])
    actual[0] = bent_by_impulses(core, flight)


def pushed(places: Any, forces: Any, turn: Rotation, spin: float = 0.0, base_alone: bool = False) -> Any:
    """The bending of a rod by forces at places of its own frame, as it lies in the plate frame; its strength is
    10 TPa.

    Args:
        spin: its angular momentum about its axis [N m s].
        base_alone: whether only the moment behind its base counts as a stress, of 1/m³.
    """
    element = BodyMesh.of_layer(
        *np.meshgrid([-1.0, 1.0], [-1.0, 1.0], indexing="ij"), np.ones((1, 1), bool), np.arange(2.0), 1.0
    )
    body = ROD.mass_properties
    start = Start(np.zeros(3), turn.as_quat(), np.ones(3), turn.apply([spin, 0.0, 0.0]), body, 0.0, 1.0e13)
    hit = OneHit(ROD, start, [element], [Flow(yield_stress=1e9, fracture_work=1e9)], double=True)
    if base_alone:
        hit.core.sections.stress.numpy()[:] = [*[0.0] * (hit.core.sections.stress.size - 1), 1.0]
    at, of = (wp.array(turn.apply(values), dtype=wp.vec3d, device="cpu") for values in (places, forces))
    actual = wp.zeros(1, dtype=Bending, device="cpu")
    wp.launch(push, 1, inputs=[hit.core, hit.flights, at, of], outputs=[actual], device="cpu")
    assert not hit.core.impulses.numpy().any()
    return actual.numpy()[0]


@pytest.mark.parametrize("turned", [0.0, 70.0])
@pytest.mark.parametrize("share", [0.0, 0.35, 0.9])
def test_impulses_on_a_rod_bend_it_as_in_the_closed_form(share: float, turned: float) -> None:
    """In any direction of the rod; it breaks where the stress is above its strength."""
    turn = Rotation.from_rotvec(np.radians(turned) * np.array([0.6, 0.0, 0.8]))
    actual = pushed([[(0.5 - share) * LENGTH, 0.0, 0.0]], [[0.0, FORCE, 0.0]], turn)
    s = LENGTH * np.arange(1, 65) / 64
    expected = np.abs(moment_of(s, share * LENGTH))
    assert actual["moment"] == pytest.approx(expected.max(), rel=1e-4)
    assert actual["moment_station"] == pytest.approx(s[expected.argmax()])
    assert actual["stress"] == pytest.approx(4.0 * actual["moment"] / (np.pi * RADIUS**3), rel=1e-12)
    assert actual["broken"] == (actual["stress"] > 1.0e13)
    if actual["broken"]:
        ahead = turn.apply([0.5 * LENGTH - actual["stress_station"], 0.0, 0.0])
        assert actual["broken_x"] == pytest.approx(ahead[0])


def test_impulses_leave_no_moment_behind_the_base() -> None:
    """Contact and inertia balance over the whole core, off its axis and with spin, too."""
    rng = np.random.default_rng(1)
    places = np.column_stack([rng.uniform(-0.5, 0.5, 20) * LENGTH, *rng.uniform(-RADIUS, RADIUS, (2, 20))])
    turn = Rotation.from_rotvec([0.3, -0.5, 0.2])
    actual = pushed(places, rng.normal(size=(20, 3)) * FORCE, turn, spin=1e-4, base_alone=True)
    assert actual["stress"] < 1e-9 * actual["moment"]
