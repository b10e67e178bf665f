"""Stand-offs behind each layer of a target: those of the chain of single plates, as far as flight is free."""

from typing import Any

import numpy as np
import pytest

from warpimpact.scene import Numerics, Record, Scene, Shots, Target
from warpimpact.solver import simulate as simulation

from .scenes import PAPER_CORE, layer, paper_plate, scattered_hits, shots_at, simulate, solid_plate
from .test_layers import TURNED

NEAR, FAR = 0.04, 0.07  # [m]
GAP = 0.1  # [m]
BASE = solid_plate(thickness=3e-3, degradation=1.0)
Y, Z = scattered_hits(24)


def behind_layers(target: Target, shots: Shots, point: str = "centre_of_mass", **numerics: Any) -> Any:
    record = Record(standoffs=(NEAR, FAR), layer_standoffs=(NEAR, FAR), standoff_point=point)
    scene = Scene(core=PAPER_CORE, target=target, record=record)
    device = numerics.pop("device", "cpu")
    return simulation.simulate(scene, shots, numerics=Numerics(**{"level": 2} | numerics), device=device)


def alone(plate: Any, shots: Shots, point: str, device: str) -> Any:
    scene = Scene(core=PAPER_CORE, target=plate, record=Record(standoffs=(NEAR, FAR), standoff_point=point))
    return simulation.simulate(scene, shots, numerics=Numerics(time_step=1e-6), device=device)


@pytest.mark.parametrize("point", ["centre_of_mass", "nose"])
def test_behind_the_first_layer_they_are_those_of_the_plate_alone(point: str, device: str) -> None:
    target = Target(layers=(paper_plate(), layer(BASE, gap=GAP + 0.05)))
    shots = shots_at(Y, Z, **TURNED)
    got = behind_layers(target, shots, point, device=device, time_step=1e-6)
    expected = alone(paper_plate(), shots, point, device)
    assert np.degrees(got.tilt[:, 0] - got.layer_standoff_tilt[:, 0, 0]).max() > 1.0  # the base turns the cores
    assert np.degrees(got.layer_deflection[:, 0]) == pytest.approx(np.degrees(expected.deflection), abs=1e-3)
    for name in ("tilt", "pitch", "yaw"):
        values = getattr(got, f"layer_standoff_{name}")[:, 0]
        assert np.degrees(values) == pytest.approx(np.degrees(getattr(expected, name)), abs=2e-3), name


@pytest.mark.parametrize("point", ["centre_of_mass", "nose"])
def test_behind_the_last_layer_they_are_those_of_the_target(point: str, device: str) -> None:
    target = Target(layers=(paper_plate(), layer(BASE, gap=GAP + 0.05)))
    got = behind_layers(target, shots_at(Y, Z, **TURNED), point, device=device)
    assert np.degrees(got.layer_deflection[:, 1]) == pytest.approx(np.degrees(got.deflection), abs=1e-3)
    for name in ("tilt", "pitch", "yaw"):
        values = getattr(got, f"layer_standoff_{name}")[:, 1]
        assert np.degrees(values) == pytest.approx(np.degrees(getattr(got, name)), abs=2e-3), name


def test_there_is_no_value_where_free_flight_ends_or_a_core_does_not_get_there(device: str) -> None:
    hard = layer(solid_plate(thickness=60e-3, resistance=8e9, degradation=1.0), gap=GAP)
    target = Target(layers=(paper_plate(), layer(paper_plate(), gap=0.06), hard))
    got = behind_layers(target, shots_at(Y[:4], Z[:4]), device=device)
    known = ~np.isnan(got.layer_standoff_tilt)
    # 18 mm of core and a stand-off of 70 mm need 88 mm, more than the first gap has; no core leaves the last layer.
    assert known[:, 0].tolist() == [[True, False]] * 4
    assert known[:, 1].all()
    assert not known[:, 2].any()
    assert np.isnan(got.layer_deflection[:, 2]).all()


def test_stand_offs_behind_layers_change_no_bit_of_anything_else(device: str) -> None:
    target = Target(layers=(paper_plate(), layer(BASE, gap=GAP)))
    shots = shots_at(Y, Z, **TURNED)
    plain = simulate(target, shots, standoffs=(NEAR, FAR), device=device)
    asked = behind_layers(target, shots, device=device)
    for name, values in vars(plain).items():
        if not name.startswith("layer_standoff"):
            np.testing.assert_array_equal(getattr(asked, name), values, err_msg=name)


@pytest.mark.parametrize(
    ("standoff", "gap", "message"),
    [
        (0.01, 0.1, "certain to be out of the target only from 0.018"),
        (0.09, 0.1, "got record.layer_standoffs of 0.09 m, but the widest gap is 0.1 m, and free flight is certain to"),
        (0.02, 0.03, r"and gaps of at most 0.03 m, but a core of this size is certain .* at least 0.036"),
    ],
)
def test_stand_offs_without_free_flight_are_refused(standoff: float, gap: float, message: str) -> None:
    target = Target(layers=(paper_plate(), layer(BASE, gap=gap)))
    with pytest.raises(ValueError, match=message):
        Scene(core=PAPER_CORE, target=target, record=Record(layer_standoffs=(standoff,)))
