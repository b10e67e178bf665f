"""Plate and interaction: defaults, derived figures, bounds."""

import math

import numpy as np
import pytest
from pydantic import ValidationError

from warpimpact.scene import CirclePattern, Hits, Impact, Plate, SlotPattern, make_shots

STEEL = {"thickness": "4 mm", "resistance": "2600 MPa"}


def test_a_weight_gives_a_plate_its_thickness() -> None:
    holes = CirclePattern(diameter="5 mm", spacing="10 mm")
    plate = Plate(areal_density="25 kg/m^2", resistance=1e9, pattern=holes)
    assert plate.areal_density == pytest.approx(25.0, rel=1e-14)
    assert plate == Plate(thickness=plate.thickness, resistance=1e9, pattern=holes)
    assert Plate.model_validate_json(plate.model_dump_json()) == plate
    for given, complaint in (({"areal_density": 0}, "greater than 0"), (STEEL, "thickness cannot be combined with")):
        with pytest.raises(ValidationError, match=complaint):
            Plate(**{"areal_density": 25, "resistance": 1e9, **given})


SLOTS = SlotPattern(length="12 mm", width="4 mm", spacing=["8 mm", "16 mm"], staggered=True)
RIMMED = {"size": ["50 mm", "44 mm"]}


def test_a_rim_is_as_far_as_the_whole_holes_next_to_it() -> None:
    assert Plate(**STEEL, pattern=SLOTS, size=["43 mm", "40 mm"]).ligament == pytest.approx(3.5e-3, rel=1e-9)
    assert Plate(**STEEL, **RIMMED).ligament == math.inf


def test_the_rim_of_a_finite_plate_is_an_edge() -> None:
    y, z = np.array([[0.0, 24e-3, 26e-3, 28e-3], [0.0, 20e-3, 0.0, 26e-3]])
    solid = Plate(**STEEL, size=["50 mm", "44 mm"])
    assert solid.edge_distance(y, z) == pytest.approx([22e-3, 1e-3, -1e-3, -5e-3])
    holed = Plate(**STEEL, pattern=SLOTS, **RIMMED).edge_distance(y, z)
    assert holed == pytest.approx([-2e-3, -2e-3, -1e-3, -5e-3], abs=5e-6)  # of chords
    assert np.isnan(Plate(**STEEL).edge_distance(y, z)).all()


def test_hits_cover_the_cell_or_all_of_a_finite_plate() -> None:
    plate, impact = Plate(**STEEL, pattern=SLOTS, size=["48 mm", "32 mm"]), Impact(velocity=825)
    for area, extent in (("cell", (16e-3, 16e-3)), ("plate", (48e-3, 32e-3))):
        shots = make_shots(impact, Hits(count=4096, area=area), plate)
        assert (np.ptp(shots.hit_y), np.ptp(shots.hit_z)) == pytest.approx(extent, rel=2e-3)
    solid = plate.is_solid(shots.hit_y, shots.hit_z)
    assert solid.mean() == pytest.approx(1 - plate.open_area, abs=5e-3)
    with pytest.raises(ValueError, match=r'hits.area = "plate" needs size of the plate: only a'):
        make_shots(impact, Hits(count=4, area="plate"), Plate(**STEEL, pattern=SLOTS))
