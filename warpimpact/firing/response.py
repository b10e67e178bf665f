"""The response of a target: the probability that a shot perforates, against the impact velocity.

The response follows from places. A place is one hit of a campaign with its attitude and material, and its answer
depends
on the velocity alone. Where a limit velocity is unique the answer changes once, at the limit; a sweep of velocities may
find several changes.
"""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
import xarray
from numpy.typing import NDArray
from scipy import special

from warpimpact.analysis.proxy import inclination
from warpimpact.kernels.status import Status
from warpimpact.records.group import failures
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed
from warpimpact.results.outlines import outlines
from warpimpact.results.tallies import dealing
from warpimpact.scene.model import Array
from warpimpact.statistics.intervals import Dealing, Estimate, estimate_of

Flags = NDArray[np.bool_]

_KNOWN_PLACES = 4000
"""Number of places of a response that is given as a distribution: its quantiles at even distances."""


@dataclass(frozen=True)
class Response:
    """The answers of all places.

    Attributes:
        changes: velocities [m/s] at which the answer changes, ascending, infinite where there are fewer; below the
            first the target stops. Shape [places, changes].
        hit_y, hit_z: hit points [m], shape [places].
        yaw: angle between core axis and line of fire at impact [degree], shape [places].
        cell: extent along y and z of the unit cell that the hits cover [m]; None for a response without places.
        dealt: how places are dealt to the replicates of the sampling (`results.measures.dealing`).
        outline: outlines of the holes in the cell, y and z [m], separated by NaN.
        evidence: what the limits rest on, one line each, the summary first; empty if the target itself is known.
    """

    changes: Array
    hit_y: Array
    hit_z: Array
    yaw: Array
    cell: tuple[float, float] | None
    dealt: Dealing
    outline: tuple[Array, Array] = (np.empty(0), np.empty(0))
    evidence: str = ""

    def __len__(self) -> int:
        return len(self.changes)

    @property
    def unique(self) -> bool:
        """Whether every place has at most one limit velocity."""
        return bool(self.changes.shape[1] == 1)

    def perforates(self, place: NDArray[np.int64], velocity: Array) -> Flags:
        """Whether shots perforate; any shape."""
        return np.asarray((self.changes[place] < velocity[..., None]).sum(axis=-1) % 2 == 1)

    def answers(self, velocity: float) -> Array:
        """1 for every place that perforates at this velocity, else 0."""
        return self.perforates(np.arange(len(self)), np.full(len(self), velocity)).astype(float)

    def by_place(self, velocity: Array, errors: Array) -> Array:
        """Probability of perforation at every place, shape [velocities, places].

        Args:
            errors: equally probable differences from the velocity [m/s].
        """
        places = np.arange(len(self))
        tried = np.asarray(velocity)[:, None] + errors
        return np.stack([self.perforates(places, of_one[:, None]).mean(axis=0) for of_one in tried])

    def estimate(self, velocity: float) -> Estimate:
        """The probability of perforation with its 95 % interval over the places."""
        return estimate_of("share", self.answers(velocity), **self.dealt)

    def quantile(self, share: float) -> float:
        """The least velocity at which this share of the places perforates; infinite if none does."""
        if self.unique:
            finite = np.sort(self.changes[:, 0])
            place = share * len(finite) - 0.5  # Hazen's plotting position
            low, high = finite[max(0, int(np.floor(place)))], finite[min(len(finite) - 1, int(np.floor(place)) + 1)]
            return (
                float(low + (place - np.floor(place)) * (high - low)) if np.isfinite(high) and place > 0 else float(low)
            )
        velocity, answers = self._steps
        reached = np.flatnonzero(answers >= share - 1e-12)
        return float(velocity[reached[0]]) if len(reached) else float("inf")

    @cached_property
    def _steps(self) -> tuple[Array, Array]:
        """Velocities of all changes, and the share just above each."""
        sign = np.broadcast_to(np.where(np.arange(self.changes.shape[1]) % 2 == 0, 1.0, -1.0), self.changes.shape)
        known = np.isfinite(self.changes)
        order = np.argsort(self.changes[known], kind="stable")
        return self.changes[known][order], np.cumsum(sign[known][order]) / len(self)

    def quantile_estimate(self, share: float) -> Estimate:
        """`quantile` with its 95 % interval over the places; NaN where an end is not determined. No interval is known
        for several changes."""
        value = self.quantile(share)
        if not self.unique or self.cell is None:
            return Estimate(value, np.nan, np.nan, len(self), np.nan)
        finite = np.minimum(self.changes[:, 0], 1e9)
        estimate = estimate_of("quantile", finite, share=share, **self.dealt)
        low, high = (end if end < 1e8 else np.inf for end in (estimate.low, estimate.high))
        return Estimate(value, low, high, len(self), estimate.spread)

    @property
    def spread(self) -> float:
        """Half of the distance from V16 to V84 [m/s]: the standard deviation of a normal response."""
        low, high = (self.quantile(float(special.ndtr(z))) for z in (-1.0, 1.0))
        return 0.5 * (high - low)

    def only(self, which: Flags) -> Response:
        """Some of the places. They are no longer in the order of the replicates."""
        return replace(
            self,
            changes=self.changes[which],
            hit_y=self.hit_y[which],
            hit_z=self.hit_z[which],
            yaw=self.yaw[which],
            dealt={"replicates": 1, "images": 1},
        )


def known_response(velocities: Sequence[float], shares: Sequence[float]) -> Response:
    """The response of known limit velocities, each with its share of the hits."""
    counts = np.diff(np.round(_KNOWN_PLACES * np.cumsum([0.0, *shares]) / np.sum(shares))).astype(int)
    return _without_places(np.repeat(np.asarray(velocities, dtype=float), counts))


def normal_response(mean: float, deviation: float) -> Response:
    """The response of normally distributed limit velocities."""
    return _without_places(mean + deviation * special.ndtri((np.arange(_KNOWN_PLACES) + 0.5) / _KNOWN_PLACES))


def _without_places(limits: Array) -> Response:
    zeros = np.zeros(len(limits))
    return Response(limits[:, None], zeros, zeros, zeros, None, {"replicates": 1, "images": 1})


def response_of_limits(dataset: xarray.Dataset) -> Response:
    """The response in a result of `warpimpact limit`.

    Raises:
        ValueError: the result has limits of thickness.
    """
    if dataset.attrs.get(attr.LIMIT) != "velocity":
        raise ValueError("is no result of a search of limit velocities, as warpimpact limit writes")
    sound = ~failed(dataset)
    if not sound.any():
        raise ValueError("has no limit velocity: all searches have failed")
    limits = dataset[v.LIMITS["velocity"].value].values.astype(float)[:, None]
    response = _with_places(dataset, limits, np.ones_like(sound))
    return response if sound.all() else response.only(sound)


def response_of_sweep(sweep: xarray.Dataset, layer: int | None = None) -> Response:
    """The response in a sweep of the impact velocity. A change lies in the middle between two velocities.

    Args:
        layer: the layer that must hold, 0 is the plate; None is the last one.

    Raises:
        ValueError: the sweep is of another input, or of several.
    """
    names = list(json.loads(sweep.attrs[attr.SWEEP]))
    if (
        len(names) != 1
        or sweep[names[0]].dims != (names[0],)
        or sweep[names[0]].attrs.get("long_name") != "impact.velocity"
    ):
        raise ValueError(f"sweeps {' and '.join(names)}, but it must sweep impact.velocity alone")
    along = names[0]
    if layer is not None and v.LAYER_STATUS not in sweep.variables:
        raise ValueError("has one plate, so it cannot say how another layer holds")
    ended = sweep[v.STATUS] if layer is None else sweep[v.LAYER_STATUS].isel(layer=layer)
    velocity = sweep[along].values.astype(float)
    order = np.argsort(velocity)
    velocity, status = velocity[order], ended.transpose(v.HIT, along).values[:, order]
    through = (status == Status.PERFORATED) | (status == Status.MISSED)
    sound = np.asarray(~failures(status).any(axis=1))
    before = np.concatenate([np.zeros((len(through), 1), dtype=bool), through[:, :-1]], axis=1)
    middle = np.concatenate([[0.0], 0.5 * (velocity[1:] + velocity[:-1])])
    changes = np.sort(np.where(through != before, middle, np.inf), axis=1)
    most = max(1, int(np.isfinite(changes).sum(axis=1).max()))
    return _with_places(sweep.isel({along: 0}), changes[:, :most], sound)


def _with_places(dataset: xarray.Dataset, changes: Array, sound: Flags) -> Response:
    if not np.isfinite(changes[sound]).any():
        raise ValueError("has no limit velocity: no hit perforates at any velocity that was tried")
    cell, holes = dataset.attrs[attr.PLATE_PERIOD], outlines(dataset)
    response = Response(
        changes,
        hit_y=dataset[v.HIT_Y].values,
        hit_z=dataset[v.HIT_Z].values,
        yaw=np.degrees(inclination(dataset)),
        cell=(float(cell[0]), float(cell[1])),
        dealt=dealing(dataset),
        outline=(holes["y"], holes["z"]),
        evidence=dataset.attrs.get(attr.EVIDENCE, ""),
    )
    return response if sound.all() else response.only(sound)
