"""A firing test: its file, its procedures, and many of them at a target with known limits, as one Dataset.

velocity, quantile   probability that a core passes the target against velocity
test, shot           the shots of every simulated test, and what it reports
proof                probability of at most k complete penetrations of n shots, against velocity

The random numbers of shot k of test t depend on the seed, t and k alone.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import numpy as np
import pandas as pd
import xarray
from pydantic import Field, PrivateAttr, model_validator
from scipy import special

from warpimpact.analysis.numbers import View
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import as_campaign_error, parsed, read_text
from warpimpact.firing.v50 import within_span
from warpimpact.measures.hits import failed
from warpimpact.measures.measure import sampling_design
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.records.kinds import FIRING, TEST
from warpimpact.results import files
from warpimpact.results.dataset import column, with_interval
from warpimpact.runs.compute import limit_of
from warpimpact.runs.options import RunOptions
from warpimpact.runs.run import run_to_file
from warpimpact.runs.store import Store
from warpimpact.scene.input_files import InputFile
from warpimpact.scene.model import Array, Model
from warpimpact.scene.sampling import stream
from warpimpact.scene.units import Number, PositiveSpeed, Speed, Title, Whole, count_text
from warpimpact.statistics.intervals import EVEN, Estimate, estimate_of, with_common_factor
from warpimpact.statistics.quantal import (
    Flags,
    acceptance,
    fewest_shots,
    fit_quantal,
    likelihood_interval,
    shown_stop_probability,
)

Share = Annotated[Number, Field(gt=0, lt=1)]
Count = Annotated[Whole, Field(ge=2, le=1000)]


class FiringTarget(Model):
    """The target is a campaign or its limits.

    Attributes:
        campaign: campaign file, whose limit velocities are searched.
        limits: result of `warpimpact limit`.
        count: limits that are searched of a campaign.
    """

    campaign: InputFile | None = None
    limits: InputFile | None = None
    count: Annotated[Whole, Field(ge=1, le=2**20)] = 256

    @model_validator(mode="after")
    def _is_one(self) -> FiringTarget:
        if (self.campaign is None) == (self.limits is None):
            raise ValueError("got both or neither of campaign and limits, but it must be one of them")
        return self


class Gun(Model):
    """How well a velocity is met. It is measured exactly.

    Attributes:
        deviation: standard deviation from the velocity that was aimed at [m/s].
        window: largest difference of a fair hit from the velocity aimed at [m/s]; other shots are fired again.
    """

    deviation: Annotated[Speed, Field(ge=0)] = 0.0
    window: PositiveSpeed | None = None

    def errors(self, drawn: Array) -> Array:
        """Differences from the velocity aimed at [m/s] for uniform numbers in [0, 1), cut at the window."""
        if self.deviation == 0.0:
            return np.zeros_like(drawn)
        outside = 0.0 if self.window is None else 2.0 * float(special.ndtr(-self.window / self.deviation))
        share = np.clip(outside / 2.0 + (1.0 - outside) * drawn, 1e-15, 1.0 - 1e-15)
        return np.asarray(self.deviation * special.ndtri(share))


class MilStd662F(Model):
    """Up and down until equal numbers of the slowest complete penetrations and the fastest stops lie within a span.

    V50 is their mean. The first change of velocity is larger, until there are a stop and a complete penetration. The
    standard's text was not at hand: spans, changes and counts are as publications quote them.

    Attributes:
        start: velocity of the first shot [m/s].
        first_change: of velocity until there are a stop and a complete penetration [m/s].
        change: of velocity from then on [m/s].
        pairs: stops, and as many complete penetrations, that V50 is the mean of.
        span: largest difference between their velocities [m/s].
        most_shots: after which a test ends without a V50.
    """

    name: Literal["mil_std_662f"] = "mil_std_662f"
    start: PositiveSpeed
    first_change: PositiveSpeed = 30.0
    change: PositiveSpeed = 15.0
    pairs: Annotated[Whole, Field(ge=1, le=50)] = 3
    span: PositiveSpeed = 27.0
    most_shots: Count = 30

    def chosen(self, velocity: Array, perforated: Flags) -> list[float] | None:
        """Velocities that V50 is the mean of; None until they lie within the span."""
        return within_span(velocity[~perforated].tolist(), velocity[perforated].tolist(), self.pairs, self.span)

    def aim(self, velocity: Array, perforated: Flags) -> float | None:
        """Velocity of the next shot [m/s] after those of a test; None at its end."""
        if not len(velocity):
            return self.start
        if self.chosen(velocity, perforated) is not None:
            return None
        change = self.first_change if perforated.all() or not perforated.any() else self.change
        return float(velocity[-1]) + (-change if perforated[-1] else change)


class Langlie(Model):
    """One-shot test of H. J. Langlie (A reliability test method for "one-shot" items, Aeronutronic U-1792, 1962).

    The next velocity is the mean of the last one and that of the nearest earlier shot from which on stops and complete
    penetrations are equal in number; without such a shot, of the last one and an end of the range.

    Attributes:
        lowest, highest: ends of the range, in which V50 must lie [m/s].
        most_shots: shots of a test.
    """

    name: Literal["langlie"] = "langlie"
    lowest: PositiveSpeed
    highest: PositiveSpeed
    shots: Count = 12

    @model_validator(mode="after")
    def _rises(self) -> Langlie:
        if self.lowest >= self.highest:
            ends = f"lowest = {self.lowest:g} m/s and highest = {self.highest:g} m/s"
            raise ValueError(f"got {ends}, but lowest must be less")
        return self

    @property
    def most_shots(self) -> int:
        """Shots of a test."""
        return self.shots

    def aim(self, velocity: Array, perforated: Flags) -> float | None:
        """Velocity of the next shot [m/s] after those of a test."""
        if not len(velocity):
            return 0.5 * (self.lowest + self.highest)
        end = self.lowest if perforated[-1] else self.highest
        even = np.cumsum(np.where(perforated, 1, -1)[::-1]) == 0
        return 0.5 * float(velocity[-1] + (velocity[::-1][even.argmax()] if even.any() else end))


Procedure = MilStd662F | Langlie


class Proof(Model):
    """Shots at one velocity, with at most some complete penetrations.

    Attributes:
        velocity: velocity aimed at [m/s].
        shots: shots of a test; by default the fewest that show `stop_probability` at `confidence`.
        allowed: complete penetrations with which a target is still accepted.
        stop_probability: probability of a stop that acceptance shall show.
        confidence: confidence at which it shows this.
    """

    velocity: PositiveSpeed
    shots: Annotated[Whole, Field(ge=1, le=100_000)] | None = None
    allowed: Annotated[Whole, Field(ge=0, le=1000)] = 0
    stop_probability: Share = 0.9
    confidence: Share = 0.9

    @model_validator(mode="after")
    def _can_fail(self) -> Proof:
        if self.shots is not None and self.allowed >= self.shots:
            raise ValueError(f"got allowed = {self.allowed}, but it must be less than shots = {self.shots}")
        return self

    @property
    def shot_count(self) -> int:
        """Shots of a test: the given number, or the fewest that show what acceptance shall show."""
        return self.shots or fewest_shots(self.allowed, self.stop_probability, self.confidence)


class FiringTest(Model):
    """A simulated firing test: target, procedure, gun and proof.

    Attributes:
        title: one line, which the figure shows.
        tests: how often the procedure is fired.
        seed: of all random numbers.
        target: what is fired at.
        procedure: how V50 is sought.
        gun: how well a velocity is met.
        proof: how often a target is accepted with at most k complete penetrations of n shots.
    """

    title: Title
    tests: Annotated[Whole, Field(ge=1, le=100_000)] = 1000
    seed: Annotated[Whole, Field(ge=0, le=2**63 - 1)] = 0
    target: FiringTarget
    procedure: Annotated[Procedure, Field(discriminator="name")] | None = None
    gun: Gun = Gun()
    proof: Proof | None = None
    _text: str = PrivateAttr("")
    """The TOML file as it was read."""


def read_test(path: str | Path) -> FiringTest:
    """Read a test file; file names in it count from its folder.

    Raises:
        CampaignError: the file is missing, is not TOML, or has a value that is not allowed.
    """
    path = Path(path)
    text = read_text(path)
    data: dict[str, Any] = parsed(text, str(path), TEST)
    with as_campaign_error(f"{path}: ", data):
        test = FiringTest.model_validate(data, context={"folder": path.parent})
    test._text = text
    return test


QUANTILES = (0.5, 0.05, 0.01)
"""Shares of cores that pass whose velocities are given: V50, V05, V01."""
TOLERANCE = 4.0
"""How far the two ends of a searched limit may lie apart [m/s]; the limit itself is nearer."""
DISCLAIMER = "a computation by a model, not a certificate: no shot was fired"
_REPORTS = {
    "reported_v50": "V50 that the test reports",
    "reported_spread": "spread that the test reports; no value if not determined",
    "reported_v50_low": "lower end of the interval that the test reports",
    "reported_v50_high": "upper end of the interval that the test reports",
}
_PLACES, _VELOCITIES, _NODES = 1, 2, 64
"""Keys of the random numbers of places and of velocities; number of equally probable velocities of a proof's shot."""
_CURVE_POINTS = 81
_LEAST, _NONE = 1.0, 1e9
"""Slowest velocity of a gun, and a velocity for places without a limit [m/s]."""


@dataclass(frozen=True)
class Response:
    """The limits of all places of a target. A place is a hit of a campaign with its attitude and material.

    Attributes:
        limits: velocities [m/s] above which a core passes at each place, infinite where none does.
        replicates: number of scramblings that the places belong to in turn.
        deviation: standard deviation of the logarithm of a factor of all limits, from the error of the material.
    """

    limits: Array
    replicates: int = 1
    deviation: float = 0.0

    @property
    def factors(self) -> Array:
        """Equally probable factors of all limits."""
        return np.exp(self.deviation * special.ndtri(EVEN)) if self.deviation else np.ones(1)

    def estimate(self, velocity: float) -> Estimate:
        """The probability that a core passes, with its 95 % interval over the places and the material."""
        estimate = estimate_of("share", (self.limits < velocity).astype(float), replicates=self.replicates)

        def share_at(factor: float) -> float:
            return float((factor * self.limits < velocity).mean())

        return with_common_factor(estimate, share_at, self.deviation, is_share=True)

    def quantile(self, share: float) -> Estimate:
        """The velocity at which cores pass at this share of the places, with its 95 % interval; infinite if none is."""
        estimate = estimate_of("quantile", np.minimum(self.limits, _NONE), share=share, replicates=self.replicates)
        ends = (estimate.value, estimate.low, estimate.high)
        value, low, high = (np.inf if end > 0.1 * _NONE else end for end in ends)
        known = replace(estimate, value=value, low=low, high=high)
        return with_common_factor(known, lambda factor: factor * value, self.deviation)


def response_of_limits(dataset: xarray.Dataset) -> Response:
    """The response in a result of `warpimpact limit`.

    Raises:
        ValueError: the result has limits of thickness, or no limit.
    """
    if dataset.attrs.get(attr.LIMIT) != "velocity":
        raise ValueError("is no result of a search of limit velocities, as warpimpact limit writes")
    sound = ~failed(dataset)
    limits = dataset[v.LIMITS["velocity"].value].values.astype(float)[sound]
    if not np.isfinite(limits).any():
        raise ValueError("has no limit velocity: no core passed at any velocity that was tried, or all shots failed")
    replicates = sampling_design(dataset)["replicates"] if sound.all() else 1
    return Response(limits, replicates, float(dataset.attrs.get(attr.LIMIT_DEVIATION, 0.0)))


def response_of(
    test: FiringTest, store: Store, *, count: int | None = None, options: RunOptions = RunOptions()
) -> Response:
    """The response of the target of a test. The limits of a campaign are searched into FILE_limits.nc.

    Args:
        store: the file of the test, beside which the limits are stored.
        count: number of hits of the campaign, instead of that in the file.
        options: where to compute.

    Raises:
        CampaignError: the file that the target names gives no response.
        ResultError: the file is no result.
    """
    assert store.path is not None
    limits = test.target.limits or store.path.with_name(f"{store.path.stem}_limits.nc")
    if test.target.campaign is not None:
        listed = Campaign.from_toml(test.target.campaign).hits.listed is not None
        campaign = Campaign.from_toml(test.target.campaign, count=None if listed else count or test.target.count)
        limit = limit_of(campaign, tolerance=TOLERANCE)
        run_to_file(campaign, replace(store, path=limits), limit=limit, options=options)
    dataset = files.read(limits)
    with as_campaign_error(f"{limits}: "):
        return response_of_limits(dataset.to_dataset())


class FiredShots(NamedTuple):
    """The shots of all tests, each of shape [tests, shots]: velocity [m/s], whether it passed, and was fired."""

    velocity: Array
    perforated: Flags
    used: Flags


def fire(procedure: Procedure, limits: Array, errors: Array) -> FiredShots:
    """Fire all tests.

    Args:
        limits: limit velocity of the place that every shot hits [m/s], shape [tests, shots].
        errors: velocity of each shot minus the velocity aimed at [m/s], shape [tests, shots].
    """
    velocity = np.zeros(limits.shape)
    perforated, used = np.zeros((2, *limits.shape), dtype=bool)
    for test, shot in np.ndindex(limits.shape):
        if shot and not used[test, shot - 1]:
            continue
        before = (test, slice(shot))
        if (aim := procedure.aim(velocity[before], perforated[before])) is not None:
            speed = max(aim + float(errors[test, shot]), _LEAST)
            velocity[test, shot], perforated[test, shot] = speed, speed > limits[test, shot]
            used[test, shot] = True
    return FiredShots(velocity, perforated, used)


def reports(firings: FiredShots, procedure: Procedure) -> dict[str, Array]:
    """The report of every test [m/s], NaN where it has none: the mean of the standard, or the probit."""
    velocity, perforated, used = firings
    v50, spread, low, high = np.full((4, len(velocity)), np.nan)
    if isinstance(procedure, MilStd662F):
        for test, shots in enumerate(used):
            chosen = procedure.chosen(velocity[test, shots], perforated[test, shots])
            v50[test] = np.nan if chosen is None else np.mean(chosen)
    else:
        fit = fit_quantal(*firings)
        v50, spread = fit.location, fit.scale
        low, high = likelihood_interval(*firings, fit)
    return dict(zip(_REPORTS, (v50, spread, low, high), strict=True))


def simulate_test(test: FiringTest, response: Response) -> xarray.Dataset:
    """Fire a test many times at a target whose response is known."""
    limits = response.limits
    ends = [*limits[np.isfinite(limits)], *([] if test.proof is None else [test.proof.velocity])]
    margin = 0.05 * max(np.ptp(ends), 0.02 * max(ends))  # from where no core passes to where all do
    grid = np.linspace(max(1.0, min(ends) - margin), max(ends) + margin, _CURVE_POINTS)
    velocity = grid if test.proof is None else np.union1d(grid, test.proof.velocity)
    shares, quantiles = (
        np.array([(one.value, one.low, one.high) for one in estimates])
        for estimates in (map(response.estimate, velocity.tolist()), map(response.quantile, QUANTILES))
    )
    passes = "probability that a core passes, at any place"
    reached = "velocity at which cores pass at this share of the places"
    columns = {
        "velocity": column("velocity", velocity, "m s-1", "impact velocity"),
        "quantile": column("quantile", np.array(QUANTILES), "1", "share of the places at which cores pass"),
        **with_interval("perforation_probability", "velocity", shares, "1", passes),
        **with_interval("quantile_velocity", "quantile", quantiles, "m s-1", reached),
    }
    if test.procedure is not None:
        number = range(test.procedure.most_shots)
        places, errors = (
            np.stack([stream(test.seed, (key, shot), 0, test.tests) for shot in number], axis=1)
            for key in (_PLACES, _VELOCITIES)
        )
        firings = fire(test.procedure, limits[(places * len(limits)).astype(int)], test.gun.errors(errors))
        speed = np.where(firings.used, firings.velocity, np.nan)
        passed = np.where(firings.used, firings.perforated, -1).astype(np.int8)
        of_speed = "velocity of the shot; no value after the end of the test"
        of_passed = "1 passed, 0 stopped, -1 after the end of the test"
        of_tests = reports(firings, test.procedure)
        columns |= {name: column("test", of_tests[name], "m s-1", meaning) for name, meaning in _REPORTS.items()}
        columns |= {
            "shot_velocity": column(("test", "shot"), speed, "m s-1", of_speed),
            "shot_perforated": column(("test", "shot"), passed, "1", of_passed),
        }
    if test.proof is not None:
        shots, allowed = test.proof.shot_count, test.proof.allowed
        errors = test.gun.errors((np.arange(_NODES) + 0.5) / _NODES)
        sums = np.zeros((3, len(velocity)))
        for factor in response.factors:
            by_place = np.array([(factor * limits < (speed + errors)[:, None]).mean(axis=0) for speed in velocity])
            share = by_place.mean(axis=1)
            same = acceptance(shots, allowed, by_place).mean(axis=-1)
            sums += share, acceptance(shots, allowed, share), same
        one, anywhere, same = sums / len(response.factors)
        meaning = "probability that a core passes, with the gun's scatter"
        accepts = "probability that the plan accepts, every shot at any place"
        at_one = "the same if all shots of a test hit the same place"
        columns |= {
            "proof_perforation_probability": column("velocity", one, "1", meaning),
            "pass_probability": column("velocity", anywhere, "1", accepts),
            "pass_probability_same_place": column("velocity", same, "1", at_one),
        }
    v16, true, v84 = (response.quantile(float(special.ndtr(z))).value for z in (-1.0, 0.0, 1.0))
    attributes = {
        "Conventions": "CF-1.11",
        attr.REFERENCES: "docs/firing.md of warpimpact",
        "disclaimer": DISCLAIMER,
        attr.KIND: FIRING.mark,
        attr.TITLE: test.title,
        attr.HISTORY: attr.history_line("test"),
        attr.WARPIMPACT_VERSION: attr.versions()[attr.WARPIMPACT_VERSION],
        "firing_test": test._text or test.model_dump_json(),
        "firing_test_settings": test.model_dump_json(exclude_none=True),
        attr.COUNT: len(response.limits),
        attr.LIMIT_DEVIATION: response.deviation,
        "true_v50": true,
        "true_spread": 0.5 * (v84 - v16),
    }
    if test.proof is not None:
        attributes["proof_shots"] = test.proof.shot_count
    return xarray.Dataset(columns, attrs=attributes)


def firing_view(dataset: xarray.Dataset) -> View:
    """The target of a test, the reports of the tests, and the meaning of the plan of a proof."""
    columns = ("quantile", "quantile_velocity", "quantile_velocity_low", "quantile_velocity_high")
    rows = {}
    for share, value, *ends in zip(*(dataset[name].values for name in columns), strict=True):
        interval = " to ".join(f"{end:.5g}" if np.isfinite(end) else "open" for end in ends)
        rows[f"V{100 * share:02.0f}"] = {"velocity [m/s]": f"{value:.5g}", "95 % interval": interval}
    quantiles = pd.DataFrame.from_dict(rows, orient="index").rename_axis("target")
    spread = f"By {_hits(dataset)}. Half the distance from V16 to V84 is {float(dataset.true_spread):.3g} m/s."
    if float(dataset.attrs[attr.LIMIT_DEVIATION]):
        spread += " Intervals and probabilities hold the error of the material's resistance."
    view: dict[str, Sequence[str | pd.DataFrame]] = {
        str(dataset.attrs[attr.TITLE]): [str(dataset.attrs["disclaimer"]), quantiles, spread]
    }
    if "reported_v50" in dataset:
        view[tests_title(dataset)] = report_lines(dataset)
    return view | dict(_proof_view(dataset) if "pass_probability" in dataset else {})


def _hits(dataset: xarray.Dataset) -> str:
    """The hits whose limits are the target of a test."""
    return count_text(int(dataset.attrs[attr.COUNT]), "hit")


def tests_title(dataset: xarray.Dataset) -> str:
    """Procedure, and numbers of tests and of their shots."""
    shots = (dataset.shot_perforated.values >= 0).sum(axis=1)
    count = count_text(shots.max(), "shot")
    if np.ptp(shots):
        count = f"{shots.min()} to {count}, mean {shots.mean():.3g}"
    name = json.loads(dataset.attrs["firing_test_settings"])["procedure"]["name"]
    return f"{name}: {count_text(len(shots), 'test')} of {count}"


def report_lines(dataset: xarray.Dataset) -> list[str]:
    """The reports of the tests, beside the truth."""
    v50, spread, low, high = (dataset[name].values for name in _REPORTS)
    true, known, bounded = float(dataset.attrs["true_v50"]), ~np.isnan(v50), ~np.isnan(low)
    if not known.any():
        return ["no test reports a V50"]
    lines = [] if known.all() else [f"reports a V50 in {_share(known)} of the tests"]
    off = v50[known] - true
    lines.append(f"reported V50: {off.mean():+.3g} m/s off on average, standard deviation {off.std():.3g} m/s")
    if bounded.any():
        finite = spread[np.isfinite(spread)]
        median = f"{np.median(finite):.3g}" if len(finite) else "-"
        unknown, held, is_open = ~np.isfinite(spread), (low <= true) & (true <= high), np.isinf(low) | np.isinf(high)
        lines += [
            f"reported spread: median {median} m/s, of {float(dataset.true_spread):.3g} m/s; not determined "
            f"in {_share(unknown)}",
            f"reported 95 % interval of V50: contains the true V50 in {_share(held[bounded])}; open in "
            f"{_share(is_open[bounded])}",
        ]
    return lines


def _share(answers: Flags) -> str:
    """A share of the tests with its interval."""
    estimate = estimate_of("share", answers.astype(float)).times(100.0)
    return f"{estimate.value:.3g} % ({estimate.low:.3g} to {estimate.high:.3g} %)"


def _proof_view(dataset: xarray.Dataset) -> View:
    """The plan of the proof, what acceptance shows, and how often it accepts this target."""
    proof, shots = json.loads(dataset.attrs["firing_test_settings"])["proof"], int(dataset.attrs["proof_shots"])
    allowed, velocity, confidence = (proof[key] for key in ("allowed", "velocity", "confidence"))
    row = int(np.abs(dataset.velocity.values - velocity).argmin())
    perforation, passed, same = (
        float(dataset[name][row])
        for name in ("proof_perforation_probability", "pass_probability", "pass_probability_same_place")
    )
    is_good = 1.0 - perforation >= proof["stop_probability"]
    risk = f"rejects it in {100 * (1.0 - passed):.3g} %" if is_good else f"accepts it in {100 * passed:.3g} %"
    shown = 100 * shown_stop_probability(shots, allowed, confidence)
    sentences = [
        f"acceptance shows P(stop) >= {shown:.3g} % at {100 * confidence:g} % confidence, if shots may hit any place",
        f"this target, by {_hits(dataset)}: P(stop) = {100 * (1.0 - perforation):.4g} %; the plan {risk} of the tests "
        f"({'producer' if is_good else 'consumer'}'s risk)",
        f"if all shots of a test hit the same place, it accepts this target in {100 * same:.3g} % of the tests, in "
        f"place of {100 * passed:.3g} %",
    ]
    plan = f"at most {count_text(allowed, 'complete penetration')}"
    return {f"proof: {count_text(shots, 'shot')} at {velocity:g} m/s, {plan}": sentences}
