"""Summary numbers against values computed by hand."""

import numpy as np
import pytest

from warpimpact.analysis.estimates import estimated
from warpimpact.analysis.inspection import summary_text
from warpimpact.kernels.status import Status
from warpimpact.results.dataset import passed
from warpimpact.results.measures import Measure

MIXED = [Status.PERFORATED, Status.ARRESTED, Status.RICOCHETED, Status.UNTOUCHED, Status.UNFINISHED]


@pytest.fixture
def mixed(make_result):
    dataset = make_result(MIXED)
    dataset["residual_velocity"][:] = [700.0, 0.0, 300.0, 800.0, np.nan]
    dataset["deflection"][:] = [3.0, np.nan, 120.0, 1.0, np.nan]
    dataset["tilt"][:] = [[10.0, 40.0], [np.nan] * 2, [np.nan] * 2, [0.0, np.nan], [np.nan] * 2]
    return dataset


def test_a_failed_shot_is_no_broken_core(mixed):
    assert ", broken 2 (40.0%)\n" in summary_text(mixed.assign(broken=("hit", [1.0, 0.0, 1.0, 0.0, np.nan])))
    assert "broken" not in summary_text(mixed)


def test_passed_means_perforated_or_missed(mixed):
    assert passed(mixed).tolist() == [True, False, False, True, False]


@pytest.mark.parametrize(
    ("measure", "expected"),
    [
        ("mean(residual_velocity)", (2, 750.0, 50.0)),
        ("mean(deflection)", (2, 2.0, 1.0)),
        ("mean(tilt@50mm)", (2, 5.0, 5.0)),
        ("mean(tilt@130mm)", (1, 40.0, 0.0)),
    ],
)
def test_means_count_only_what_passed_the_plate_and_exists(mixed, measure, expected):
    (actual,) = estimated(mixed, [Measure.parse(measure).of(mixed)]).values()
    assert (actual.count, actual.value, actual.spread) == expected


def test_text_states_the_numbers_with_their_units(mixed):
    text = summary_text(mixed)
    for status in ("perforated", "arrested", "ricocheted", "untouched", "unfinished"):
        assert f"{status} 1 (20.0%)" in text
    lines = [line.split() for line in text.splitlines()]
    assert ["residual", "velocity,", "m/s", "750.00", "not", "determined", "50.00"] in lines  # of two cores
    assert "left window" not in text


def test_a_plate_that_stops_everything_has_no_residual_velocity(make_result):
    dataset = make_result([Status.ARRESTED] * 3)
    assert "No core passed." in summary_text(dataset)
    assert "nan" not in summary_text(dataset)
