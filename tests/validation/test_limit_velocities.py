"""The stored predictions of published limit velocities follow from the model as it is now."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from scipy import stats

from .limit_laws import DISCREPANCY, LAWS, RIVALS, Law, fit, fixed, power_law, unit_velocity
from .limit_report import PAGE, tables, with_tables
from .limit_rows import NODES, PUBLISHED, Rows, computed, published
from .limit_velocities import LEAST_ROWS, PREDICTIONS, SUMMARY, evidence, predictions, splits, summary


@pytest.fixture(scope="module")
def rows() -> Rows:
    return published()


def place(rows: Rows, thickness: float, obliquity: float) -> int:
    here = np.isclose(rows.thickness, thickness * 1e-3) & np.isclose(rows.obliquity, np.radians(obliquity))
    return int(np.flatnonzero(here)[0])


PLATES = [("aluminium", 20.0, 45.0), ("aluminium", 50.8, 0.0), ("steel", 6.2, 30.0), ("steel", 10.5, 0.0)]


@pytest.mark.parametrize("plate", PLATES)
def test_the_stored_table_is_what_the_model_computes(rows: Rows, plate: tuple[str, float, float]) -> None:
    stored = rows.unit[place(rows, *plate[1:]), :, 1, 1]
    (found,) = computed([plate], linear=0.5, quadratic=1.0, friction=np.array(NODES["friction"]))
    assert found == pytest.approx(stored, rel=2e-3)  # the search ends within 0.1 %


@pytest.mark.parametrize("plate", PLATES)
def test_between_its_nodes_the_table_is_interpolated(rows: Rows, plate: tuple[str, float, float]) -> None:
    friction, linear, quadratic = 0.05, 0.25, 1.5
    row = rows[np.array([place(rows, *plate[1:])])]
    found = np.exp(unit_velocity(row, friction, np.array([linear]), np.array([quadratic])))
    (exact,) = computed([plate], linear=linear, quadratic=quadratic, friction=np.array([friction]))
    assert found == pytest.approx(exact, rel=5e-3)


@pytest.mark.parametrize("material", ["AA6061-T651", "SECURE400"])
def test_stored_predictions_follow_from_the_stored_table(rows: Rows, material: str) -> None:
    found = predictions(rows[rows.material == material])
    found = found[found["split"] != "other materials"]
    stored = pd.read_csv(PREDICTIONS)
    stored = stored[(stored["material"] == material) & (stored["split"] != "other materials")]
    assert len(found) >= 4 * (len(LAWS) + len(RIVALS))
    assert (found["method"].to_numpy() == stored["method"].to_numpy()).all()
    for column in ("predicted", "low", "high"):
        assert found[column].to_numpy() == pytest.approx(stored[column].to_numpy(), abs=0.3, nan_ok=True)


def test_the_page_shows_the_stored_summary(rows: Rows) -> None:
    page = PAGE.read_text(encoding="utf-8")
    summary = json.loads(SUMMARY.read_text(encoding="utf-8"))
    assert with_tables(page, tables(rows, summary)) == page


def test_a_prediction_never_sees_its_row(rows: Rows) -> None:
    for name in ("AA6082-T6", "AA7075-T651"):
        own = rows[rows.material == name]
        kinds = set()
        for kind, fitted, tested in splits(own):
            kinds.add(kind)
            assert not (fitted & tested).any()
            assert fitted.sum() >= LEAST_ROWS - 1
        assert {"one left out", "thicker"} <= kinds


# ln v ~ N(mean + x, s² I + p² 1 1ᵀ), weighed over nodes and discrepancies.
def test_evidence_is_the_marginal_likelihood(rows: Rows) -> None:
    own = rows[rows.material == "AA6061-T651"]
    law = LAWS[0]
    shapes, mean = law.shapes(own), law.expected(own)
    likelihood = 0.0
    for s, share in zip(*DISCREPANCY, strict=True):
        covariance = s**2 * np.eye(len(own)) + 0.25**2
        for x, weight in zip(*shapes, strict=True):
            density = stats.multivariate_normal(mean + x, covariance).pdf(np.log(own.velocity))
            likelihood += share * weight * density
    assert fit(law, own).evidence == pytest.approx(np.log(likelihood), abs=1e-9)


def test_a_known_strength_is_recovered(rows: Rows) -> None:
    own = rows[rows.material == "AA5083-H131"]
    law = Law("exact", 1, friction=fixed(0.05), linear=fixed(0.4), quadratic=fixed(1.0))
    made = replace(own, velocity=np.exp(0.5 * np.log(1.1e9) + law.shapes(own).x[0]))
    found = fit(law, made[np.arange(4)])
    strength, low, high = found.strength()
    assert low < 1.1e9 < high
    assert strength == pytest.approx(1.1e9, rel=0.01)
    predicted, lower, upper = found.predict(made[np.array([4, 5])])
    assert predicted == pytest.approx(made.velocity[4:], rel=0.005)
    assert (lower < made.velocity[4:]).all()
    assert (made.velocity[4:] < upper).all()


def test_de_marres_law_is_recovered(rows: Rows) -> None:
    own = rows[rows.material == "AA6082-T6"]
    made = replace(own, velocity=3000.0 * own.thickness**0.63 / np.cos(own.obliquity))
    half = np.arange(len(made)) % 2 == 0
    assert power_law(made[half], made[~half]) == pytest.approx(made.velocity[~half], rel=1e-9)


def test_the_tables_of_other_plates(tmp_path: Path) -> None:
    head, *lines = PUBLISHED.read_text(encoding="utf-8").splitlines()
    file = tmp_path / "rows.csv"
    file.write_text("\n".join([head, *(line for line in lines if "SECURE400" in line)]), encoding="utf-8")
    other = published(file)
    shown = tables(other, summary(other, predictions(other), evidence(other)))
    assert set(shown) == {"materials", "methods", "strengths"}  # there is no other material to learn from
    stored = tables(published(), json.loads(SUMMARY.read_text(encoding="utf-8")))
    row = next(line for line in stored["strengths"].splitlines() if "SECURE400" in line)
    assert row.startswith("| SECURE400 | 1147 | 3.20 ")
    assert row.split("|")[:4] == shown["strengths"].splitlines()[2].split("|")[:4]


def test_every_published_row_has_its_source() -> None:
    data = pd.read_csv(PUBLISHED)
    assert len(data) == 116
    assert data["source"].notna().all()
    assert (data["projectile"] == "core").sum() == 6
