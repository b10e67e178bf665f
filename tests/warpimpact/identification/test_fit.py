"""Fit files, and results by finite elements as measured shots: what is read, and what is refused."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.stats import norm

from warpimpact import run
from warpimpact.cli import main
from warpimpact.errors import CampaignError
from warpimpact.identification.fit import PRIORS, Fit, columns_of, fit_of_result
from warpimpact.identification.fit_file import HitPlace
from warpimpact.identification.identify import identify
from warpimpact.identification.likelihood import evaluate, group_shots
from warpimpact.records import attributes as attr
from warpimpact.results import files
from warpimpact.solver.device import Worker

from ...options import CPU
from ..slotted import slotted

FitMaker = Callable[..., Fit]
RESISTANCE = 'resistance = { distribution = "uniform", low = "1 GPa", high = "4 GPa" }'
ONE_SHOT = 'hit = "unknown"\nimpact = { velocity = "700 m/s" }'


def test_priors_are_read_in_si(make_fit: FitMaker) -> None:
    fit = make_fit()
    names = [one.name for one in fit.parameters]
    assert names == ["resistance", "shear_coefficient", "discrepancy_velocity", "discrepancy_angle"]
    assert fit.parameters[0].at(np.array([0.0])) == pytest.approx(2.5e9)
    assert fit.parameters[0].prior.ends == pytest.approx((1e9, 4e9), rel=1e-6)
    assert fit.scene_of(fit.shots[0]).target.layers[0].resistance == pytest.approx(2.5e9)


def test_observations_are_in_si_and_have_their_standoff(make_fit: FitMaker) -> None:
    velocity, tilt = make_fit().shots[0].observations
    assert (velocity.name, velocity.value, velocity.std) == ("residual_velocity", 600.0, 10.0)
    assert (tilt.name, tilt.standoff) == ("tilt", 0)
    assert [tilt.value, tilt.std] == pytest.approx(np.radians([10.0, 3.0]))


def test_any_number_of_the_scene_may_be_a_parameter(make_fit: FitMaker) -> None:
    more = (
        RESISTANCE,
        RESISTANCE + '\ndegradation_length = { distribution = "uniform", low = "0.3 mm", high = "0.6 mm" }\n'
        '[prior.plate.pattern]\nspacing = [{ distribution = "uniform", low = "11 mm", high = "13 mm" }, "12 mm"]\n'
        '[prior.interaction]\nonset = { distribution = "uniform", low = 0.002, high = 0.01 }\n'
        '[prior.core]\nlength = { distribution = "uniform", low = "19 mm", high = "21 mm" }\n[prior.plate.x]',
    )
    fit = make_fit((more[0], more[1].replace("[prior.plate.x]", "")), ("shear_coefficient = {", "#"))
    by_name = {one.name: one.place for one in fit.parameters}
    assert by_name["spacing_y"] == "plate.pattern.spacing.0"
    scene = fit.scene_of(
        fit.shots[0], {by_name["spacing_y"]: 11.5e-3, by_name["onset"]: 0.004, by_name["length"]: 19.5e-3}
    )
    assert scene.target.layers[0].pattern.period == pytest.approx((11.5e-3, 12e-3))
    assert (scene.interaction.onset, scene.core.length) == (0.004, 19.5e-3)
    assert [one.is_column for one in fit.parameters] == sorted(one.is_column for one in fit.parameters)


def test_each_degradation_length_is_a_scene_of_its_own(make_fit: FitMaker) -> None:
    """Its draws are no column of a list of hits."""
    length = 'degradation_length = { distribution = "uniform", low = "0.3 mm", high = "0.6 mm" }'
    fit = make_fit((RESISTANCE, f"{RESISTANCE}\n{length}"), ("shear_coefficient = {", "#"))
    assert fit.parameters[0].name == "degradation_length"
    points = np.zeros((3, len(fit.parameters)))
    points[:, 0] = [-1.0, -1.0, 1.0]
    together, alone = (
        evaluate(fit, rows, np.full((len(rows), 4), 0.5), Worker("cpu")) for rows in (points, points[2:])
    )
    likelihood = together["log_likelihood"].values
    assert np.array_equal(likelihood[0], likelihood[1])
    assert np.array_equal(likelihood[2:], alone["log_likelihood"].values)
    assert columns_of({"plate.degradation_length": np.ones(3)}, fit.scene_of(fit.shots[0]).target.layers[0]) == {}


def test_a_shot_may_have_its_own_plate(make_fit: FitMaker) -> None:
    fit = make_fit((ONE_SHOT, ONE_SHOT + '\nplate = { thickness = "5 mm", resistance = "2 GPa" }'))
    values = {"plate.resistance": 1.5e9}
    own, other = (fit.scene_of(shot, values).target.layers[0] for shot in fit.shots)
    assert (own.thickness, own.resistance) == (5e-3, 2e9)
    assert (other.thickness, other.resistance) == (3e-3, 1.5e9)
    assert len(group_shots(fit)) == 2
    assert len(group_shots(make_fit())) == 1  # shots that differ in their measurements alone share their runs


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (
            ("[prior.plate]", "[prior.plat]"),
            'prior.plat.resistance: got the table "plat", but a prior belongs in one of',
        ),
        (
            ('thickness = "3 mm"', "thickness = 6"),
            "shot[0]: plate.thickness: read as 6 m, but up to 1000 mm is allowed",
        ),
        (("[prior.plate]\nres", "[prior.plate]\nrez"), 'got the unknown key "rezistance"; did you mean "resistance"?'),
        (('low = "1 GPa"', 'low = "1 mm"'), 'low: got "1 mm", which is not a stress'),
        (
            ('low = "1 GPa"', 'low = "-1 GPa"'),
            "resistance: reaches -1e+09, but it must be greater than or equal to 0",
        ),
        (('hit = "unknown"', 'hit = "between holes"'), 'hit: got "between holes", but it must be a table'),
        (('std = "10 m/s"', "std = 0"), "residual_velocity.std: got 0, but it must be greater than 0"),
        (("[10]", "[10, 20]"), "got values: 2, std: 2, stand-offs: 1"),
        (("tilt = {", "tlit = {"), 'got the unknown key "tlit"; did you mean "tilt"?'),
        ((RESISTANCE, "resistance = 2e9"), "but a prior is a distribution such as"),
        (("[sampling]", '[discrepancy]\nvelocity = "1 kg"\n[sampling]'), "discrepancy.velocity"),
        (('pattern]\nshape = "circle"\ndiameter = "8 mm"\nspacing = ["12 mm", "12 mm"]', "pattern]"), "shape"),
    ],
)
def test_a_mistake_gets_one_sentence(make_fit: FitMaker, change: tuple[str, str], sentence: str) -> None:
    with pytest.raises(CampaignError) as caught:
        make_fit(change)
    text = str(caught.value)
    assert text.startswith("fit.toml")
    assert "\n" not in text
    assert sentence in text
    assert "at least 1 items" not in text  # of a list whose items are wrong


def test_a_plate_that_weakens_by_time_has_no_limit_velocity(make_fit: FitMaker) -> None:
    limit = ('residual_velocity = { value = "600', 'limit_velocity = { value = "600')
    assert make_fit(limit).shots[0].observations[0].is_limit
    with pytest.raises(CampaignError, match="which stops no core"):
        make_fit(limit, ('thickness = "3 mm"', 'thickness = "3 mm"\ndegradation = 0.8'))


def test_priors_that_exclude_the_data_are_refused(make_fit: FitMaker) -> None:
    fit = make_fit(("600 m/s", "200 m/s"), ("[sampling]", "[sampling]\nsets = 64"))
    with pytest.raises(CampaignError, match=r'the priors exclude shot "first": the nearest set of parameters'):
        identify(fit, options=CPU)


def test_a_set_whose_scene_is_not_possible_has_no_likelihood(make_fit: FitMaker) -> None:
    """Holes of 8 mm at a spacing below 8 mm overlap."""
    spacing = '[prior.plate.pattern]\nspacing = [{ distribution = "uniform", low = "6 mm", high = "14 mm" }, "12 mm"]'
    fit = make_fit((RESISTANCE, f"{RESISTANCE}\n{spacing}"), ("shear_coefficient = {", "#"))
    column = [one.name for one in fit.parameters].index("spacing_y")
    points = np.zeros((2, len(fit.parameters)))
    points[:, column] = norm.ppf([0.1, 0.6])  # 6.8 and 10.8 mm
    likelihood = evaluate(fit, points, np.full((2, 4), 0.5), Worker("cpu"))["log_likelihood"].values
    assert np.isneginf(likelihood[0]).all()
    assert np.isfinite(likelihood[1]).all()


@pytest.fixture
def result(tmp_path: Path) -> Path:
    """A map of the fast law with the attribute of one by finite elements; one of its hits has failed."""
    dataset = run(slotted(count=6), options=CPU)
    dataset.attrs[attr.CONTINUUM] = "{}"
    dataset["residual_velocity"][2] = np.nan
    dataset["tilt"][2] = np.nan
    files.write(dataset, tmp_path / "c.nc")
    return tmp_path / "c.nc"


def test_its_sound_hits_are_shots_at_known_places(result: Path) -> None:
    dataset, fit = files.read(result), fit_of_result(result)
    assert [shot.name for shot in fit.shots] == ["hit 0", "hit 1", "hit 3", "hit 4", "hit 5"]
    for shot, hit in zip(fit.shots, (0, 1, 3, 4, 5), strict=True):
        assert shot.hit == HitPlace(y=float(dataset["hit_y"][hit]), z=float(dataset["hit_z"][hit]))
        values = [one.value for one in shot.observations]
        assert values[0] == pytest.approx(float(dataset["residual_velocity"][hit]))
        assert np.degrees(values[1:]) == pytest.approx(dataset["tilt"].values[hit], rel=1e-6)
    assert {parameter.name for parameter in fit.parameters} >= PRIORS.keys()


def test_a_map_of_the_fast_law_is_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    monkeypatch.chdir(tmp_path)
    files.write(run(slotted(count=2), options=CPU), tmp_path / "map.nc")
    assert main(["identify", "map.nc"]) == 2
    assert "is an answer for a map; a fit takes hits by finite elements" in capsys.readouterr().err
    assert [path.name for path in tmp_path.iterdir()] == ["map.nc"]
