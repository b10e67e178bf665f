"""References of a target: the solid add-on of its weight before the same base, and the base alone."""

from pathlib import Path

import pytest

from warpimpact import Campaign, Plate
from warpimpact.campaign.references import at_base_alone, solid_target

ADD_ON = Campaign.from_toml(Path(__file__).parents[3] / "campaigns" / "addon.toml")


def test_the_solid_add_on_weighs_as_much_and_has_the_resistance_of_its_thickness() -> None:
    add_on, base = solid_target(ADD_ON).layers
    assert base == ADD_ON.target.layers[1]
    assert add_on.open_area == 0.0
    assert add_on.areal_density == pytest.approx(ADD_ON.plate.areal_density)
    named = Plate(material="HHA Class 1", thickness=add_on.thickness, threat=".30 AP M2", obliquity="30 deg")
    assert add_on.resistance == pytest.approx(named.resistance)
    assert abs(add_on.resistance / ADD_ON.plate.resistance - 1.0) > 0.005  # not that of the perforated plate


def test_the_base_alone_is_the_last_layer() -> None:
    scene, shots = at_base_alone(ADD_ON, ADD_ON.sampler().shots(0, 4))
    (base,) = scene.target.layers
    assert (base.thickness, base.material) == (ADD_ON.target.layers[1].thickness, "AA5083-H131")
    assert len(shots) == 4
