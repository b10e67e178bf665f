"""Constants of the continuum from tensile tests, and strength factors from published limit velocities."""

import math

import pandas as pd
import pytest

from tests.benchmarks.continuum_strength import FRICTION, HELD, Hit, entries, factors, left_out
from tests.validation.limit_rows import published
from warpimpact.campaign.tables import FiniteElements
from warpimpact.catalogue.catalogue import FLOWS, flow_entry
from warpimpact.catalogue.tensile import ALUMINIUM, STEEL, Metal, flow_from_tensile_test
from warpimpact.kernels.status import Status


@pytest.mark.parametrize(
    ("density", "yield_stress", "strength", "metal"),
    [(7850.0, 1305e6, 1690e6, STEEL), (2660.0, 250e6, 310e6, ALUMINIUM)],
)
def test_true_stress_meets_its_slope_where_necking_begins(
    density: float, yield_stress: float, strength: float, metal: Metal
) -> None:
    flow = flow_from_tensile_test(density, yield_stress, strength)
    (gain, _), (rate, _), strain = flow.voce_stress, flow.voce_rate, metal.uniform_strain
    ultimate = strength * math.exp(strain)
    assert flow.yield_stress == yield_stress
    assert yield_stress - gain * math.expm1(-rate * strain) == pytest.approx(ultimate, rel=1e-9)
    assert gain * rate * math.exp(-rate * strain) == pytest.approx(ultimate, rel=1e-9)


def test_a_yield_above_the_true_ultimate_stress_leaves_no_hardening() -> None:
    assert flow_from_tensile_test(7850.0, 1800e6, 1690e6).voce_stress == (0.0, 0.0)


def test_constants_of_the_catalogue_follow_from_the_rule_and_the_stored_hits() -> None:
    assert {file: (FLOWS / file).read_text(encoding="utf-8") for file in entries()} == entries()
    rows = factors()
    for name, of_it in rows.groupby("material"):
        entry = flow_entry(str(name))
        assert entry.strength_factor == pytest.approx(of_it["factor"].prod() ** (1.0 / len(of_it)), rel=1e-4)
        assert entry.yield_stress == pytest.approx(
            1e6 * entry.strength_factor * of_it["plate_yield_MPa"].iloc[0], rel=1e-4
        )
        assert ("not usual" in entry.evidence) == (not 0.6 <= entry.strength_factor <= 1.8)


def test_a_row_left_out_is_predicted_by_the_others() -> None:
    rows = pd.DataFrame(
        {"factor": [1.0, 1.21, 1.0], "calibres": [1.0, 1.1, 2.0], "obliquity_deg": [0, 30, 30], "slope": 0.4}
    )
    errors = left_out(rows)
    assert errors["angle"].tolist() == pytest.approx([1.1**0.4 - 1, 1.1**-0.8 - 1, 0.0])
    assert errors["thickness"].iloc[2] == pytest.approx(1.1**0.4 - 1)


def test_elements_meet_a_published_limit_within_8_percent() -> None:
    """10.2 mm of HHA Class 1 at 30°, .50 AP M2, 695 m/s, at the factor of the material."""
    row, factor = 447, flow_entry("HHA Class 1").strength_factor
    limit = float(published().velocity[row])
    ends = [Status(int(Hit(row, share * limit, factor).march()["status"])) for share in (0.92, 1.08)]
    assert ends[0] in HELD
    assert ends[1] is Status.PERFORATED


def test_friction_is_that_of_the_constants_unless_it_is_given() -> None:
    names = ("HHA Class 1", "AA5083-H131")
    assert FiniteElements(materials=names).solver.friction == FRICTION
    assert FiniteElements(materials=names, friction=0.0).solver.friction == 0.0
    assert FiniteElements(materials=("ARMOX560T",)).solver.friction == 0.0
