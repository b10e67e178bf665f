"""The limits of a campaign: for every hit the impact velocity, or the thickness of plate, that it just perforates."""

from __future__ import annotations

import json
import math
import time
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.analysis.survival import over_draws
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.posterior import Posterior
from warpimpact.campaign.text import CampaignError
from warpimpact.records.outcomes import Outcomes
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed
from warpimpact.results.limits import with_solid_limits
from warpimpact.results.measures import dealing
from warpimpact.results.table import Table
from warpimpact.runs.compute import HitMap, at_solid, described, pilot_of
from warpimpact.scene import Scene, Shots, Target
from warpimpact.solver.limit import (
    HIGHEST_VELOCITY,
    THICKEST,
    THICKNESS_TOLERANCE,
    VELOCITY_TOLERANCE,
    Limits,
    check_arrests,
    limit_thickness,
    limit_velocity,
    with_thickness,
    with_velocity,
)
from warpimpact.solver.limit_promise import PILOT, LimitPromise, keep_limits
from warpimpact.solver.marching import Progress
from warpimpact.solver.resolution import Fidelity
from warpimpact.statistics.intervals import Estimate, estimate_of

if TYPE_CHECKING:
    from warpimpact.results.table import Result

QUANTILES = {"V50": 0.5, "V05": 0.05}
"""Names of the velocities at which half and a twentieth of the hits perforate."""


@dataclass(frozen=True)
class LimitMap(HitMap):
    """What `warpimpact limit` computes of every hit.

    Attributes:
        quantity: "velocity" or "thickness".
        tolerance: how far the ends of a limit may lie apart [m/s] or [m].
        highest: largest value tried [m/s] or [m].
        layer: whose thickness it is; 0 is the plate.
    """

    quantity: str
    tolerance: float
    highest: float
    layer: int = 0
    most_solid = 256

    @classmethod
    def of(
        cls, campaign: Campaign, quantity: str = "velocity", tolerance: float | None = None, layer: int = 0
    ) -> LimitMap:
        """The job for a campaign, with the usual tolerance where none is given.

        Raises:
            CampaignError: the campaign has no limits, or this search cannot find them.
        """
        if campaign.stop is not None:
            raise CampaignError("got a stop rule, but limits are searched for every hit: leave out the table [stop]")
        if campaign.burst is not None:
            raise CampaignError("got a burst, but limits are searched for every hit alone: leave out the table [burst]")
        try:
            check_arrests(campaign.scene, campaign.sampler().shots(0, 1))
        except ValueError as error:
            raise CampaignError(str(error)) from None
        if quantity == "velocity":
            return cls(quantity, tolerance or VELOCITY_TOLERANCE, HIGHEST_VELOCITY)
        plates = campaign.target.layers
        if layer >= len(plates):
            raise CampaignError(f"got layer {layer}, but the target has layers 0 (the plate) to {len(plates) - 1}")
        return cls(quantity, tolerance or THICKNESS_TOLERANCE, THICKEST * plates[layer].thickness, layer)

    @property
    def content(self) -> Mapping[str, str]:
        """What decides the bits beside the campaign."""
        of_layer = f" of layer {self.layer}" if self.layer else ""
        return {"limit": f"{self.quantity}{of_layer} within {self.tolerance:g}, at most {self.highest:g}"}

    @property
    def measures(self) -> tuple[str, ...]:
        """The running estimates: the mean limit."""
        return (f"mean({v.LIMITS[self.quantity].value})",)

    def compute(self, campaign: Campaign, shots: Shots, **how: Any) -> Table:
        """Search the limits of some shots. The Dataset is that of the shots as they just perforate, with their limits.

        Args:
            shots: whole groups of images, as the campaign's sampler gives them.
            how: promise, solid, device, threads and progress as in `campaign.compute.compute`.
        """
        promise: LimitPromise | None = how["promise"]
        device, images = how.get("device", "auto"), len(campaign.symmetries)
        begin = time.perf_counter()
        limits = self._search_drawn(
            campaign.drawn,
            campaign.scene,
            shots[::images],
            campaign.numerics if promise is None else promise.fidelity,
            device=device,
            threads=how.get("threads"),
            progress=_of_images(how.get("progress"), images),
        )
        dataset = described(
            campaign,
            self._put(campaign, shots, limits, images),
            limits.outcomes.assign(**{name: getattr(limits, name.field) for name in v.LIMITS[self.quantity]}),
            numerics=campaign.numerics if promise is None else promise.fidelity,
            device=device,
            elapsed=time.perf_counter() - begin,
            attributes={
                attr.LIMIT: self.quantity,
                attr.LIMIT_LAYER: self.layer,
                **self.weights(campaign.target),
                attr.LIMIT_TOLERANCE: self.tolerance,
                attr.LIMIT_HIGHEST: self.highest,
            }
            | ({} if promise is None else _promised(promise)),
        )
        begun, *_ = dataset.attrs[attr.HISTORY].split()
        dataset.attrs[attr.HISTORY] = f"{begun} warpimpact limit --quantity {self.quantity}"
        return dataset if how.get("solid") is None else self._beside_solid(campaign, dataset, **how)

    def _beside_solid(self, campaign: Campaign, found: Table, **how: Any) -> Table:
        """The Dataset with the limits of some shots at the solid plate that is as heavy as the whole target."""
        plate, promise, progress, hits = campaign.target.solid, how["promise"], how.get("progress"), found.sizes["hit"]
        scene = campaign.scene.model_copy(update={"target": plate})
        begin = time.perf_counter()
        limits = replace(self, layer=0)._search_drawn(
            campaign.drawn,
            scene,
            at_solid(campaign, how["solid"]),
            campaign.numerics if promise is None else promise.fidelity,
            device=how.get("device", "auto"),
            threads=how.get("threads"),
            progress=progress and (lambda done, total: progress(hits, hits)),
        )
        highest = self.highest if self.quantity == "velocity" else THICKEST * plate.thickness
        told = {
            attr.SOLID_LIMIT_TIME: time.perf_counter() - begin,
            attr.SOLID_LIMIT_DENSITY: plate.density,
            attr.SOLID_LIMIT_HIGHEST: highest,
        }
        return with_solid_limits(found, self.quantity, limits).assign_attrs(attr.with_units(told))

    def promise_of(
        self, campaign: Campaign, device: str = "auto", progress: Progress | None = None
    ) -> LimitPromise | None:
        """What a pilot of the campaign's own hits finds; None if the campaign fixes the resolution itself."""
        if campaign.numerics.explicit is not None:
            return None
        pilot = pilot_of(campaign, PILOT)
        follow = progress and (lambda done, total: progress(0, len(pilot)))  # nothing new, but a place to stop

        def search(fidelity: Fidelity) -> Limits:
            return self._search(campaign.scene, pilot, fidelity, device=device, progress=follow)

        return keep_limits(search, campaign.numerics, squared=self.quantity == "thickness")

    def promise_in(self, dataset: Result) -> LimitPromise | None:
        """The promise with which a result was computed."""
        told = dataset.attrs
        if attr.LIMIT_RESOLUTION not in told:
            return None
        return LimitPromise(
            fidelity=Fidelity(**json.loads(told[attr.LIMIT_RESOLUTION])),
            kept=bool(told[attr.LIMIT_PROMISE_KEPT]),
            error=float(told[attr.LIMIT_ERROR_P90]),
            shown=told[attr.LIMIT_ERROR_SHOWN],
        )

    def weights(self, target: Target) -> dict[str, float]:
        """What turns the thickness of the layer into the areal density of the target; nothing of a velocity."""
        if self.quantity == "velocity":
            return {}
        layer = target.layers[self.layer]
        return {
            attr.LIMIT_DENSITY: layer.areal_density / layer.thickness,
            attr.LIMIT_ELSEWHERE: target.areal_density - layer.areal_density,
        }

    def _put(self, campaign: Campaign, shots: Shots, limits: Limits, images: int) -> Shots:
        """Shots, with their images, as they just perforate."""
        if self.quantity == "velocity":
            return with_velocity(shots, np.repeat(limits.shots.velocity, images))
        tried = limits.shots.own_of(campaign.target, "thickness", self.layer)
        return with_thickness(self.layer, shots, np.repeat(tried, images))

    def _search_drawn(
        self, drawn: Posterior | None, scene: Scene, shots: Shots, numerics: Any, progress: Progress | None, **how: Any
    ) -> Limits:
        """Limits of shots, some of which may need a scene of their own for their draw of a posterior."""
        if drawn is None or not drawn.of_scene:
            return self._search(scene, shots, numerics, progress=progress, **how)
        places: list[NDArray[np.int64]] = []
        parts: list[Limits] = []
        for which, own in drawn.scenes(scene, shots):
            follow = progress and _from(sum(map(len, places)), len(shots), progress)
            parts.append(self._search(own, shots[which], numerics, progress=follow, **how))
            places.append(which)
        order = np.argsort(np.concatenate(places), kind="stable")
        numbers = ("value", "lower", "upper", "runs", "converged")
        return Limits(
            **{name: np.concatenate([getattr(part, name) for part in parts])[order] for name in numbers},
            shots=Shots.joined([part.shots for part in parts])[order],
            outcomes=Outcomes.joined([part.outcomes for part in parts])[order],
        )

    def _search(self, scene: Scene, shots: Shots, numerics: Any, **how: Any) -> Limits:
        how |= {"numerics": numerics, "tolerance": self.tolerance}
        if self.quantity == "velocity":
            return limit_velocity(scene, shots, highest=self.highest, **how)
        return limit_thickness(scene, shots, layer=self.layer, **how)


def _from(before: int, total: int, progress: Progress) -> Progress:
    """The progress of a part of some shots, told as that of all of them."""
    return lambda done, _: progress(before + done, total)


def _of_images(progress: Progress | None, images: int) -> Progress | None:
    return progress and (lambda done, total: progress(done * images, total * images))


def _promised(promise: LimitPromise) -> dict[str, Any]:
    """What is told of a promise."""
    return {
        attr.LIMIT_RESOLUTION: json.dumps(asdict(promise.fidelity)),
        attr.LIMIT_PROMISE_KEPT: int(promise.kept),
        attr.LIMIT_ERROR_P90: promise.error,
        attr.LIMIT_ERROR_SHOWN: promise.shown,
    }


def told_of(campaign: Campaign, quantity: str) -> str | None:
    """What a user should know of a campaign whose limits are asked for."""
    if (quantity, 0) not in campaign.scatter.given:
        return None
    return (
        f"the {quantity} scatters in this campaign, but a limit {quantity} does not depend on that: the scatter only "
        "says where the searches begin"
    )


def quantiles(dataset: xarray.Dataset) -> dict[str, Estimate]:
    """V50 and V05 (of a thickness H50 and H05) with their 95 % intervals over the hits; infinite where so many hits
    have a limit beyond the largest value tried."""
    quantity, highest = dataset.attrs[attr.LIMIT], dataset.attrs[attr.LIMIT_HIGHEST]
    value = dataset[v.LIMITS[quantity].value].values
    counted = np.where(failed(dataset), np.nan, np.minimum(value, highest))
    found = {}
    for name, share in QUANTILES.items():
        estimate = estimate_of("quantile", counted, share=share, **dealing(dataset))
        ends = (estimate.value, estimate.low, estimate.high)
        estimate = over_draws(dataset, estimate, counted, units="m s-1", kind="quantile")
        value_, low, high = (math.inf if end >= highest else end for end in ends)
        found[name if quantity == "velocity" else f"H{name[1:]}"] = replace(estimate, value=value_, low=low, high=high)
    return found
