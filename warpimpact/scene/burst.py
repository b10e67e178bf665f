"""Burst: several shots at one and the same plate, and how their hits lie (docs/model.md §8)."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, Self

import numpy as np
from pydantic import Field, model_validator

from .distributions import EDGE, AnyDistribution, Distribution, normal_quantile
from .exclusions import BURST, HIT_SCATTER, IRREDUCIBLE, OFFSETS, SPACING, check_together
from .model import Array
from .plate import Plate
from .quantities import DRAWN, QUANTITIES, Quantity, drawn_column
from .sampling import Sampler, stream
from .scatter import Scatter, Scattering
from .shots import Hits, Impact, Shots
from .units import Length

_BURST = 2**20
"""First part of the keys of random numbers for the later shots of bursts; other keys begin with a column."""
_DISTANCE, _DIRECTION, _ALONG_Y, _ALONG_Z = range(DRAWN, DRAWN + 4)
"""Columns of the random numbers that place the hits, after those of the quantities."""
_NonNegativeLength = Annotated[Length, Field(ge=0)]


def _or_one_length(schema: dict[str, Any]) -> None:
    """Allow a single length in the JSON schema."""
    schema["anyOf"].append({"type": ["number", "string"], "unit": "m"})


class Burst(Scattering):
    """Consecutive shots at one plate: their number, and where they hit. Every sample is a fresh plate.

    Attributes:
        count: shots at a plate; offsets give it, too.
        spacing: distance of each hit from the previous one [m], in a random direction: a distribution or a number. The
            first hit is the aim.
        offsets: place (y, z) of each hit from the aim [m].
        scatter: standard deviations (y, z) of every hit about its place [m], or one number for both.
    """

    _quantities = {"spacing": Quantity("burst", _NonNegativeLength)}  # noqa: RUF012 (pydantic keeps it private)

    count: Annotated[int, Field(strict=True, ge=2, le=100)]
    spacing: Annotated[AnyDistribution | None, Field(json_schema_extra=_or_one_length)] = None
    offsets: Annotated[tuple[tuple[Length, Length], ...], Field(fail_fast=True)] | None = None
    scatter: Annotated[
        tuple[_NonNegativeLength, _NonNegativeLength] | None, Field(json_schema_extra=_or_one_length)
    ] = None

    @model_validator(mode="before")
    @classmethod
    def _of_short_forms(cls, values: Any) -> Any:
        """Count the offsets, and take one length as a spacing or as both standard deviations."""
        if not isinstance(values, dict):
            return values
        offsets, spacing, scatter = (values.get(name) for name in ("offsets", "spacing", "scatter"))
        short: dict[str, Any] = {}
        if "count" not in values and isinstance(offsets, list | tuple):
            short["count"] = len(offsets)
        if spacing is not None and not isinstance(spacing, dict | Distribution):
            short["spacing"] = {"distribution": "discrete", "values": [spacing]}
        if scatter is not None and not isinstance(scatter, list | tuple):
            short["scatter"] = (scatter, scatter)
        return values | short

    @model_validator(mode="after")
    def _lie_somewhere(self) -> Self:
        if self.spacing is None and self.offsets is None and self.scatter is None:
            raise ValueError("needs spacing, offsets or scatter, which say how the hits lie")
        given = {SPACING: self.spacing is not None, OFFSETS: self.offsets is not None}
        check_together(given | {HIT_SCATTER: self.scatter is not None})
        if self.offsets is not None and len(self.offsets) != self.count:
            raise ValueError(f"got count = {self.count} and {len(self.offsets)} offsets, but each shot needs its own")
        return self

    @property
    def reach(self) -> float:
        """Largest distance of a hit from the aim, along y or z [m]."""
        if self.spacing is not None:
            return (self.count - 1) * float(self.spacing.quantile(np.array(1.0 - EDGE)))
        placed = max((abs(at) for offset in self.offsets or () for at in offset), default=0.0)
        return placed + float(normal_quantile(np.array(1.0 - EDGE))) * max(self.scatter or (0.0,))

    def places(self, seed: int, first: int, samples: int) -> tuple[Array, Array]:
        """Places of the hits of some samples, from number `first` on, relative to their aims, y and z [m], shape
        [samples, count] each."""
        shape = samples, self.count

        def drawn(column: int) -> Array:
            return draws(seed, column, first * self.count, samples * self.count).reshape(shape)

        if self.spacing is not None:
            distance, angle = self.spacing.quantile(drawn(_DISTANCE)), 2.0 * np.pi * drawn(_DIRECTION)
            distance[:, 0] = 0.0
            return (distance * np.cos(angle)).cumsum(axis=1), (distance * np.sin(angle)).cumsum(axis=1)
        places = np.zeros((self.count, 2)) if self.offsets is None else np.array(self.offsets)
        std_y, std_z = self.scatter or (0.0, 0.0)
        y, z = np.broadcast_to(places[:, 0], shape), np.broadcast_to(places[:, 1], shape)
        return y + std_y * normal_quantile(drawn(_ALONG_Y)), z + std_z * normal_quantile(drawn(_ALONG_Z))


class BurstSampler(Sampler):
    """The shots of a campaign of bursts of n shots: shot k is number k mod n of the burst at plate k // n.

    `hits` give the aim of every burst and the quantities of its plate. Quantities of a shot are drawn for each shot and
    depend on the seed and the number of the shot alone. The first shot of a burst equals the shot at its aim in a
    campaign without bursts.

    Raises:
        ValueError: `hits.irreducible`, and as a `Sampler`.
    """

    def __init__(
        self,
        impact: Impact,
        hits: Hits,
        plate: Plate,
        burst: Burst,
        *,
        scatter: Scatter | None = None,
        replicates: int = 1,
    ) -> None:
        check_together({BURST: True, IRREDUCIBLE: hits.irreducible})
        super().__init__(impact, hits, plate, scatter, replicates)
        self._burst = burst

    def __len__(self) -> int:
        return self._burst.count * super().__len__()

    def shots(self, first: int, count: int) -> Shots:
        per_plate, count = self._burst.count, min(count, len(self) - first)
        sample, skipped = divmod(first, per_plate)
        samples = -(-(skipped + count) // per_plate)
        aims = super().shots(sample, samples)
        y, z = self._burst.places(self._hits.seed, sample, samples)
        hits = np.stack([aims.hit_y[:, None] + y, aims.hit_z[:, None] + z], axis=-1)
        at_aim = aims[np.repeat(np.arange(samples), per_plate)]
        order = np.tile(np.arange(per_plate), samples)
        shots = replace(
            at_aim,
            **self._of_later_shots(at_aim, order, sample * per_plate),
            hit_y=hits[..., 0].ravel(),
            hit_z=hits[..., 1].ravel(),
            sample=sample + np.repeat(np.arange(samples), per_plate),
            burst_order=order,
            nearest_earlier_hit=_nearest_earlier(hits).ravel(),
        )
        return shots[skipped : skipped + count]

    def _of_later_shots(self, shots: Shots, order: Any, first: int) -> dict[str, Array]:
        """Quantities that differ from shot to shot, with new draws for all but the first shots of bursts."""
        listed = self._hits.listed or {}
        return {
            name: np.where(
                order == 0,
                shots.columns[name],
                distribution.quantile(draws(self._hits.seed, drawn_column(name), first, len(shots))),
            )
            for (name, _), distribution in self._scatter.items()
            if not QUANTITIES[name].by_layer and name not in listed
        }


def draws(seed: int, column: int, first: int, count: int) -> Array:
    """Independent uniform numbers of a column, shape [count]: shot k has draw k."""
    return np.clip(stream(seed, (_BURST, column), first, count), EDGE, 1.0 - EDGE)


def _nearest_earlier(hits: Array) -> Array:
    """Distance of every hit from the nearest earlier one of its burst [m], shape [bursts, n], NaN for the first; `hits`
    has the shape [bursts, n, 2]."""
    nearest = np.full(hits.shape[:2], np.nan)
    for order in range(1, hits.shape[1]):
        nearest[:, order] = np.linalg.norm(hits[:, :order] - hits[:, order, None], axis=-1).min(axis=1)
    return nearest
