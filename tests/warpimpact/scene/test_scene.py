"""Scenes: what they take, and what they refuse."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

import warpimpact
from warpimpact import (
    Campaign,
    Hits,
    Impact,
    Layer,
    Numerics,
    Plate,
    Record,
    Scene,
    make_shots,
    run,
    simulate,
)
from warpimpact.scene import PolynomialCore, Target

SLOTTED_PLATE = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"
CORE = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, mass=4e-3)
PLATE = Plate(thickness=4e-3, resistance=2.6e9)


@pytest.mark.parametrize(
    ("changes", "complaint"),
    [
        ({"plate": PLATE}, 'got the unknown key "plate"; allowed are core, target, interaction, record'),
        ({"record": {"standoffs": ["130 mm", "50 mm"]}}, "got 0.05 m after 0.13 m, but stand-offs must increase"),
        (
            {"record": {"standoffs": ["10 mm"]}},
            "got record.standoffs of 0.01 m, but a core of this size is certain to be out of the target only from 0.01",
        ),
        (
            {"core": CORE.model_copy(update={"centre_of_mass": 15e-3}), "record": {"bending": True}},
            "output.bending = true cannot be combined with core.centre_of_mass: it needs the mass of every slice",
        ),
    ],
)
def test_what_cannot_be_is_refused(changes: dict[str, Any], complaint: str) -> None:
    with pytest.raises(ValidationError) as caught:
        Scene(**{"core": CORE, "target": PLATE} | changes)
    assert complaint in str(caught.value)


def test_simulate_gives_what_a_campaign_of_the_same_scene_gives() -> None:
    assert warpimpact.simulate is simulate
    standoffs, numerics = (0.05, 0.13), Numerics(level=0)
    impact, hits = Impact(velocity=825.0, obliquity=12), Hits(count=4)
    campaign = Campaign(title="", core=CORE, plate=PLATE, impact=impact, hits=hits, numerics=numerics)
    scene = Scene(core=CORE, target=PLATE, record=Record(standoffs=standoffs))
    outcomes = simulate(scene, make_shots(impact, hits, PLATE), numerics=numerics, device="cpu")
    dataset = run(campaign, device="cpu")
    np.testing.assert_array_equal(np.degrees(outcomes.tilt).astype(np.float32), dataset["tilt"])
    np.testing.assert_array_equal(outcomes.residual_velocity, dataset["residual_velocity"])
    assert campaign.scene.core == CORE
    assert campaign.scene.target == scene.target
    assert campaign.scene.record.standoffs == standoffs
    bare = simulate(Scene(core=CORE, target=PLATE), make_shots(impact, hits, PLATE), numerics=numerics, device="cpu")
    assert bare.tilt.shape == (4, 0)


def test_the_plate_is_layer_0() -> None:
    behind = Layer(thickness="8 mm", resistance="1 GPa", gap="1 cm")
    target = Scene(core=CORE, target=(PLATE, PLATE, behind)).target
    assert target.gaps == (0.0, 0.0, 0.01)
    assert [place for place, _ in target.named] == ["plate", "layer 1", "layer 2"]
    with pytest.raises(ValueError, match=r"gap = 0.01 m .* of the first layer"):
        Target(layers=(behind,))
