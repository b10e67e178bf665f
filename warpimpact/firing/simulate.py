"""A firing test that is fired many times at a target with known limits, as one Dataset (`results/firing.py`).

The random numbers of shot k of test t depend on the seed, t and k alone.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import xarray
from numpy.typing import NDArray
from scipy import special

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import CampaignError
from warpimpact.firing.plan import FiringTest, MilStd662F, Procedure, Proof, Shot
from warpimpact.records.variable import Variable
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results import firing as f
from warpimpact.results import variables as v
from warpimpact.results.dataset import dataset_of, failed
from warpimpact.results.kinds import FIRING
from warpimpact.results.measures import dealing
from warpimpact.scene.model import Array
from warpimpact.scene.sampling import stream
from warpimpact.statistics.acceptance import acceptance
from warpimpact.statistics.intervals import Estimate, Estimating, estimate_of
from warpimpact.statistics.quantal import fit_quantal, likelihood_interval
from warpimpact.studies.limit import limit_to_file

QUANTILES = (0.5, 0.05, 0.01)
"""Shares of perforations whose velocities are given: V50, V05, V01."""
TOLERANCE = 4.0
"""How far the two ends of a searched limit may lie apart [m/s]; the limit itself is nearer."""
_PLACES, _VELOCITIES, _NODES = 1, 2, 64
"""Keys of the random numbers of places and of velocities; number of equally probable velocities of a proof's shot."""
_CURVE_POINTS = 81
_LEAST, _NONE = 1.0, 1e9
"""Slowest velocity of a gun, and a velocity for places without a limit [m/s]."""


@dataclass(frozen=True)
class Response:
    """The limits of all places of a target. A place is a hit of a campaign with its attitude and material.

    Attributes:
        limits: velocities [m/s] above which each place perforates, infinite where none does.
        dealt: how places are dealt to the replicates of the sampling.
    """

    limits: Array
    dealt: Estimating = field(default_factory=Estimating)

    def estimate(self, velocity: float) -> Estimate:
        """The probability of perforation with its 95 % interval over the places."""
        return estimate_of("share", (self.limits < velocity).astype(float), **self.dealt)

    def quantile(self, share: float) -> Estimate:
        """The velocity at which this share of the places perforates, with its 95 % interval; infinite if none is."""
        finite = estimate_of("quantile", np.minimum(self.limits, _NONE), share=share, **self.dealt)
        value, low, high = (np.inf if end > 0.1 * _NONE else end for end in (finite.value, finite.low, finite.high))
        return replace(finite, value=value, low=low, high=high)


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
        raise ValueError("has no limit velocity: no hit perforates at any velocity that was tried, or all have failed")
    dealt: Estimating = dealing(dataset) if sound.all() else {"replicates": 1}
    return Response(limits, dealt)


def response_of(test: FiringTest, output: Path, *, count: int | None = None, **options: Any) -> Response:
    """The response of the target of a test. The limits of a campaign are searched into OUTPUT_limits.nc.

    Args:
        count: number of hits of the campaign, instead of that in the file.
        options: as in `run_to_file`.

    Raises:
        CampaignError: the file that the target names gives no response.
        ResultError: the file is no result.
    """
    limits = test.target.limits
    if test.target.campaign is not None:
        limits = output.with_name(f"{output.stem}_limits.nc")
        listed = Campaign.from_toml(test.target.campaign).hits.listed is not None
        campaign = Campaign.from_toml(test.target.campaign, count=None if listed else count or test.target.count)
        limit_to_file(campaign, limits, tolerance=TOLERANCE, **options)
    assert limits is not None
    dataset = files.read(limits)
    try:
        return response_of_limits(dataset)
    except ValueError as error:
        raise CampaignError(f"{limits}: {error}") from None


class Firings(NamedTuple):
    """The shots of all tests, each of shape [tests, shots]: velocity [m/s], perforated, and whether it was fired."""

    velocity: Array
    perforated: NDArray[np.bool_]
    used: NDArray[np.bool_]


def fire(procedure: Procedure, limits: Array, errors: Array) -> Firings:
    """Fire all tests.

    Args:
        limits: limit velocity of the place that every shot hits [m/s], shape [tests, shots].
        errors: velocity of each shot minus the velocity aimed at [m/s], shape [tests, shots].
    """
    velocity = np.zeros(limits.shape)
    perforated, used = np.zeros((2, *limits.shape), dtype=bool)
    for test in range(len(limits)):
        shots = list[Shot]()
        while (aim := procedure.aim(shots)) is not None:
            place = test, len(shots)
            velocity[place] = max(aim + errors[place], _LEAST)
            perforated[place], used[place] = velocity[place] > limits[place], True
            shots.append(Shot(float(velocity[place]), bool(perforated[place])))
    return Firings(velocity, perforated, used)


def fired(test: FiringTest, procedure: Procedure, limits: Array) -> Firings:
    """Fire all tests at places that are drawn with equal probability."""
    shape = test.tests, procedure.most_shots
    places, velocities = (
        np.stack([stream(test.seed, (column, shot), 0, shape[0]) for shot in range(shape[1])], axis=1)
        for column in (_PLACES, _VELOCITIES)
    )
    return fire(procedure, limits[(places * len(limits)).astype(int)], test.gun.errors(velocities))


def reported(firings: Firings, procedure: Procedure) -> dict[Variable, Array]:
    """The report of every test [m/s], NaN where it has none: the mean of the standard, or the probit."""
    velocity, perforated, used = firings
    v50, spread, low, high = np.full((4, len(velocity)), np.nan)
    if isinstance(procedure, MilStd662F):
        for test, shots in enumerate(used):
            chosen = procedure.chosen([*map(Shot, velocity[test, shots], perforated[test, shots].tolist())])
            v50[test] = np.nan if chosen is None else np.mean(chosen)
    else:
        fit = fit_quantal(*firings)
        v50, spread = fit.location, fit.scale
        low, high = likelihood_interval(*firings, fit)
    return {f.V50: v50, f.SPREAD: spread, f.V50_LOW: low, f.V50_HIGH: high}


def simulate_test(test: FiringTest, response: Response) -> xarray.Dataset:
    """Fire a test many times at a target whose response is known."""
    limits, velocity = response.limits, _grid(response, test.proof)
    shares = [response.estimate(float(speed)) for speed in velocity]
    quantiles = [response.quantile(share) for share in QUANTILES]
    columns: dict[Variable, Any] = {
        f.VELOCITY: velocity,
        f.SHARE: [share.value for share in shares],
        f.SHARE_LOW: [share.low for share in shares],
        f.SHARE_HIGH: [share.high for share in shares],
        f.QUANTILE: np.array(QUANTILES),
        f.QUANTILE_VELOCITY: [quantile.value for quantile in quantiles],
        f.QUANTILE_LOW: [quantile.low for quantile in quantiles],
        f.QUANTILE_HIGH: [quantile.high for quantile in quantiles],
    }
    if test.procedure is not None:
        firings = fired(test, test.procedure, limits)
        columns |= reported(firings, test.procedure) | {
            f.SHOT_VELOCITY: np.where(firings.used, firings.velocity, np.nan),
            f.SHOT_PERFORATED: np.where(firings.used, firings.perforated, -1).astype(np.int8),
        }
    if test.proof is not None:
        shots, allowed = test.proof.shot_count, test.proof.allowed
        errors = test.gun.errors((np.arange(_NODES) + 0.5) / _NODES)
        by_place = np.array([(limits < (speed + errors)[:, None]).mean(axis=0) for speed in velocity])
        columns |= {
            f.PROOF_PERFORATION: by_place.mean(axis=1),
            f.PASS: acceptance(shots, allowed, by_place.mean(axis=1)),
            f.PASS_SAME_PLACE: acceptance(shots, allowed, by_place).mean(axis=-1),
        }
    v16, true, v84 = (response.quantile(float(special.ndtr(z))).value for z in (-1.0, 0.0, 1.0))
    attributes = {
        attr.KIND: FIRING.mark,
        attr.TITLE: test.title,
        attr.HISTORY: attr.history_line("test"),
        attr.WARPIMPACT_VERSION: attr.versions()[attr.WARPIMPACT_VERSION],
        f.TEST: test.text,
        f.SETTINGS: test.model_dump_json(exclude_none=True),
        f.TRUE_V50: true,
        f.TRUE_SPREAD: 0.5 * (v84 - v16),
    }
    if test.proof is not None:
        attributes[f.PROOF_SHOTS] = test.proof.shot_count
    return dataset_of(columns, f.FIXED | attributes)


def _grid(response: Response, proof: Proof | None) -> Array:
    """Velocities of the curves, from where nothing perforates to where all does. The proof's velocity is among them."""
    finite = response.limits[np.isfinite(response.limits)]
    of_proof = [] if proof is None else [proof.velocity]
    low, high = np.min([*finite, *of_proof]), np.max([*finite, *of_proof])
    margin = 0.05 * max(high - low, 0.02 * high)
    return np.unique([*np.linspace(max(1.0, low - margin), high + margin, _CURVE_POINTS), *of_proof])
