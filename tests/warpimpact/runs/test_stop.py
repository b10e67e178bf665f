"""The stop rule of a campaign: intervals of Sobol replicates that contain the answer as often as they claim, and runs
that it ends."""

import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
import xarray

from warpimpact import Campaign
from warpimpact.analysis.inspection import stop_lines
from warpimpact.campaign.campaign import CampaignError
from warpimpact.errors import Interrupted
from warpimpact.measures.measure import Measure, estimate_from
from warpimpact.measures.references import law_of
from warpimpact.results import files
from warpimpact.runs.options import RunOptions, RunProgress
from warpimpact.runs.replay import replay
from warpimpact.runs.run import RunMonitor, run, run_to_file
from warpimpact.runs.store import Chunks, Store

from ...options import CPU
from ..measures.test_measures import LEAST, TRIALS, TRUTHS, shard_of
from ..slotted import slotted, slotted_text

SameBits = Callable[[Path, Path], None]
DRAFT = slotted_text(("count = 4096\n", ""))
STOP = '[stop]\nquantity = "{}"\nhalf_width = "{}"\nmax_count = {}\n\n[output]'
LEAST_STOPPED = 129
"""95 % of 150 trials: 142.5 ± 2.7; five standard deviations below, because the rule looks more than once."""
pytestmark = pytest.mark.usefixtures("small_chunks")


def campaign(tmp_path: Path, quantity: str, half_width: str, max_count: int = 2**16, **hits: object) -> Campaign:
    text = DRAFT.replace("[output]", STOP.format(quantity, half_width, max_count))
    for name, value in hits.items():
        text = text.replace(f'{name} = "sobol"' if name == "sampling" else "seed = 1", f"{name} = {value}")
    text = text.replace("[hits]", "[hits]\nirreducible = false")  # the numbers here know no symmetry
    (tmp_path / "campaign.toml").write_text(text, encoding="utf-8")
    return Campaign.from_toml(tmp_path / "campaign.toml")


def surface(campaign: Campaign, first: int, count: int) -> np.ndarray:
    """The sum of the two uniform numbers of a shot's hit point."""
    shots, (y, z) = campaign.sampler().shots(first, count), campaign.plate.sampled_cell
    return shots.hit_y / y + shots.hit_z / z + 1.0


@pytest.fixture(scope="module")
def trials() -> list[np.ndarray]:
    """Values of 1024 hits by seed, of a campaign that says nothing of replicates."""
    scene = slotted(count=1024)
    assert scene.hits.scramblings == 16
    reseeded = (scene.hits.model_copy(update={"seed": seed}) for seed in range(TRIALS))
    return [surface(scene.model_copy(update={"hits": hits}), 0, 1024) for hits in reseeded]


@pytest.mark.parametrize("text", TRUTHS)
def test_intervals_of_replicates_hold_as_often_as_they_say_and_are_narrower(
    text: str, trials: list[np.ndarray]
) -> None:
    held, widths, measure = 0, [], Measure.parse(text)
    for values in trials:
        estimate = estimate_from(measure, measure.values(shard_of(values)), replicates=16)
        held += estimate.low <= TRUTHS[text] <= estimate.high
        widths.append(estimate.half_width)
    alone = estimate_from(measure, measure.values(shard_of(trials[-1])))
    assert held >= LEAST
    assert np.median(widths) < (0.5 if text.startswith("mean") else 0.8) * alone.half_width


def watched(campaign: Campaign, count: int) -> RunMonitor:
    """Follow made-up hits until the stop rule is met."""
    chunks, values = Chunks(Store(), {}), surface(campaign, 0, count)
    watch = RunMonitor(campaign, chunks, 256, xarray.Dataset())
    for number in range(count // 256):
        chunks.save(("map", number), shard_of(values[number * 256 : (number + 1) * 256]))
        watch.add(number, chunks.load(("map", number)))
        if watch.stop:
            break
    return watch


@pytest.mark.parametrize("sampling", ["random", "sobol"])
def test_the_stop_rule_keeps_its_promise(sampling: str, tmp_path: Path) -> None:
    half_width = {"random": "0.02 m/s", "sobol": "0.001 m/s"}[sampling]
    scene = campaign(tmp_path, "mean(residual_velocity)", half_width, sampling=f'"{sampling}"')
    held, ends = 0, []
    for seed in range(TRIALS):
        reseeded = scene.model_copy(update={"hits": scene.hits.model_copy(update={"seed": seed})})
        watch = watched(reseeded, 2**14)
        low, high = watch.stop["estimate_interval"]
        assert watch.stop["stop_reason"] == "half_width"
        assert 0.5 * (high - low) <= float(half_width.split()[0])
        held += low <= 1.0 <= high
        ends.append(watch.count)
    assert held >= LEAST_STOPPED
    assert np.median(ends) > 2


@pytest.mark.parametrize(
    ("shift", "reason"),
    [(0.0, "half_width"), (0.03, "half_width"), (0.045, "numerics"), (0.05, "numerics"), (0.06, "numerics")],
)
def test_a_run_goes_on_as_long_as_hits_may_make_up_for_the_numerics(
    shift: float, reason: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    scene = campaign(tmp_path, "mean(residual_velocity)", "0.05 m/s", max_count=2**14, sampling='"random"')
    monkeypatch.setattr(sys.modules[RunMonitor.__module__], "shift_of", lambda *_: shift)
    watch = watched(scene, 2**14)  # which leave ± 0.006 m/s
    low, high = watch.stop["estimate_interval"]
    assert watch.stop["stop_reason"] == reason
    assert 0.5 * (high - low) <= (0.05 - shift if reason == "half_width" else 0.025)
    assert watch.hits(watch.count) < 2**13  # where more are of no use the half that is left to hits is met


@pytest.mark.parametrize(
    ("quantity", "half_width", "sentence"),
    [
        ("mean(speed)", "1 m/s", 'stop.quantity: got "speed", but it must be one of base_depth, residual_energy'),
        ("mean(depth)", "1 mm", 'stop.quantity = "mean(depth)" needs a table [[layer]]'),
        ("V50", "1 m/s", 'stop.quantity: got "V50", which warpimpact limit computes'),
        ("areal_density", "1 kg/m^2", "a run cannot stop by a number without an interval"),
        ("mean(tilt@100mm)", "1 deg", "needs 0.1 m in output.standoffs, which are 0.05 m, 0.13 m"),
        ("mean(residual_velocity)", "1 deg", 'stop.half_width: got "1 deg", which is not a speed'),
    ],
)
def test_a_wrong_rule_is_reported_in_one_sentence(
    quantity: str, half_width: str, sentence: str, tmp_path: Path
) -> None:
    with pytest.raises(CampaignError) as caught:
        campaign(tmp_path, quantity, half_width)
    assert sentence in str(caught.value)


def test_a_rule_takes_the_place_of_the_count(tmp_path: Path) -> None:
    scene = campaign(tmp_path, "mean(residual_velocity)", "1 m/s", max_count=3000)
    assert len(scene.sampler()) == 3000
    assert len(Campaign.from_toml(tmp_path / "campaign.toml", count=500).sampler()) == 500
    again = Campaign.from_text(scene.model_dump_json(), name="text", folder=tmp_path)
    assert again.model_dump() == scene.model_dump()
    with pytest.raises(CampaignError, match=r"hits.count = 7 and stop.max_count = 3000 cannot be combined"):
        campaign(tmp_path, "mean(residual_velocity)", "1 m/s", max_count=3000, count="7\nseed = 1")
    with pytest.raises(CampaignError, match=r'\[stop\] cannot be combined with hits.sampling = "grid"'):
        campaign(tmp_path, "mean(residual_velocity)", "1 m/s", sampling='"grid"')


def test_a_run_stops_at_the_same_shot_however_it_was_computed(tmp_path: Path, assert_same_bits: SameBits) -> None:
    scene = campaign(tmp_path, "P(tilt@130mm > 30 deg)", "0.1", max_count=20000)
    dataset = law_of(run(scene, options=CPU))
    message = dataset.attrs
    assert message["stop_reason"] == "half_width"
    assert dataset.sizes["hit"] in (512, 1024, 2048, 4096)
    low, high = message["estimate_interval"]
    assert 0.0 < 0.5 * (high - low) + message["estimate_numerics"] <= 0.1
    share = np.array([(dataset["tilt"].values[r::16, 1] > 30.0).mean() for r in range(16)])
    assert message["estimate"] == pytest.approx(share.mean(), rel=1e-12)

    def interrupt(standing: RunProgress) -> None:
        if standing.saved >= 256:
            raise KeyboardInterrupt

    straight, resumed = tmp_path / "straight.nc", tmp_path / "resumed.nc"
    run_to_file(scene, straight, options=RunOptions("cpu,cpu"))
    with pytest.raises(Interrupted):
        run_to_file(scene, resumed, options=RunOptions("cpu", progress=interrupt))
    run_to_file(scene, Store(resumed, resume=True), options=CPU)
    assert_same_bits(straight, resumed)
    stored = files.read(resumed)
    assert stored.sizes["hit"] == dataset.sizes["hit"]
    assert stored.attrs["estimate"] == message["estimate"]
    assert stop_lines(stored) == ["The hits ended by the fast law's P(tilt@130mm > 30 deg): the half width is reached."]
    last = stored.sizes["hit"] - 1
    assert replay(stored, last, folder=tmp_path).attrs["agreement"] == "bit-identical"


def test_a_rule_samples_the_irreducible_part_by_default(tmp_path: Path) -> None:
    rule = STOP.format("mean(residual_velocity)", "1 m/s", 4096)
    text, counted = DRAFT.replace("[output]", rule), DRAFT.replace("seed = 1", "seed = 1\ncount = 8")
    whole = text.replace("[hits]", "[hits]\nirreducible = false")
    for given, expected in ((text, True), (whole, False), (counted, False)):
        assert Campaign.from_text(given, name="text", folder=tmp_path).hits.irreducible is expected
