"""The limits of a campaign: for every hit the impact velocity, or the thickness of plate, that it just perforates."""

from __future__ import annotations

import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, ClassVar

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.resistances import limit_velocity_factors, resistance_by_thickness
from warpimpact.campaign.text import CampaignError
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.measures import Measure
from warpimpact.results.table import HitTable
from warpimpact.results.vocabulary import LIMIT_VELOCITY
from warpimpact.runs.compute import Report, numerics_of, pilot_shots
from warpimpact.runs.describe import described
from warpimpact.scene import Shots, Target, exclusions
from warpimpact.solver.accuracy import PILOT_LIMITS, PilotResult, pilot_size
from warpimpact.solver.limit import (
    HIGHEST_VELOCITY,
    PASSAGES,
    THICKNESS_TOLERANCE,
    VELOCITY_TOLERANCE,
    LimitSpec,
    check_arrests,
    limits,
    pilot_of_limits,
    short_steps,
    thickest,
)
from warpimpact.solver.worker import Worker

if TYPE_CHECKING:
    pass


@dataclass(frozen=True)
class LimitMap:
    """The limit of every hit, as a `runs.compute.Computation` for `warpimpact limit`.

    A limit depends on its hit alone.
    """

    spec: LimitSpec
    reference_hits: ClassVar[int] = 256
    passages: ClassVar[int] = PASSAGES

    @classmethod
    def of(
        cls, campaign: Campaign, quantity: str = "velocity", tolerance: float | None = None, layer: int = 0
    ) -> LimitMap:
        """The computation for a campaign, with the default tolerance if none is given.

        Raises:
            CampaignError: the campaign has no limits, or this search cannot find them.
        """
        try:
            stop = {exclusions.STOP: campaign.stop is not None}
            exclusions.check_together({exclusions.LIMIT_COMMAND: True} | stop)
            check_arrests(campaign.scene, campaign.sampler().shots(0, 1))
        except ValueError as error:
            raise CampaignError(str(error)) from None
        if quantity == "velocity":
            return cls(LimitSpec(quantity, tolerance or VELOCITY_TOLERANCE, HIGHEST_VELOCITY))
        plates = campaign.target.layers
        if layer >= len(plates):
            raise CampaignError(f"got layer {layer}, but the target has layers 0 (the plate) to {len(plates) - 1}")
        highest = thickest(campaign.scene, layer)
        curve = resistance_by_thickness(campaign, layer, highest)
        return cls(LimitSpec(quantity, tolerance or THICKNESS_TOLERANCE, highest, layer, curve))

    def check(self, texts: Sequence[str]) -> None:
        """Refuse measures that this search does not give.

        Raises:
            CampaignError: the message names the measure.
        """
        for text in texts:
            try:
                measure = Measure.parse(text)
            except ValueError as error:
                raise CampaignError(f"--measure: {error}") from None
            of_velocities = measure.quantity.need is LIMIT_VELOCITY
            if not measure.is_limit or of_velocities != (self.spec.quantity == "velocity"):
                raise CampaignError(
                    f"--measure: {text} is not told by a search of each hit's limit {self.spec.quantity}"
                )

    @property
    def content(self) -> Mapping[str, str]:
        """What determines the bits beside the campaign."""
        spec = self.spec
        of_layer = f" of layer {spec.layer}" if spec.layer else ""
        curve = ", with the resistance of each thickness" if spec.by_thickness else ""
        return {"limit": f"{spec.quantity}{of_layer} within {spec.tolerance:g}, at most {spec.highest:g}{curve}"}

    @property
    def measures(self) -> tuple[str, ...]:
        """The running estimates: the mean limit."""
        return (f"mean({v.LIMITS[self.spec.quantity].value})",)

    def of_reference(self, campaign: Campaign, name: str) -> LimitMap | None:
        """See `Computation.of_reference`. The thickness of a layer in front of the base is none of the base alone."""
        spec, base = self.spec, len(campaign.layer)
        if name == "base_alone":
            searched = spec.quantity == "velocity" or spec.layer == base
            return replace(self, spec=replace(spec, layer=0)) if searched else None
        if spec.quantity == "velocity":
            return self
        solid = campaign.references[name]
        highest = thickest(solid.scene, spec.layer)
        curve = resistance_by_thickness(solid, spec.layer, highest)
        return replace(self, spec=replace(spec, highest=highest, by_thickness=curve))

    def compute(
        self,
        campaign: Campaign,
        shots: Shots,
        pilot: PilotResult | None,
        worker: Worker,
        report: Report = lambda done: None,
    ) -> HitTable:
        """Search the limits of some shots. The table has the shots as they just perforate, with their limits."""
        spec, numerics = self.spec, numerics_of(campaign, pilot)
        progress = lambda done, total: report(done)  # noqa: E731
        begin = time.perf_counter()
        searched = limits(campaign.scene, shots, spec, numerics, worker, progress)
        elapsed = time.perf_counter() - begin
        attributes = {
            attr.HISTORY: attr.history_line(f"limit --quantity {spec.quantity}"),
            attr.LIMIT: spec.quantity,
            attr.LIMIT_LAYER: spec.layer,
            **self.weights(campaign.target),
            attr.LIMIT_TOLERANCE: spec.tolerance,
            attr.LIMIT_HIGHEST: spec.highest,
        }
        if spec.quantity == "velocity" and (factors := limit_velocity_factors(campaign)) is not None:
            attributes[attr.LIMIT_FACTORS] = list(factors)
        tried = searched.shots.velocity
        if spec.quantity == "thickness":
            tried = searched.shots.layer_value(campaign.target, "thickness", spec.layer)
        put = spec.with_trial(campaign.target, shots, tried)
        outcomes, by = searched.recorded(spec.quantity), (worker.device, elapsed)
        return described(campaign, put, pilot, outcomes, short_steps(numerics), by, attributes)

    def pilot(self, campaign: Campaign, worker: Worker, report: Report = lambda level: None) -> PilotResult | None:
        """See `Computation.pilot`."""
        if campaign.numerics.explicit is not None:
            return None
        pilot, numbers = pilot_shots(campaign, pilot_size(campaign.numerics.asked, PILOT_LIMITS))
        errors = pilot_of_limits(campaign.scene, pilot, self.spec, campaign.numerics, worker, report)
        return replace(errors, numbers=numbers)

    def weights(self, target: Target) -> dict[str, float]:
        """Attributes that convert the thickness of the layer to the areal density of the target; none for a
        velocity."""
        if self.spec.quantity == "velocity":
            return {}
        layer = target.layers[self.spec.layer]
        return {
            attr.LIMIT_DENSITY: layer.areal_density / layer.thickness,
            attr.LIMIT_ELSEWHERE: target.areal_density - layer.areal_density,
        }


def warning_of(campaign: Campaign, quantity: str) -> str | None:
    """A warning about a campaign whose limits are searched; None if there is nothing to warn of."""
    if (quantity, 0) not in campaign.scatter.given:
        return None
    return (
        f"the {quantity} scatters in this campaign, but a limit {quantity} does not depend on that: the scatter only "
        "says where the searches begin"
    )
