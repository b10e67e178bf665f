"""Numerics with every choice made."""

from typing import Any

import numpy as np
import pytest

from warpimpact.scene import (
    Impact,
    Numerics,
    Plate,
    PolynomialCore,
    Scene,
)
from warpimpact.solver import materials
from warpimpact.solver.materials import onset_jump
from warpimpact.solver.resolution import FASTEST_DECAY, FIDELITIES, NODAL, SLENDER, WEAKENING, decay_rate, resolve

PAPER = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, density=7850.0)
PLATE = Plate(thickness=4e-3, resistance=2.6e9, degradation_length=0.6e-3)
SCENE = Scene(core=PAPER, target=PLATE)


@pytest.mark.parametrize("name", FIDELITIES)
def test_fidelity_fills_in_what_is_not_given(name: str) -> None:
    fidelity = FIDELITIES[name]
    resolution = resolve(Numerics(fidelity=name), SCENE)
    assert not resolution.nodal
    assert resolution.time_step is None
    assert (resolution.patches_axial, resolution.patches_around) == (
        fidelity.patches_axial,
        fidelity.patches_around,
    )
    assert resolution.grid_spacing == pytest.approx(0.6e-3 / fidelity.cells_per_length)
    assert resolution.double is fidelity.double


@pytest.mark.parametrize("scheme", ["consistent", "nodal"])
@pytest.mark.parametrize(
    ("name", "value"),
    [("time_step", 3e-7), ("patches_axial", 10), ("patches_around", 20), ("grid_spacing", 0.1e-3)],
)
def test_single_setting_goes_before_fidelity_and_scheme(name: str, value: float, scheme: str) -> None:
    given: dict[str, Any] = {"scheme": scheme, "fidelity": "reference"}
    plain = resolve(Numerics(**given), SCENE)
    changed = resolve(Numerics(**given, **{name: value}), SCENE)
    assert getattr(changed, name) == value
    assert {k for k in vars(plain) if getattr(plain, k) != getattr(changed, k)} == {name}


@pytest.mark.parametrize(("precision", "double"), [("single", False), ("double", True)])
@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_precision_goes_before_fidelity(fidelity: str, precision: str, double: bool) -> None:
    assert resolve(Numerics(fidelity=fidelity, precision=precision), SCENE).double is double


@pytest.mark.parametrize("fidelity", FIDELITIES)
def test_nodal_scheme_has_the_paper_s_own_resolution(fidelity: str) -> None:
    resolution = resolve(Numerics(scheme="nodal", fidelity=fidelity), SCENE)
    assert resolution.nodal
    assert {name: getattr(resolution, name) for name in NODAL} == NODAL
    assert (resolution.patches_axial, resolution.patches_around) == (36, 36)
    assert (resolution.grid_spacing, resolution.time_step) == (1e-5, 1e-6)


def test_way_per_step_follows_the_plate_or_a_core_shorter_than_it() -> None:
    way = 800.0 * resolve(Numerics(), SCENE).step_at(800.0, 0.0, np.array([1e-3, 1.0]), np.inf)
    standard = FIDELITIES["standard"].travel
    np.testing.assert_allclose(way, [standard * 1e-3, standard * SLENDER * PAPER.length])


def test_step_is_bounded_by_what_contact_takes_off_the_resistance() -> None:
    resolution, velocity = resolve(Numerics(), SCENE), 800.0
    free = resolution.step_at(velocity, 0.0, PLATE.thickness, np.inf)
    for degradation, interval in ((1.0, 1e-6), (0.9, 1e-6), (0.05, 1e-6), (0.05, 1e-9), (0.0, 1e-6)):
        plate = PLATE.model_copy(update={"degradation": degradation, "degradation_interval": interval})
        step = resolution.step_of(Impact(velocity=velocity), plate)
        bound = np.inf if degradation == 1.0 else 0.0
        if 0.0 < degradation < 1.0:
            bound = WEAKENING * FIDELITIES["standard"].travel * interval / -np.log(degradation)
        assert step == pytest.approx(min(free, max(bound, 0.25 * free)))


def test_onset_is_a_share_of_what_a_wall_does_in_one_step() -> None:
    # One patch of wall, 2R × h, at full contact: a0·2R·h/m.
    mass = PAPER.mass_properties.mass
    wall = 2 * PAPER.max_radius * 4e-3
    longest = 2 * PAPER.max_radius * PAPER.length
    jumps = onset_jump(PAPER, np.array([4e-3, 1.0]), mass * np.array([1.0, 2.0]), np.array([2.6e9, 1e9]))
    share = materials.ONSET / mass
    np.testing.assert_allclose(jumps, [share * 2.6e9 * wall, share * 0.5e9 * longest])
    assert onset_jump(PAPER, 4e-3, mass, 0.0) > 0.0


def test_decay_rate_is_that_of_an_interval_of_contact() -> None:
    rates = decay_rate(np.array([0.8, 1.0, 0.0]), 2e-6)
    np.testing.assert_allclose(0.8, np.exp(rates[0] * 2e-6), rtol=1e-15)
    assert rates[1] == 0.0
    assert rates[2] == -FASTEST_DECAY
