"""The table [assumptions] of a campaign: what nobody measured, and what it may be instead (docs/assumptions.md)."""

from __future__ import annotations

import math
from typing import Annotated

from pydantic import Field

from ..scene.model import Model
from ..scene.units import NonNegativeNumber, Number, Obliquity, PositiveStress, Tilt

_Few = Field(fail_fast=True, max_length=8)
_Factor = Annotated[Number, Field(gt=0, le=10)]


class Assumptions(Model):
    """How much every number of a result changes under other assumptions about what nobody measured.

    Each value is an alternative of its own; all else stays as in the campaign. An empty list leaves its row out. A
    value that the campaign itself has, that scatters or that is drawn from a posterior is no alternative.

    Attributes:
        compute: whether alternatives are computed; by default only where a pilot finds the resolution.
        hits: most hits of each alternative. By default they are a 128th of the run's, but 64 to 256, and fewer where a
            hit takes long (docs/certainty.md has what they cost).
        resistance: factors of the resistance Y of all layers. By default they are the ends of the catalogue's 90 %
            interval where Y is the catalogue's, and 0.7 and 1.3 where it is yours.
        degradation: β of the layers that weaken; by default 1. Plates with holes that do not weaken get the paper's 0.8
            in 1 µs.
        rate: factors of how fast a plate weakens, ln β per time or distance.
        reach: factors of the length and the depth over which a plate weakens.
        shear_coefficient: η of all layers.
        onset: κ of the law of stress.
        edges: whether less resistance near the edges of holes is an alternative (docs/model.md §4.9).
        obliquity, yaw: by how much the shot is more oblique, and the core more yawed [rad].
        standoff: factors of the stand-offs.
        strength: of a core that the campaign takes to be unbreakable [Pa]; it tells how many cores would break.
    """

    compute: Annotated[bool, Field(strict=True)] | None = None
    hits: Annotated[int, Field(strict=True, ge=8, le=2**16)] | None = None
    resistance: Annotated[tuple[_Factor, ...], _Few] | None = None
    degradation: Annotated[tuple[Annotated[Number, Field(ge=0, le=1)], ...], _Few] = (1.0,)
    rate: Annotated[tuple[_Factor, ...], _Few] = (0.5, 2.0)
    reach: Annotated[tuple[_Factor, ...], _Few] = (0.5, 2.0)
    shear_coefficient: Annotated[tuple[NonNegativeNumber, ...], _Few] = (0.0, 0.1)
    onset: Annotated[tuple[NonNegativeNumber, ...], _Few] = (0.0, 0.02)
    edges: Annotated[bool, Field(strict=True)] = True
    obliquity: Annotated[tuple[Obliquity, ...], _Few] = (math.radians(5.0),)
    yaw: Annotated[tuple[Tilt, ...], _Few] = (math.radians(2.0),)
    standoff: Annotated[tuple[_Factor, ...], _Few] = (0.5,)
    strength: Annotated[tuple[PositiveStress, ...], _Few] = (3.0e9,)
