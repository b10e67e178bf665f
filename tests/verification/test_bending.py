"""Cores as rigid beams: conditions that every bending moment must meet, and cores that break (docs/model.md §8)."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Core, Plate, Record, Scene, Shots, Target
from warpimpact.solver import prepare
from warpimpact.solver import simulate as simulation
from warpimpact.solver.fast_law import FastLaw
from warpimpact.solver.rings import Rings, Sections, sections_of

from .scenes import PAPER_CORE, layer, paper_plate, scattered_hits, shots_at, solid_plate

COUNT = 24


def bent(target: Plate | Target, shots: Shots, device: str = "cpu", **numerics: Any) -> Outcomes:
    scene = Scene(core=PAPER_CORE, target=target, record=Record(bending=True))
    return simulation.simulate(
        scene, shots, method=FastLaw(**{"level": 2, "precision": "double"} | numerics), device=device
    )


def slanted_shots() -> Shots:
    rng = np.random.default_rng(2)
    return shots_at(
        *scattered_hits(COUNT),
        obliquity=rng.uniform(0.0, 40.0, COUNT),
        azimuth=rng.uniform(0.0, 360.0, COUNT),
        yaw=rng.uniform(-10.0, 10.0, COUNT),
        spin=rng.uniform(-1e5, 1e5, COUNT),
    )


def test_no_moment_is_left_behind_the_base(monkeypatch: pytest.MonkeyPatch) -> None:
    """External and inertial loads balance over the whole core, spin and the damping of the contact included."""

    def last_alone(core: Core, rings: Rings) -> Sections:
        sections = sections_of(core, rings)
        stress = np.zeros_like(sections.stress)
        stress[-1] = 1.0  # [1/m³]: its "stress" is its moment
        return replace(sections, stress=stress)

    monkeypatch.setattr(prepare, "sections_of", last_alone)
    outcomes = bent(paper_plate(), slanted_shots(), level=0)
    assert outcomes.largest_bending_moment.min() > 1.0
    assert (outcomes.bending_stress < 1e-10 * outcomes.largest_bending_moment).all()


def test_a_straight_hit_bends_nothing(device: str) -> None:
    straight = bent(solid_plate(), shots_at(), device)
    across = bent(solid_plate(), shots_at(yaw=5.0), device)
    assert straight.largest_bending_moment[0] < 1e-8 * across.largest_bending_moment[0]


def test_parts_without_a_gap_bend_a_core_as_the_whole_does(device: str) -> None:
    # The moment at a section comes from the loads of all layers together.
    whole, numerics = solid_plate(thickness=6e-3, degradation=1.0), {"time_step": 1e-6, "precision": "single"}
    parts = [whole.model_copy(update={"thickness": share * whole.thickness}) for share in (0.2, 0.5, 0.3)]
    layers = tuple(layer(part) for part in parts[1:])
    shots = slanted_shots()
    expected = bent(whole, shots, device, **numerics)
    got = bent(Target(layers=(parts[0], *layers)), shots, device, **numerics)
    alone = bent(parts[0], shots, device, **numerics)
    for name in ("largest_bending_moment", "bending_stress"):
        np.testing.assert_allclose(getattr(got, name), getattr(expected, name), rtol=1e-3)
        assert np.median(getattr(alone, name)) < 0.9 * np.median(getattr(expected, name))


def broken(strength: float) -> Outcomes:
    core = PAPER_CORE.model_copy(update={"strength": strength})
    record = Record(standoffs=(0.05,), bending=True)
    shots = shots_at(*scattered_hits(48))
    return simulation.simulate(Scene(core=core, target=paper_plate(), record=record), shots, device="cpu")


def test_a_core_is_broken_where_its_stress_passes_its_strength() -> None:
    ended = broken(2.5e9)
    assert 0.1 < ended.broken.mean() < 0.9
    assert np.array_equal(ended.broken == 1.0, ended.bending_stress > 2.5e9)
    whole = ended.broken == 0.0
    for place in (ended.broken_time, ended.broken_x, ended.broken_section):
        assert np.array_equal(np.isnan(place), whole)
    time, x, section = (place[~whole] for place in (ended.broken_time, ended.broken_x, ended.broken_section))
    assert (section > 0.0).all()
    assert (section < PAPER_CORE.length).all()
    # The section lies in the core, whose nose has gone v t at most since it touched the front face.
    assert (x <= 825.0 * time - 0.9 * section).all()


def test_a_broken_core_goes_on_as_it_would_have() -> None:
    weak, strong = broken(1.0), broken(1e12)
    for name in ("status", "residual_velocity", "tilt", "bending_stress"):
        assert np.array_equal(getattr(weak, name), getattr(strong, name), equal_nan=True), name
