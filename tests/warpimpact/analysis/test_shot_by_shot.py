"""Two results of the same shots, hit by hit."""

import numpy as np
import pytest
import xarray

from warpimpact.analysis.comparison import shared_hits, shot_by_shot
from warpimpact.analysis.numbers import text_of
from warpimpact.kernels.status import Status
from warpimpact.results import attributes as attr


def result(hits: list[int], velocity: list[float], status: list[int], attributes: dict[str, str]) -> xarray.Dataset:
    count = len(hits)
    along = 1e-3 * np.array(hits, dtype=float)
    return xarray.Dataset(
        {
            "status": ("hit", np.array(status, dtype=np.int8)),
            "residual_velocity": ("hit", np.array(velocity)),
            "deflection": ("hit", np.zeros(count)),
            "tilt": (("hit", "standoff"), np.array(velocity)[:, None] / 10.0),
        },
        {"hit": hits, "hit_y": ("hit", along), "hit_z": ("hit", along), "standoff": [0.05]},
        attributes,
    )


def test_bias_rms_ranks_and_the_worst_hits_are_those_of_the_shared_sound_hits() -> None:
    fast = result([0, 1, 2, 3, 4], [700.0, 710.0, 720.0, 730.0, 740.0], [0] * 5, {})
    slow = result(
        [1, 2, 3, 4], [700.0, 724.0, 726.0, np.nan], [0, 0, 0, int(Status.HOURGLASSED)], {attr.CONTINUUM: "{}"}
    )
    shared = shared_hits({"slow": slow, "fast": fast})
    assert shared is not None
    view = shot_by_shot(shared)
    row = view["shot by shot"][1].loc["residual velocity, m/s"]
    difference = np.array([10.0, -4.0, 4.0])
    numbers = (3, difference.mean(), np.sqrt((difference**2).mean()), 1.0)
    assert [float(row[name]) for name in ("hits", "bias", "rms", "rank correlation")] == pytest.approx(
        numbers, abs=5e-3
    )
    assert row["largest differences at hits"].startswith("1 (+10)")
    assert "1 of them failed" in text_of(view)
    assert "tilt at 50 mm" in text_of(view)
    assert "contradict" not in text_of(view)


def test_results_by_the_same_law_or_of_other_hits_are_not_compared_so() -> None:
    fast, moved = result([0, 1], [700.0, 710.0], [0, 0], {}), result([0, 1], [1.0, 2.0], [0, 0], {attr.CONTINUUM: "{}"})
    moved = moved.assign_coords(hit_y=moved["hit_y"] + 1e-3)
    assert shared_hits({"a": fast, "b": fast}) is None
    assert shared_hits({"a": fast, "b": moved}) is None


def test_models_that_contradict_each_other_are_not_compared_in_numbers() -> None:
    """Two cores arrested by one model pass at 523 and 574 m/s by the other, and one passes by both."""
    fast = result([4, 7, 9], [0.0, 0.0, 600.0], [int(Status.ARRESTED)] * 2 + [0], {})
    slow = result([4, 7, 9], [523.0, 574.0, 605.0], [0, 0, 0], {attr.CONTINUUM: "{}"})
    shared = shared_hits({"fast": fast, "slow": slow})
    assert shared is not None
    view = shot_by_shot(shared)
    text = text_of(view)
    assert "fast and slow end differently at hits 4, 7\n" in text
    assert (
        "The models contradict each other here: of 3 hits, 1 pass by fast and 3 pass by slow. Believe neither" in text
    )
    assert view["shot by shot"][-1].loc["residual velocity, m/s", "bias"] == "-5"
