"""The stored predictions of published limit velocities follow from the model as it is now."""

import json
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from warpimpact.catalogue.catalogue import DATA_FOLDER, Catalogue
from warpimpact.catalogue.entries import Material
from warpimpact.catalogue.strength import limit_fit

from .limit_catalogue import entries, figures
from .limit_model import METALS, NAMES, Fit, Model, fit, plates_of
from .limit_rows import Rows, computed, log_unit, published, unit
from .limit_splits import LAW, left_out, predictions, questions
from .limit_users import USERS, predicted
from .limit_velocities import PREDICTIONS, stored_fit


@pytest.fixture(scope="module")
def rows() -> Rows:
    return published()


@pytest.fixture(scope="module")
def whole_fit() -> Fit:
    return stored_fit()


def plate(projectile: str, calibres: float, angle: float) -> Rows:
    first = published()[np.array([0])]
    row = replace(
        first, projectile=np.array([projectile]), obliquity=np.radians([angle]), calibres=np.array([calibres])
    )
    return replace(row, thickness=calibres * row.diameter, density=row.mass / row.diameter**3)


# Between the nodes. The search ends within 0.1 %; a parabola through ln F at three η misses 0.22 % at η = 0.05.
@pytest.mark.parametrize(
    ("projectile", "calibres", "angle", "friction", "within"),
    [
        (".30 AP M2", 3.2, 0.0, 0.05, 3e-3),
        (".30 AP M2", 0.8, 30.0, 0.03, 1e-2),
        ("14.5 mm BS41", 2.0, 30.0, 0.05, 1e-2),
        (".50 AP M2", 5.0, 0.0, 0.05, 5e-3),
        ("14.5 mm B32", 1.3, 45.0, 0.15, 1e-2),
    ],
)
def test_limit_velocities_are_interpolated(
    projectile: str, calibres: float, angle: float, friction: float, within: float
) -> None:
    row = plate(projectile, calibres, angle)
    (exact,) = computed(projectile, [(calibres, angle, friction)])
    assert np.exp(0.5 * log_unit(unit(row), friction)) == pytest.approx(np.sqrt(exact), rel=within)


def test_known_sizes_are_recovered_and_intervals_hold(rows: Rows) -> None:
    """Limit velocities are drawn with known sizes of the parts."""
    sizes = {"material": 0.1, "source": 0.06, "thickness": 0.05, "test": 0.04}
    scales = {f"{name}, {metal}": size for name, size in sizes.items() for metal in METALS}
    truth = np.log([*(scales.get(name, 0.02) for name in NAMES), 0.05])
    some = rows[::5]
    model = Model(some)
    covariance = model.signal(truth) + np.diag(model.noise(truth))
    residual = np.random.default_rng(1).multivariate_normal(np.zeros(len(some)), covariance)
    log_energy = residual + model.expected + log_unit(model.nodes, 0.05)
    drawn = replace(some, velocity=np.exp(0.5 * (log_energy - np.log(some.mass / some.diameter**3))))
    fitted = fit(drawn)
    for name in ("test", "material"):
        assert fitted.scales[f"{name}, aluminium"] == pytest.approx(sizes[name], rel=0.4)
    inside = list[float]()
    for split in (one for one in left_out(drawn) if one.name in ("one row out", "one material out")):
        table = predictions(drawn, split, Fit(truth, 0.0))
        table = table[table["method"] == LAW]
        inside.append(table["published"].between(table["low"], table["high"]).mean())
    assert np.mean(inside) == pytest.approx(0.94, abs=0.04)  # tails of Student's t widen what is normal here


def test_the_gradient_is_that_of_the_posterior(rows: Rows, whole_fit: Fit) -> None:
    model, at = Model(rows[::5]).weighed(whole_fit.values), whole_fit.values + 0.1
    moves = 1e-5 * np.eye(len(at))
    differences = [(model.log_posterior(at + move) - model.log_posterior(at - move)) / 2e-5 for move in moves]
    assert model.gradient(at) == pytest.approx(np.array(differences), abs=2e-3)


def test_the_package_predicts_as_the_fit_does(rows: Rows, whole_fit: Fit) -> None:
    model = Model(rows).weighed(whole_fit.values)
    for material in ("HHA Class 1", "AA6082-T6"):
        some = np.flatnonzero(rows.material == material)
        plates = plates_of(rows[some])
        alone = replace(plates, source=np.full(len(some), "another"))
        signal, noise = model.signal(whole_fit.values), model.noise(whole_fit.values) / model.weights
        gain = np.linalg.solve(signal + np.diag(noise), signal[:, some]).T
        inside = plates.expected + gain @ model.residual(whole_fit.values)
        assert limit_fit(material).predicted(plates)[0] == pytest.approx(inside, abs=1e-5)
        mean, deviation = limit_fit(material).predicted(alone)
        assert np.abs(mean - inside).max() < 0.1
        assert (deviation > whole_fit.scales[f"source, {'steel' if plates.steel[0] else 'aluminium'}"]).all()


def test_rows_left_out_together_are_predicted_as_from_a_fit_without_them(rows: Rows, whole_fit: Fit) -> None:
    some = rows[rows.material == "AA6055-T651"]
    model, group = Model(some).weighed(whole_fit.values), np.array([0, 3, 20])
    mean, variance = model.left_out(whole_fit.values, [group])
    known = ~np.isin(np.arange(len(some)), group)
    alone = model.predicted(whole_fit.values, known, group)
    assert mean[group] == pytest.approx(alone[0], abs=1e-8)
    assert variance[group] == pytest.approx(alone[1], rel=1e-8)


@pytest.mark.parametrize("split", ["one row out", "one material out"])
def test_stored_predictions_follow_from_the_stored_fit(rows: Rows, whole_fit: Fit, split: str) -> None:
    (question,) = (one for one in left_out(rows) if one.name == split)
    table = predictions(rows, question, whole_fit)
    table = table[table["method"] == LAW]
    stored = pd.read_csv(PREDICTIONS)
    stored = stored[stored["split"] == split]
    for column in ("predicted", "low", "high"):
        assert table[column].to_numpy() == pytest.approx(stored[column].to_numpy(), abs=0.3)


def test_a_prediction_never_sees_its_rows(rows: Rows) -> None:
    seen = set()
    for split in [*left_out(rows), *questions(rows)]:
        seen.add(split.name)
        assert len(split.groups) == len(split.fitted)
        assert not any(known[group].any() for group, known in zip(split.groups, split.fitted, strict=True))
        every = np.concatenate(split.groups)
        assert len(np.unique(every)) == len(every)
    assert len(seen) == 10


def test_the_catalogue_has_the_fitted_materials(rows: Rows, whole_fit: Fit) -> None:
    texts = entries(rows, whole_fit, pd.read_csv(PREDICTIONS))
    stored = Catalogue().all(Material)
    assert {text.partition('"')[2].partition('"')[0] for text in texts} == set(stored)
    for text in texts:
        name, strength = text.partition('"')[2].partition('"')[0], text.partition('resistance = "')[2].split()[0]
        assert float(strength) * 1e6 == pytest.approx(stored[name].resistance, rel=2e-3)


def test_the_figures_of_its_warnings_are_those_of_the_predictions(rows: Rows) -> None:
    stored = json.loads((DATA_FOLDER / "figures.json").read_text(encoding="utf-8"))
    assert figures(rows, pd.read_csv(PREDICTIONS)) == stored


def test_a_user_gets_what_the_page_says(rows: Rows) -> None:
    answers = pd.read_csv(USERS)
    for material in ("HHA Class 1", "AA6061-T651", "MARS600"):
        stored = answers[answers["material"] == material].iloc[0]
        assert predicted(rows, int(stored["row"])) == pytest.approx(stored[["predicted", "low", "high"]], abs=1.0)
