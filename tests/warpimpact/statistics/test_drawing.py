"""Draws of states: what stays, what turns along, and how often intervals hold."""

import numpy as np
import pytest

from warpimpact.continuum.front import law_errors
from warpimpact.statistics.drawing import draw_states

ERRORS = law_errors(of_catalogue=False, as_fired=False)
HITS = 40


def laws(seed=1):
    """Two laws that are alike at the hits of a map."""
    draw = np.random.default_rng(seed)
    law = np.column_stack([draw.uniform(0.7, 0.95, HITS), draw.normal(scale=0.15, size=(HITS, 6))])
    second = law + np.column_stack([draw.normal(scale=0.02, size=HITS), draw.normal(scale=0.03, size=(HITS, 6))])
    return law, second


def turned(numbers, angle):
    """States of hits that are turned about the line of fire."""
    turn = np.array([[np.cos(angle), np.sin(angle)], [-np.sin(angle), np.cos(angle)]])
    vectors = numbers[..., 1:].reshape(*numbers.shape[:-1], 3, 2) @ turn
    return np.concatenate([numbers[..., :1], vectors.reshape(*numbers.shape[:-1], 6)], axis=-1)


def draws(law, second, elements, at, **options):
    return draw_states(
        law, second, elements, np.array(at, dtype=int), **{"count": 64, "seed": 3, "error": ERRORS} | options
    )


STOPPED = np.array([0.0, *[np.nan] * 6])
NOTHING = np.empty((0, 7)), np.empty(0, dtype=int)


def test_a_seed_gives_the_same_draws_of_any_range_of_hits():
    law, second = laws()
    whole = draws(law, second, law[:5], range(5))
    assert np.array_equal(draws(law, second, law[:5], range(5)), whole)
    for first, last in ((0, 7), (3, 19), (30, HITS)):
        some = draws(law, second, law[:5], range(5), hits=slice(first, last))
        assert some == pytest.approx(whole[:, first:last], rel=1e-12)


def test_hits_by_elements_stay_as_they_are():
    law, second = laws()
    elements = second[[2, 7, 9, 11, 30]]
    drawn = draws(law, second, elements, [2, 7, 9, 11, 30])
    assert np.array_equal(drawn[:, [2, 7, 9, 11, 30]], np.tile(elements, (64, 1, 1)))


def test_a_core_that_elements_stop_is_stopped_in_each_draw():
    law, second = laws()
    drawn = draws(law, second, np.tile(STOPPED, (6, 1)), range(6), count=256)
    assert np.isfinite(drawn).all()
    assert np.all(drawn[:, :6, 0] <= 0.0)
    shares = (drawn[..., 0] > 0.0).mean(axis=1)
    assert np.quantile(shares, 0.025) < 0.05 < 0.2 < np.quantile(shares, 0.975)  # six of six exclude little


@pytest.mark.parametrize("known", [0, 8])
def test_a_hit_that_no_law_touches_is_untouched_in_each_draw(known):
    law, second = laws()
    law[20:] = second[20:] = [1.0] + [0.0] * 6
    drawn = draws(law, second, second[:known], range(known))
    assert np.array_equal(drawn[:, 20:], np.tile(law[20:], (64, 1, 1)))


@pytest.mark.parametrize("known", [0, 8])
def test_turned_hits_have_turned_draws(known):
    law, second = laws()
    elements = laws(2)[0][:known]
    drawn = draws(law, second, elements, range(known))
    other = draws(*(turned(numbers, 0.7) for numbers in (law, second, elements)), range(known))
    assert other == pytest.approx(turned(drawn, 0.7), abs=1e-6)


def test_one_law_alone_is_enough():
    law, _ = laws()
    assert draws(law, None, *NOTHING).shape == (64, HITS, 7)


def test_more_elements_leave_less_open():
    law, second = laws()
    spreads = [draws(law, second, second[:n], range(n))[:, 30:, 0].mean(axis=1).std() for n in (0, 5, 24)]
    assert spreads == sorted(spreads, reverse=True)


@pytest.mark.parametrize("known", [0, 6])
def test_intervals_hold_on_maps_like_those_that_were_learnt(known):
    """Each map is itself a draw without elements, so that the intervals hold in 95 % of the maps."""
    held = []
    for seed in range(60):
        law, second = laws(seed)
        truth = draws(law, second, *NOTHING, count=1, seed=1000 + seed)[0]
        elements = np.where(truth[:known, :1] > 0.0, truth[:known], STOPPED)
        drawn = draws(law, second, elements, range(known), count=128, seed=seed)
        for column in (0, 3, 6):
            low, high = np.quantile(drawn[..., column].mean(axis=1), [0.025, 0.975])
            held.append(low <= truth[:, column].mean() <= high)
    assert 0.90 <= np.mean(held) <= 0.99
