"""A fit: measured shots, their scenes, and priors of the unknown numbers (fit_file.py reads it)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path as FilePath
from typing import Annotated, Any

import numpy as np
from pydantic import Field

from warpimpact.identification.measured import HitPlace, Observation
from warpimpact.identification.parameters import Parameter, Path, as_read, put
from warpimpact.scene import Impact, Interaction, Numerics, Plate, Record, Scatter, Scene, Target
from warpimpact.scene.model import Model
from warpimpact.scene.units import Whole


class Sampling(Model):
    """How much is computed.

    Attributes:
        sets: most sets of parameters.
        hits: hit points per set over the part of the cell that differs.
        draws: draws of the posterior in the file.
        effective: effective sample size of every parameter at which the sampling ends.
        seed: seed of all random numbers.
    """

    sets: Annotated[Whole, Field(ge=64, le=2**24)] = 16384
    hits: Annotated[Whole, Field(ge=32, le=2**16, multiple_of=8)] = 256
    draws: Annotated[Whole, Field(ge=50, le=2**16)] = 1000
    effective: Annotated[Whole, Field(ge=10, le=2**16)] = 400
    seed: Annotated[Whole, Field(ge=0, lt=2**63)] = 0


@dataclass(frozen=True)
class MeasuredShot:
    """A fired shot and its measurements.

    Attributes:
        hit: place of its hit; None if unknown.
        impact, scatter: how the core arrived, and the uncertainty of that.
        tables: tables of its scene, with the medians of the priors.
        own: paths of the values that the shot itself gives, for which no prior counts.
        observations: measured numbers.
        status: how it ended; None if not reported.
    """

    name: str
    hit: HitPlace | None
    impact: Impact
    scatter: Scatter
    tables: Mapping[str, Any]
    own: frozenset[Path]
    observations: tuple[Observation, ...]
    status: str | None


@dataclass(frozen=True)
class Fit:
    """Measured shots, and what is unknown.

    Attributes:
        parameters: unknown numbers of the scene, and the scales of discrepancy that the observations need. Those that
            need a scene of their own come first.
        discrepancy: fixed standard deviations of the model's error, by kind of observation.
    """

    title: str
    text: str
    folder: FilePath
    parameters: tuple[Parameter, ...]
    discrepancy: Mapping[str, float]
    record: Record
    numerics: Numerics
    sampling: Sampling
    shots: tuple[MeasuredShot, ...]
    warnings: tuple[str, ...] = field(default=())

    @property
    def scene_parameters(self) -> tuple[Parameter, ...]:
        return tuple(parameter for parameter in self.parameters if parameter.path[0] != "discrepancy")

    def largest_discrepancy(self, kind: str) -> float:
        """The discrepancy of a kind that its prior exceeds in 1 of 100 draws."""
        priors = (parameter.prior for parameter in self.parameters if parameter.path == ("discrepancy", kind))
        return max((float(prior.quantile(np.array(0.99))) for prior in priors), default=self.discrepancy.get(kind, 0.0))

    def scene_of(self, shot: MeasuredShot, values: Mapping[Path, float] | None = None) -> Scene:
        """The scene of a shot at these values of the parameters, at the medians of the others.

        Raises:
            ValidationError: such a scene is not possible.
        """
        tables: Mapping[str, Any] = shot.tables
        for unknown in self.scene_parameters:
            if values is not None and unknown.path in values and unknown.path not in shot.own:
                tables = put(tables, unknown.path, as_read(unknown, float(values[unknown.path])))
        context = {"folder": self.folder}
        target = Target(layers=(Plate.model_validate(tables["plate"], context=context),))
        interaction = Interaction.model_validate(tables.get("interaction", {}), context=context)
        parts = {"core": tables["core"], "target": target, "interaction": interaction, "record": self.record}
        return Scene.model_validate(parts, context=context)
