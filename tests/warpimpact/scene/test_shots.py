"""Shots: where they hit, and that every shot depends on the seed and its own number only."""

import math
from pathlib import Path

import numpy as np
import pytest
from pydantic import ValidationError

from warpimpact.scene import CirclePattern, Hits, Impact, Plate, make_shots
from warpimpact.scene.quantities import LISTED, QUANTITIES
from warpimpact.scene.units import quantity

PERIOD = (16e-3, 8e-3)
CELL = Plate(thickness="4 mm", resistance=1e9, pattern=CirclePattern(diameter="5 mm", spacing=PERIOD))
SOLID = Plate(thickness="4 mm", resistance=1e9)


def _points(**hits: object) -> np.ndarray:
    shots = make_shots(Impact(velocity=825), Hits(**hits), CELL)
    return np.column_stack([shots.hit_y, shots.hit_z])


@pytest.mark.parametrize("sampling", ["sobol", "random", "grid"])
def test_hits_fill_the_cell_around_the_origin(sampling: str) -> None:
    points = _points(sampling=sampling, count=8192, seed=1) / PERIOD
    assert ((points >= -0.5) & (points < 0.5)).all()
    in_quarters = np.histogram2d(*points.T, bins=2, range=[[-0.5, 0.5]] * 2)[0]
    # Independent draws: 2048 ± 39; the others are even by construction.
    assert in_quarters == pytest.approx(2048, abs=160 if sampling == "random" else 0)


@pytest.mark.parametrize(("count", "shape"), [(2, (2, 1)), (128, (16, 8)), (130, (16, 8)), (1, (1, 1))])
def test_a_grid_has_nearly_square_cells(count: int, shape: tuple[int, int]) -> None:
    points = _points(sampling="grid", count=count)
    y, z = np.unique(points[:, 0]), np.unique(points[:, 1])
    assert (len(y), len(z)) == shape
    assert len(points) == len(y) * len(z)
    assert y == pytest.approx(-y[::-1], abs=1e-18)
    assert y[0] == pytest.approx(PERIOD[0] * (0.5 / shape[0] - 0.5), rel=1e-14)


def test_a_list_may_have_every_quantity_of_a_shot(tmp_path: Path) -> None:
    names = [name for name in LISTED if name not in ("hit_y", "hit_z")]
    (tmp_path / "hits.csv").write_text(f"hit_y,hit_z,{','.join(names)}\n-0.1,3.5e-3{',0.5' * len(names)}\n")
    shots = make_shots(Impact(velocity=825), Hits(sampling="list", file=tmp_path / "hits.csv"), CELL)
    assert (shots.hit_y.item(), shots.hit_z.item()) == (-0.1, 3.5e-3)
    for name in names:
        in_degrees = quantity(QUANTITIES[name].type).unit == "rad"
        assert shots.columns[name].item() == (math.radians(0.5) if in_degrees else 0.5), name


@pytest.mark.parametrize(
    ("hits", "complaint"),
    [
        ({}, 'sampling = "sobol" needs count'),
        ({"sampling": "list"}, 'sampling = "list" needs file'),
        ({"sampling": "list", "file": __file__, "count": 3}, "count and sampling"),
        ({"sampling": "grid", "count": 3, "replicates": 8}, "replicates and sampling"),
        ({"count": 3, "file": __file__}, "the header must be any of hit_y, hit_z, velocity"),
        ({"sampling": "sobel", "count": 3}, "'sobol', 'grid', 'random' or 'list'"),
    ],
)
def test_incomplete_or_contradictory_hits_are_refused(hits: dict[str, object], complaint: str) -> None:
    with pytest.raises(ValidationError, match=complaint):
        Hits(**hits)


@pytest.mark.parametrize(
    ("field", "value", "allowed"),
    [
        ("obliquity", 90, "at least 0 and less than 90 deg"),
        ("obliquity", -0.1, "at least 0 and less than 90 deg"),
        ("yaw", "-1.6 rad", "greater than -90 and less than 90 deg"),
    ],
)
def test_an_impossible_impact_is_refused_with_angles_in_degrees(field: str, value: object, allowed: str) -> None:
    with pytest.raises(ValidationError, match=f"{field}\n  Input should be {allowed}"):
        Impact(**{"velocity": 825, field: value})
