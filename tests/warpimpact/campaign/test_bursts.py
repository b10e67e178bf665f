"""Bursts from a campaign file to a result: shards, resuming, replay, intervals, and a sentence for each mistake."""

import re
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import Campaign, Numerics
from warpimpact.campaign.campaign import CampaignError
from warpimpact.results import files
from warpimpact.results.measures import Measure
from warpimpact.results.tallies import Tally, dealing
from warpimpact.runs import shards
from warpimpact.runs.compute import HitMap
from warpimpact.runs.parts import Interrupted
from warpimpact.runs.progress import RunProgress
from warpimpact.runs.replay import replay
from warpimpact.runs.run import run, run_to_file
from warpimpact.solver.findings import HitErrors
from warpimpact.solver.worker import Worker

TEXT = (Path(__file__).parents[3] / "campaigns" / "burst_of_five.toml").read_text(encoding="utf-8")
DRAFT = '[numerics]\nfidelity = "draft"\n\n[output]'


def campaign_of(count: int = 60, *changes: tuple[str, str]) -> Campaign:
    text = TEXT.replace("count = 2048", f"count = {count}").replace("[output]", DRAFT)
    for old, new in changes:
        assert text.count(old) == 1, old
        text = text.replace(old, new)
    return Campaign.from_text(text, name="burst.toml", folder=Path())


@pytest.fixture(scope="module")
def result() -> xarray.Dataset:
    return run(campaign_of(), device="cpu")


def test_a_result_tells_plate_order_and_nearest_earlier_hit(result: xarray.Dataset) -> None:
    assert result.sizes["hit"] == 300
    np.testing.assert_array_equal(result.sample, np.repeat(np.arange(60), 5))
    np.testing.assert_array_equal(result.burst_order, np.tile(np.arange(5), 60))
    hits = np.stack([result.hit_y, result.hit_z], axis=-1).reshape(60, 5, 2)
    np.testing.assert_allclose(result.nearest_earlier_hit[1::5], np.linalg.norm(hits[:, 1] - hits[:, 0], axis=1))
    assert np.isnan(result.nearest_earlier_hit[::5]).all()
    assert result.attrs["shots_at_a_plate"] == 5


def test_later_shots_meet_less(result: xarray.Dataset) -> None:
    lost = (result.impact_velocity - result.residual_velocity).values.reshape(60, 5)
    assert lost[:, 4].mean() < lost[:, 0].mean() - 1.0


@pytest.mark.parametrize("hit", [0, 118, 299])
def test_a_shot_of_a_burst_is_replayed(result: xarray.Dataset, hit: int) -> None:
    history = replay(result, hit, folder=Path())
    assert history.attrs["agreement"] == "bit-identical"
    assert int(history["burst_order"]) == hit % 5
    assert history["resistance_share"].values[0].max() == 1.0


def test_a_run_is_resumed_with_the_same_bits(
    tmp_path: Path, small_shards: None, assert_same_bits: Callable[[Path, Path], None]
) -> None:
    campaign = campaign_of(150)
    assert shards.extent(750, 5) == 160  # 32 bursts

    def interrupt(standing: RunProgress) -> None:
        assert standing.total == 750
        if standing.saved:
            raise KeyboardInterrupt

    straight, resumed = tmp_path / "straight.nc", tmp_path / "resumed.nc"
    run_to_file(campaign, straight, device="cpu,cpu")
    with pytest.raises(Interrupted):
        run_to_file(campaign, resumed, device="cpu", progress=interrupt)
    run_to_file(campaign, resumed, device="cpu", resume=True)
    assert_same_bits(straight, resumed)
    assert files.read(resumed).sizes["hit"] == 750


def test_a_larger_count_keeps_the_earlier_bursts(result: xarray.Dataset) -> None:
    more = run(campaign_of(90), device="cpu")
    if more.attrs["resolution"] != result.attrs["resolution"]:
        pytest.fail("the pilot takes the first bursts, which are the same")
    np.testing.assert_array_equal(more.residual_velocity[:300], result.residual_velocity)


def test_an_interval_counts_bursts(result: xarray.Dataset) -> None:
    # All shots of a burst alike: as many independent numbers as bursts.
    assert dealing(result) == {"replicates": 16, "images": 5}
    rng = np.random.default_rng(0)
    tally = Tally(Measure.parse("mean(residual_velocity)"), replicates=1, images=5)
    tally.add(result.assign(residual_velocity=("hit", np.repeat(rng.normal(700.0, 1.0, 60), 5))))
    assert tally.estimate().half_width == pytest.approx(2.0 / np.sqrt(60.0), rel=0.3)


def test_the_pilot_takes_whole_bursts(monkeypatch: pytest.MonkeyPatch) -> None:
    seen = []

    def piloted(scene: object, pilot: object, *rest: object) -> HitErrors:
        seen.append(pilot)
        return HitErrors(Numerics(level=0), True, 0.9, 0.0, 0.0)

    monkeypatch.setattr("warpimpact.runs.compute.pilot_of", piloted)
    for sampling in ("sobol", "grid"):
        HitMap().pilot(campaign_of(60, ('sampling = "sobol"', f'sampling = "{sampling}"')), Worker("cpu"))
    for pilot in seen:
        assert pilot.at_a_plate == 5
        assert len(pilot) == 65  # of at least 64


def test_what_a_burst_does_not_take_is_refused_in_one_sentence() -> None:
    for change, sentence in (
        (
            ("seed = 1", "seed = 1\nirreducible = true"),
            "[burst] cannot be combined with hits.irreducible = true: the hits of a burst have no images",
        ),
        (('fidelity = "draft"', 'scheme = "nodal"'), '[burst] cannot be combined with numerics.scheme = "nodal"'),
        (('scatter = "5 mm"', 'scatter = "30 m"'), "but they are exact up to"),
        (('scatter = "5 mm"', 'scatter = "5 kg"'), "burst.scatter"),
    ):
        with pytest.raises(CampaignError, match=re.escape(sentence)):
            campaign_of(60, change)
