"""When a stop rule looks."""

from warpimpact.statistics.stopping import looks


def test_a_rule_looks_at_balanced_points_or_at_steps_of_a_quarter() -> None:
    assert list(looks("sobol", 20)) == [1, 2, 4, 8, 16, 20]
    assert list(looks("random", 20)) == [1, 2, 3, 4, 5, 7, 9, 12, 15, 19, 20]
    assert list(looks("random", 1)) == [1]
