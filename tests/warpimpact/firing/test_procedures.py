"""The velocities of single tests, by hand."""

from collections.abc import Sequence

import pytest

from warpimpact.firing.procedures import Langlie, MilStd662F, Neyer, Procedure, ThreePod, UpAndDown
from warpimpact.firing.steps import Estimated, Optimal, Shot, StepEstimate


def aims(procedure: Procedure, answers: Sequence[int]) -> list[float | Optimal]:
    """The velocities of a test whose shots answer so: 1 perforated."""
    steps = procedure.steps()
    found = [next(steps)]
    for answer in answers:
        last = found[-1]
        velocity = 800.0 if isinstance(last, Optimal | Estimated) else last
        try:
            found.append(steps.send(Shot(velocity, bool(answer))))
        except StopIteration:
            break
    return found


RANGE = {"lowest": 600.0, "highest": 1000.0}
NEYER, POD = Neyer(**RANGE, spread=20.0), ThreePod(**RANGE, spread=20.0)


@pytest.mark.parametrize(
    ("procedure", "answers", "velocities"),
    [
        (UpAndDown(start=800.0, step=20.0), [1, 1, 0, 0], [800, 780, 760, 780, 800]),
        # Langlie: alternate, then one more stop: back to the shot from which on both are equal in number, else an end
        (Langlie(**RANGE), [1, 0, 0, 1, 1], [800, 700, 750, 875, 812.5, 756.25]),
        (Langlie(**RANGE), [0, 0, 1], [800, 900, 950, 925]),
        # MIL-STD-662F: 30 m/s until there are both answers, then 15 m/s, until three and three lie within 27 m/s
        (MilStd662F(start=800.0), [1, 1, 0, 1, 0, 1, 0, 1], [800, 770, 740, 755, 740, 755, 740, 755]),
        # Neyer: outward by the most of three rules; halving; then D-optimal about the middle with a shrinking guess
        (NEYER, [0, 0, 1, 1], [800, 900, 1000, 950, 925]),
        (Neyer(**RANGE, spread=300.0), [1, 0, 1], [800, 200, 500, Optimal(350, 300)]),
        (Neyer(**RANGE, spread=10.0), [1, 1], [800, 700, 600]),
        # 3pod: quarters of the range; outward by 1.5 guesses; halving down to 1.5 guesses; 0.3 guesses outside
        (POD, [0, 1, 0, 1, 1, 1, 0, 0], [700, 900, 800, 850, 825, 794, 807, 787, Optimal()]),
        (POD, [0, 0, 0, 1], [700, 900, 1030, 1060, 1045]),
        (POD, [1, 0, 0], [700, 900, 540, 1060]),
        (ThreePod(**RANGE, spread=150.0), [0, 1, 0, 1], [700, 900, 655, 945, 800]),
    ],
)  # fmt: skip
def test_the_velocities_follow_the_published_rules(
    procedure: Procedure, answers: list[int], velocities: list[float | Optimal]
) -> None:
    found = aims(procedure, answers)
    assert len(found) == len(velocities)
    for one, expected in zip(found, velocities, strict=True):
        assert one == (expected if expected == Optimal() else pytest.approx(expected))


def test_the_third_phase_approaches_a_quantile() -> None:
    """Perforations pull down by more than stops push up, for a quantile of few perforations."""
    procedure = ThreePod(**RANGE, spread=20.0, shots=2, quantile_shots=3, quantile=0.1)
    steps = procedure.steps()
    next(steps)
    steps.send(Shot(700.0, False))
    assert steps.send(Shot(900.0, True)) == Estimated()
    begin = steps.send(StepEstimate(800.0, 20.0, (5.0, 0.0, 5.0)))
    assert begin == pytest.approx(800.0 - 1.2816 * 20.0, abs=0.01)
    lower = steps.send(Shot(begin, True))
    higher = steps.send(Shot(lower, False))
    assert begin - lower > 3.0 * (higher - lower) > 0.0
