"""The gun, and the rules of fair hits: velocity and place of every shot."""

from __future__ import annotations

from typing import Annotated

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from scipy import special

from warpimpact.firing.response import Response
from warpimpact.scene.model import Array, Model
from warpimpact.scene.units import NonNegativeLength, PositiveAngle, PositiveLength, PositiveSpeed, Speed

Places = NDArray[np.int64]

_TRIALS, _ROUNDS = 64, 16
"""Places that are tried at a time for a shot on a panel, and number of such trials before a new panel is taken."""


class Gun(Model):
    """How well the velocity of a shot is met. It is measured exactly.

    Attributes:
        deviation: standard deviation from the velocity that was aimed at [m/s].
        window: largest difference of a fair hit from the velocity aimed at [m/s]; other shots are fired again.
    """

    deviation: Annotated[Speed, Field(ge=0)] = 0.0
    window: PositiveSpeed | None = None

    def errors(self, drawn: Array) -> Array:
        """Differences from the velocity aimed at [m/s] for uniform numbers in [0, 1): a normal distribution, cut at the
        window."""
        if self.deviation == 0.0:
            return np.zeros_like(drawn)
        share = np.clip(self.unfair / 2.0 + (1.0 - self.unfair) * drawn, 1e-15, 1.0 - 1e-15)
        return np.asarray(self.deviation * special.ndtri(share))

    @property
    def unfair(self) -> float:
        """Share of the shots that the window refuses."""
        if self.window is None or self.deviation == 0.0:
            return 0.0
        return 2.0 * float(special.ndtr(-self.window / self.deviation))


class FairHit(Model):
    """Rules of fair hits. A shot that breaks one is fired again at another place.

    Attributes:
        yaw: largest angle between core axis and line of fire [rad].
        panel: extent of a test panel along y and z [m]; the hits lie in its whole unit cells.
        edge: least distance from the edge of the panel [m].
        distance: least distance from all earlier hits on the panel [m].
        shots_per_panel: after which a new panel is taken.
    """

    yaw: PositiveAngle | None = None
    panel: tuple[PositiveLength, PositiveLength] | None = None
    edge: NonNegativeLength = 0.0
    distance: NonNegativeLength = 0.0
    shots_per_panel: Annotated[int, Field(strict=True, ge=1, le=1000)] | None = None

    @model_validator(mode="after")
    def _has_a_panel(self) -> FairHit:
        if self.panel is None:
            for name in ("edge", "distance", "shots_per_panel"):
                if name in self.model_fields_set:
                    raise ValueError(f"{name} needs panel, the extent of a test panel")
        elif 2.0 * self.edge >= min(self.panel):
            raise ValueError(f"got edge = {self.edge:g} m, but it must be less than half of the panel")
        return self


def fair_places(rules: FairHit, response: Response) -> Places:
    """The places whose yaw is fair.

    Raises:
        ValueError: there are none.
    """
    if rules.yaw is None:
        return np.arange(len(response))
    fair = np.flatnonzero(response.yaw <= np.degrees(rules.yaw) + 1e-9)
    if not len(fair):
        least, limit = response.yaw.min(), np.degrees(rules.yaw)
        raise ValueError(f"got fair_hit.yaw = {limit:g} deg, but the least yaw of the target's hits is {least:.3g} deg")
    return fair


def drawn_places(rules: FairHit, response: Response, drawn: Array, seed: int) -> Places:
    """The place that every shot hits, shape [tests, shots].

    Args:
        drawn: uniform numbers in [0, 1) of every shot. Without a panel a place follows from its number alone.

    Raises:
        ValueError: no place is fair, or the panel has none.
    """
    fair = fair_places(rules, response)
    if rules.panel is None:
        return np.asarray(fair[(drawn * len(fair)).astype(int)])
    if response.cell is None:
        raise ValueError("fair_hit.panel needs a target with hit points: a campaign, or a result of limits or a sweep")
    cells = [int(side / cell + 1e-9) for side, cell in zip(rules.panel, response.cell, strict=True)]
    if min(cells) < 1:
        raise ValueError("got fair_hit.panel smaller than one unit cell of the plate")
    return np.stack(
        [_on_panels(rules, response, fair, cells, drawn.shape[1], (seed, test)) for test in range(len(drawn))]
    )


def _on_panels(
    rules: FairHit, response: Response, fair: Places, cells: list[int], shots: int, key: tuple[int, int]
) -> Places:
    """The places of the shots of one test, one after another."""
    assert rules.panel is not None
    assert response.cell is not None
    seed, test = key
    rng = np.random.Generator(np.random.Philox(np.random.SeedSequence(seed, spawn_key=(3, test))))
    half = 0.5 * np.array(rules.panel) - rules.edge
    cell, most = np.array(response.cell), rules.shots_per_panel or shots
    hit_of, points = np.empty(shots, dtype=np.int64), list[Array]()
    for shot in range(shots):
        if len(points) == most:
            points.clear()
        for trial in range(_ROUNDS):
            places = fair[rng.integers(0, len(fair), _TRIALS)]
            corner = (rng.integers(0, cells, (_TRIALS, 2)) + 0.5 - 0.5 * np.array(cells)) * cell
            at = corner + np.stack([response.hit_y[places], response.hit_z[places]], axis=1)
            good = (np.abs(at) <= half).all(axis=1)
            if points:
                apart = np.linalg.norm(at[:, None] - np.array(points)[None], axis=-1).min(axis=1)
                good &= apart >= rules.distance
            if good.any():
                break
            if trial == _ROUNDS - 2:
                points.clear()  # the panel is full
        else:
            raise ValueError("got rules of fair hits by which no place of the panel is fair")
        first = int(good.argmax())
        hit_of[shot] = places[first]
        points.append(at[first])
    return hit_of
