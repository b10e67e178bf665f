"""The response of a target: from limits, from a sweep with several changes, and the places that fair hits leave."""

import json

import numpy as np
import pytest
import xarray

from warpimpact.firing.response import Response, known_response, normal_response, response_of_limits, response_of_sweep
from warpimpact.firing.rules import FairHit, Gun, drawn_places, fair_places
from warpimpact.kernels.status import Status
from warpimpact.results import attributes as attr

STOP, PASS, BROKE = Status.ARRESTED, Status.PERFORATED, Status.UNFINISHED


def columns(count: int) -> dict[str, tuple[tuple[str, ...], np.ndarray]]:
    """What every result has of its hits; the yaw is 0, 1, 2 … degrees."""
    zero = np.zeros(count)
    names = ("hit_y", "hit_z", "obliquity", "azimuth", "impact_pitch")
    return dict.fromkeys(names, (("hit",), zero)) | {"impact_yaw": (("hit",), np.arange(count) * 1.0)}


def limits(values: list[float]) -> xarray.Dataset:
    status = [BROKE if np.isnan(value) else PASS for value in values]
    data = columns(len(values)) | {
        "limit_velocity": (("hit",), np.array(values)),
        "status": (("hit",), np.array(status)),
    }
    return xarray.Dataset(data, attrs={attr.LIMIT: "velocity", attr.PLATE_PERIOD: np.array([0.02, 0.02])})


def sweep(status: list[list[Status]]) -> xarray.Dataset:
    velocity = ("velocity", np.array([700.0, 800.0, 900.0]), {"long_name": "impact.velocity"})
    data = columns(len(status[0])) | {"status": (("velocity", "hit"), np.array(status))}
    attrs = {attr.SWEEP: json.dumps({"velocity": [1, 2, 3]}), attr.PLATE_PERIOD: np.array([0.02, 0.02])}
    return xarray.Dataset(data, {"velocity": velocity}, attrs)


def test_limits_answer_as_a_map() -> None:
    response = response_of_limits(limits([800.0, 0.0, np.nan, np.inf]))
    assert [response.estimate(speed).value for speed in (1.0, 799.0, 801.0, 5000.0)] == pytest.approx(
        [1 / 3, 1 / 3, 2 / 3, 2 / 3]
    )
    assert response.yaw == pytest.approx([0.0, 1.0, 3.0])
    assert response.estimate(801.0).low < 2 / 3 < response.estimate(801.0).high


def test_a_sweep_may_have_several_changes() -> None:
    """Hit 0 perforates at 800 m/s alone, hit 1 from 900 m/s on, hit 2 always; hit 3 failed once."""
    response = response_of_sweep(sweep([[STOP, STOP, PASS, STOP], [PASS, STOP, PASS, BROKE], [STOP, PASS, PASS, PASS]]))
    assert not response.unique
    assert response.changes == pytest.approx(np.array([[750.0, 850.0], [850.0, np.inf], [0.0, np.inf]]))
    assert [response.estimate(speed).value for speed in (700.0, 800.0, 900.0)] == pytest.approx([1 / 3, 2 / 3, 2 / 3])
    assert [response.quantile(share) for share in (0.3, 0.5, 0.9)] == [0.0, 750.0, np.inf]


@pytest.mark.parametrize("share", [0.01, 0.05, 0.5, 0.9])
def test_quantiles_of_a_normal_response(share: float) -> None:
    from scipy import stats

    assert normal_response(800.0, 25.0).quantile(share) == pytest.approx(stats.norm.ppf(share, 800.0, 25.0), abs=0.05)


def on_a_plate() -> Response:
    places = np.random.default_rng(0).uniform(-0.01, 0.01, (2, 200))
    zeros = np.zeros(200)
    return Response(zeros[:, None] + 800.0, *places, np.linspace(0.0, 5.0, 200), (0.02, 0.02), {})


def test_fair_hits_keep_their_distances_and_their_yaw() -> None:
    """Twelve hits 40 mm apart and 30 mm from the edge of a panel of 300 mm; of 3 degrees of yaw at most."""
    response, rules = on_a_plate(), FairHit(yaw="3 deg", panel=(0.3, 0.3), edge=0.03, distance=0.04)
    places = drawn_places(rules, response, np.zeros((20, 12)), 1)
    assert response.yaw[places].max() <= 3.0
    assert len(np.unique(places)) > 50
    free = drawn_places(FairHit(), response, np.linspace(0.0, 0.999, 24).reshape(2, 12), 1)
    assert free.max() > 180
    with pytest.raises(ValueError, match="no place of the panel is fair"):
        drawn_places(FairHit(panel=(0.021, 0.021), edge=0.0104), response, np.zeros((1, 3)), 1)
    with pytest.raises(ValueError, match="the least yaw of the target's hits is 2"):
        fair_places(FairHit(yaw="1 deg"), response.only(response.yaw > 2.0))
    with pytest.raises(ValueError, match="needs a target with hit points"):
        drawn_places(rules, known_response([800.0], [1.0]), np.zeros((1, 3)), 1)


def test_a_gun_scatters_normally_within_its_window() -> None:
    drawn = (np.arange(2000) + 0.5) / 2000
    assert Gun(deviation=8.0).errors(drawn).std() == pytest.approx(8.0, rel=0.005)
    gun = Gun(deviation=8.0, window=12.0)
    assert np.abs(gun.errors(drawn)).max() <= 12.0
    assert gun.unfair == pytest.approx(0.1336, abs=1e-4)  # 2 Φ(−1.5)
