"""Material near faces and edges that resists less (docs/model.md §4.9): closed form, similarity, symmetry, limits."""

import math
from typing import Any

import numpy as np
import pytest
from scipy.integrate import quad

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import (
    CirclePattern,
    Core,
    FreeSurface,
    Interaction,
    PolynomialCore,
    SlotPattern,
)

from . import references
from .scenes import REFERENCE, paper_plate, scattered_hits, shots_at, simulate, solid_plate

LAW = FreeSurface()
INERT = Interaction(free_surface=LAW, linear=0.3, quadratic=0.5)
PLATE = paper_plate(resistance=1.8e9, degradation=1.0)
Y, Z = scattered_hits(16)
ATTITUDE = {"obliquity": 20.0, "azimuth": 30.0, "pitch": 2.0, "yaw": -3.0}


def free(**changes: float) -> Interaction:
    return Interaction(free_surface=LAW.model_copy(update=changes))


def assert_same(got: Outcomes, expected: Outcomes) -> None:
    """In double precision, in which scenes differ by rounding only."""
    assert (got.status == expected.status).all()
    assert got.residual_velocity == pytest.approx(expected.residual_velocity, abs=1e-8)
    assert got.tilt == pytest.approx(expected.tilt, abs=1e-8)


@pytest.mark.parametrize("changes", [{}, {"reach": 0.5, "attack": 0.5}], ids=["default", "others"])
def test_a_solid_plate_takes_the_quadrature_of_its_stress(changes: dict[str, float], device: str) -> None:
    # m (v0² − v²)/2 = H 2π [∫₀^r(0) p r dr + ∫ share p r' r ds], p = Y (1 / (1 + r/λH) + c n_x),
    # share = min(1, n_x/κ), as far as r' > 0. Measured: within 0.005 m/s of some 120 m/s.
    law = free(**changes)
    plate = solid_plate(shear_coefficient=1e-9, degradation=1.0)
    surface, thickness = law.free_surface, plate.thickness
    assert surface is not None
    first, growth, bend = references.PAPER_COEFFICIENTS

    def stress(r: float, sine: float) -> float:
        deep = 1.0 / (1.0 + r / (surface.reach * thickness))
        return float(plate.resistance * (deep + surface.attack * sine))

    def per_station(s: float) -> float:
        r, slope = float(references.paper_radius(s)), growth + 2.0 * bend * s
        return references.share_of_contact(slope, law.onset) * stress(r, slope / math.hypot(1.0, slope)) * slope * r

    disc = quad(lambda r: stress(r, 1.0) * r, 0.0, first)[0]
    nose = quad(per_station, 0.0, -0.5 * growth / bend, epsrel=1e-10, limit=200)[0]
    work = thickness * 2.0 * np.pi * (disc + nose)
    expected = np.sqrt(825.0**2 - 2.0 * work / references.PAPER_MASS)
    outcomes = simulate(plate, shots_at(1e-4, 2e-4), interaction=law, **REFERENCE, device=device)
    assert outcomes.residual_velocity[0] == pytest.approx(expected, abs=0.02)


def test_all_lengths_twice_as_long_leave_velocities_and_angles(device: str) -> None:
    def outcomes(scale: float) -> Outcomes:
        first, growth, bend = references.PAPER_COEFFICIENTS
        core = PolynomialCore(
            coefficients=(scale * first, growth, bend / scale),
            length=scale * references.PAPER_LENGTH,
            mass=scale**3 * references.PAPER_MASS,
        )
        slots = SlotPattern(
            length=scale * 12e-3, width=scale * 4e-3, spacing=(scale * 8e-3, scale * 16e-3), staggered=True
        )
        plate = PLATE.model_copy(
            update={"thickness": scale * 4e-3, "pattern": slots, "degradation_length": scale * 0.5e-3}
        )
        return simulate(
            plate,
            shots_at(scale * Y, scale * Z, **ATTITUDE),
            core=core,
            interaction=INERT,
            standoffs=(scale * 0.05, scale * 0.13),
            precision="double",
            device=device,
        )

    assert_same(outcomes(2.0), outcomes(1.0))


def test_mirror_images_and_hits_shifted_by_a_lattice_vector_do_the_same(device: str) -> None:
    scene: dict[str, Any] = {"interaction": INERT, "precision": "double", "device": device}
    plain = simulate(PLATE, shots_at(Y, Z, **ATTITUDE), **scene)
    assert_same(simulate(PLATE, shots_at(Y + 8e-3, Z + 8e-3, **ATTITUDE), **scene), plain)
    mirrored = simulate(PLATE, shots_at(-Y, Z, **ATTITUDE | {"azimuth": 150.0, "yaw": 3.0}), **scene)
    assert_same(mirrored, plain)
    assert mirrored.yaw == pytest.approx(-plain.yaw, abs=1e-7)


def test_material_that_is_pushed_into_a_hole_still_presses(device: str) -> None:
    # Webs of 1 mm between holes of 7 mm. Without what is pushed, a patch beyond the web's edge is free.
    plate = PLATE.model_copy(update={"pattern": CirclePattern(diameter=7e-3, spacing=(8e-3, 8e-3))})
    shots = shots_at(4e-3, [0.0, 0.3e-3])
    pushed, bare = (
        simulate(plate, shots, interaction=free(carried=carried, gap=0.0), device=device).energy_loss
        for carried in (0.2, 0.0)
    )
    assert (pushed > 1.1 * bare).all()
    assert (bare > 1.0).all()


def test_a_disc_looks_outwards(device: str) -> None:
    # A blunt core that hits the middle of a web is not turned: half of its disc looks to either side.
    core: Core = PolynomialCore(coefficients=(2.5e-3, 0.02, 0.0), length=20e-3, mass=4e-3)
    plate = PLATE.model_copy(update={"pattern": CirclePattern(diameter=5e-3, spacing=(8e-3, 8e-3))})
    shots = shots_at([4e-3, 0.0], [0.0, 4e-3])
    inert = INERT.model_copy(update={"free_surface": LAW.model_copy(update={"attack": 0.0})})
    outcomes = simulate(plate, shots, core=core, interaction=inert, precision="double", device=device)
    assert (outcomes.energy_loss > 10.0).all()
    assert np.degrees(outcomes.tilt).max() < 1e-3  # measured: 3e-9, and 0.1 to 0.3 if it did not
