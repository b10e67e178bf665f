"""Summary numbers against values computed by hand."""

import numpy as np
import pytest

from warpimpact.analysis.summary import promise_text, summary, summary_text
from warpimpact.kernels.status import Status
from warpimpact.results import attributes as attr
from warpimpact.results.dataset import passed
from warpimpact.scene import Numerics

MIXED = [Status.PERFORATED, Status.ARRESTED, Status.RICOCHETED, Status.MISSED, Status.UNFINISHED]


@pytest.fixture
def mixed(make_result):
    dataset = make_result(MIXED)
    dataset["residual_velocity"][:] = [700.0, 0.0, 300.0, 800.0, np.nan]
    dataset["deflection"][:] = [3.0, np.nan, 120.0, 1.0, np.nan]
    dataset["tilt"][:] = [[10.0, 40.0], [np.nan] * 2, [np.nan] * 2, [0.0, np.nan], [np.nan] * 2]
    return dataset


def test_counts_every_status(mixed):
    assert summary(mixed).counts == {
        "perforated": 1,
        "arrested": 1,
        "ricocheted": 1,
        "missed": 1,
        "unfinished": 1,
        "left_window": 0,
        "not_finite": 0,
        "gained_energy": 0,
        "unbalanced": 0,
        "hourglassed": 0,
    }


def test_a_failed_shot_is_no_broken_core(mixed):
    broken = mixed.assign(broken=("hit", [1.0, 0.0, 1.0, 0.0, np.nan]))
    assert summary(broken).broken == 2
    assert "broken" in summary_text(broken)


def test_passed_means_perforated_or_missed(mixed):
    assert passed(mixed).tolist() == [True, False, False, True, False]


def test_spreads_count_only_what_passed_the_plate(mixed):
    result = summary(mixed)
    velocity, deflection = result.residual_velocity, result.deflection
    assert (velocity.count, velocity.mean, velocity.standard_deviation) == (2, 750.0, 50.0)
    assert (deflection.count, deflection.mean, deflection.standard_deviation) == (2, 2.0, 1.0)


def test_tilt_is_summarised_for_each_standoff_over_what_exists(mixed):
    tilt = summary(mixed).tilt
    assert list(tilt) == [0.05, 0.13]
    assert (tilt[0.05].count, tilt[0.05].mean, tilt[0.05].standard_deviation) == (2, 5.0, 5.0)
    assert (tilt[0.13].count, tilt[0.13].mean, tilt[0.13].standard_deviation) == (1, 40.0, 0.0)


def test_text_states_the_numbers_with_their_units(mixed):
    lines = [line.split() for line in summary_text(mixed).splitlines()]
    assert ["perforated", "1", "20.0%"] in lines
    assert ["unfinished", "1", "20.0%"] in lines
    # Student's interval of 700 and 800: 750 ± 12.7062·50√2/√2.
    assert ["residual", "velocity", "750.00", "m/s", "114.69", "to", "1385.31", "50.0", "of", "2", "hits"] in lines
    assert ["tilt", "at", "130", "mm", "40.00", "°", "-", "0.0", "of", "1", "hits"] in lines  # of one core
    assert "left window" not in summary_text(mixed)


def test_a_plate_that_stops_everything_has_no_residual_velocity(make_result):
    dataset = make_result([Status.ARRESTED] * 3)
    velocity = summary(dataset).residual_velocity
    assert velocity.count == 0
    assert np.isnan(velocity.mean)
    assert "no core behind the plate" in summary_text(dataset)
    assert "nan" not in summary_text(dataset)


@pytest.mark.parametrize(
    ("kept", "reason", "found"),
    [(1, "max_count", "found"), (0, "half_width", "found"), (0, "numerics", "not exact enough")],
)
def test_the_level_of_a_stop_rule_is_told(make_result, kept, reason, found):
    told = {
        attr.STOP_REASON: reason,
        attr.NUMERICS_GIVEN: "{}",
        attr.RESOLUTION: Numerics(level=4).model_dump_json(),
        attr.PROMISE_KEPT: kept,
        attr.LEVEL_FOR: "mean(deflection)",
        attr.RESIDUAL_VELOCITY_ERROR: 0.5,
        attr.TILT_ERROR: 0.25,
    }
    text = promise_text(make_result(1).assign_attrs(told))
    assert text.startswith(f"level 4 {found} for mean(deflection); single hits may err by ")
