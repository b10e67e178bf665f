"""Bursts: where their hits lie, and what each shot is drawn from."""

from typing import Any

import numpy as np
import pytest
from pydantic import ValidationError

from warpimpact.scene import Burst, BurstSampler, Hits, Impact, NoPattern, Plate, Sampler, Scatter

PLATE = Plate(thickness="4 mm", resistance="2600 MPa", pattern=NoPattern())
IMPACT = Impact(velocity=820.0, yaw=1.0)
SCATTER = Scatter(
    velocity={"distribution": "normal", "mean": 820.0, "std": 10.0},
    mass={"distribution": "uniform", "low": "4 g", "high": "5 g"},
    resistance={"distribution": "uniform", "low": 2e9, "high": 3e9},
)
SPACED = Burst(count=4, spacing={"distribution": "uniform", "low": "1 mm", "high": "5 mm"})


def sampler(burst: Burst = SPACED, scatter: Scatter | None = SCATTER, count: int = 512, **hits: Any) -> BurstSampler:
    hits = {"sampling": "sobol", "count": count, "seed": 3} | hits
    return BurstSampler(IMPACT, Hits(**hits), PLATE, burst, scatter=scatter, replicates=16)


def test_the_first_shots_are_those_of_a_campaign_without_bursts() -> None:
    hits = Hits(sampling="sobol", count=512, seed=3)
    alone = Sampler(IMPACT, hits, PLATE, SCATTER, 16).shots(0, 512)
    first = sampler().shots(0, 2048)[::4]
    for name, values in alone.columns.items():
        np.testing.assert_array_equal(first.columns[name], values, err_msg=name)


def test_a_plate_is_one_plate_and_every_shot_is_a_shot_of_its_own() -> None:
    shots = sampler().shots(0, 2048)
    assert shots.at_a_plate == 4
    resistance, velocity, mass = (getattr(shots, name).reshape(-1, 4) for name in ("resistance", "velocity", "mass"))
    assert (resistance == resistance[:, :1]).all()
    assert len(np.unique(resistance)) == 512
    for drawn, mean, std in ((velocity, 820.0, 10.0), (mass, 4.5e-3, 1e-3 / np.sqrt(12.0))):
        assert len(np.unique(drawn)) == 2048
        np.testing.assert_allclose(drawn.mean(axis=0), mean, atol=4.0 * std / np.sqrt(512))
        np.testing.assert_allclose(drawn.std(axis=0), std, rtol=0.12)
        correlation = np.corrcoef(drawn.T) - np.eye(4)
        assert abs(correlation).max() < 4.0 / np.sqrt(512)
    np.testing.assert_array_equal(shots.sample, np.repeat(np.arange(512), 4))


def test_hits_lie_at_the_spacing_from_the_one_before_in_any_direction() -> None:
    shots = sampler().shots(0, 2048)
    steps = np.diff(np.stack([shots.hit_y, shots.hit_z], axis=-1).reshape(512, 4, 2), axis=1)
    distance, angle = np.hypot(*steps.T), np.arctan2(*steps.T)
    assert distance.min() >= 1e-3
    assert distance.max() <= 5e-3
    assert distance.mean() == pytest.approx(3e-3, abs=4 * 4e-3 / np.sqrt(12 * 1536))
    assert abs(np.exp(1j * angle).mean()) < 4.0 / np.sqrt(1536)
    assert abs(np.corrcoef(distance)[0, 1]) < 4.0 / np.sqrt(512)


def test_hits_scatter_about_their_places() -> None:
    places = [["0 mm", "0 mm"], ["30 mm", "0 mm"], ["0 mm", "-40 mm"]]
    burst = Burst(offsets=places, scatter=["2 mm", "1 mm"])
    assert burst.count == 3
    assert burst.reach == pytest.approx(40e-3 + 6.12 * 2e-3, abs=1e-4)
    y, z = burst.places(3, 0, 4096)
    np.testing.assert_allclose(y.mean(axis=0), [0.0, 30e-3, 0.0], atol=1.3e-4)
    np.testing.assert_allclose(z.mean(axis=0), [0.0, 0.0, -40e-3], atol=7e-5)
    np.testing.assert_allclose(y.std(axis=0), 2e-3, rtol=0.05)
    np.testing.assert_allclose(z.std(axis=0), 1e-3, rtol=0.05)


def test_the_nearest_earlier_hit_is_that_of_the_same_plate() -> None:
    burst = Burst(offsets=[[0.0, 0.0], [3e-3, 4e-3], [0.0, 1e-3], [3e-3, 4e-3]])
    shots = sampler(burst).shots(0, 2048)
    expected = [np.nan, 5e-3, 1e-3, 0.0]
    np.testing.assert_allclose(shots.nearest_earlier_hit.reshape(-1, 4), [expected] * 512, atol=1e-15)


def test_a_grid_and_a_spacing_of_one_length() -> None:
    shots = sampler(Burst(count=2, spacing="5 mm"), None, sampling="grid", count=16).shots(0, 32)
    np.testing.assert_allclose(shots.nearest_earlier_hit[1::2], 5e-3)
    assert len(shots) == 32


@pytest.mark.parametrize(
    ("given", "sentence"),
    [
        ({"count": 3}, "needs spacing, offsets or scatter"),
        ({"count": 3, "spacing": "5 mm", "scatter": "1 mm"}, "burst.spacing cannot be combined with burst.scatter"),
        ({"count": 3, "offsets": [[0.0, 0.0], [1e-3, 0.0]]}, "got count = 3 and 2 offsets"),
        ({"count": 1, "scatter": "1 mm"}, "greater than or equal to 2"),
        ({"count": 3, "spacing": "-5 mm"}, "reaches -0.005, but it must be greater than or equal to 0"),
        ({"count": 3, "scater": "5 mm"}, 'did you mean "scatter"?'),
    ],
)
def test_a_burst_that_is_not_possible_says_why(given: dict[str, Any], sentence: str) -> None:
    with pytest.raises(ValidationError, match=sentence.replace("?", r"\?")):
        Burst(**given)


def test_images_are_refused() -> None:
    with pytest.raises(ValueError, match="have no images"):
        sampler(irreducible=True)
