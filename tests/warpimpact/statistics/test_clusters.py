"""Means over clusters: their intervals contain the known answer as often as they say."""

import numpy as np
import pytest

from warpimpact.statistics.clusters import cluster_estimate, cluster_numbers

DRAWS, CLUSTERS, MEMBERS = 400, 40, 5


def clustered(rng: np.random.Generator) -> np.ndarray:
    """Values with mean 3 that share much within a cluster; more than half of them do not count."""
    values = 3.0 + rng.normal(size=(CLUSTERS, 1)) + 0.3 * rng.normal(size=(CLUSTERS, MEMBERS))
    return np.where(rng.random((CLUSTERS, MEMBERS)) < 0.4, values, np.nan)


def test_numbers_of_clusters_have_the_mean_of_all_values() -> None:
    values = clustered(np.random.default_rng(0))
    assert cluster_numbers(values).mean() == pytest.approx(np.nanmean(values), rel=1e-12)
    whole = np.arange(12.0).reshape(4, 3)
    np.testing.assert_allclose(cluster_numbers(whole), whole.mean(axis=1))
    assert np.isnan(cluster_numbers(np.full((4, 3), np.nan))).all()


def test_intervals_count_clusters() -> None:
    # 95 % of 400 is 380 ± 4.4; values taken as independent would hold far less often.
    rng = np.random.default_rng(1)
    draws = [clustered(rng) for _ in range(DRAWS)]
    found = [cluster_estimate(values) for values in draws]
    held = sum(one.low <= 3.0 <= one.high for one in found)
    assert 363 <= held <= 393
    naive = sum(abs(np.nanmean(x) - 3.0) < 1.96 * np.nanstd(x) / np.sqrt((~np.isnan(x)).sum()) for x in draws)
    assert naive < 345
    assert found[0].count == (~np.isnan(draws[0])).sum()


def test_shares_of_clusters() -> None:
    rng = np.random.default_rng(2)
    chances = rng.beta(2.0, 2.0, (DRAWS, CLUSTERS, 1))
    found = [cluster_estimate((rng.random((CLUSTERS, MEMBERS)) < some) * 1.0, binary=True) for some in chances]
    assert 363 <= sum(one.low <= 0.5 <= one.high for one in found) <= 395
    certain = cluster_estimate(np.ones((CLUSTERS, MEMBERS)), binary=True)
    assert certain.high == 1.0
    assert 0.85 < certain.low < 0.95  # Wilson's of 40 of 40, not of 200 of 200
