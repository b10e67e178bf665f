"""What a search may ask of a design: names of the measures of `warpimpact inspect`, and areal density."""

from __future__ import annotations

from typing import NamedTuple

AREAL_DENSITY = "areal_density"
WORST_TENTH = "_worst_tenth"


class Kind(NamedTuple):
    """A measure by its name.

    Attributes:
        higher_is_better: for whoever is behind the plate.
        is_share: whether it is a share of the shots, which has no worst tenth.
        needs: what a campaign needs to have it: "standoff", "layer", "bending" or "".
        is_limit: whether a search of limits tells it.
    """

    higher_is_better: bool
    is_share: bool
    needs: str = ""
    is_limit: bool = False


class Key(NamedTuple):
    """What tells two effects of a design file apart: the name, the angle [rad] and the stand-off [m] of what is tilted,
    and the layer whose thickness is a limit."""

    effect: str
    angle: float
    standoff: float | None
    layer: int

    @property
    def is_limit(self) -> bool:
        return EFFECTS[self.effect].is_limit


EFFECTS = {
    "residual_energy_fraction": Kind(False, False),
    "residual_energy_density": Kind(False, False, "standoff"),
    "tilted_share": Kind(True, True, "standoff"),
    "stopped_share": Kind(True, True),
    "broken_share": Kind(True, True, "bending"),
    "stopped_or_broken_share": Kind(True, True, "bending"),
    "base_perforated_share": Kind(False, True, "layer"),
    "base_pierced_share": Kind(False, True, "layer"),
    "base_depth": Kind(False, False, "layer"),
    "limit_velocity": Kind(True, False, is_limit=True),
    "limit_thickness": Kind(False, False, is_limit=True),
    "limit_areal_density": Kind(False, False, is_limit=True),
}
"""Measures of analysis/effects.py by their names."""


def names() -> list[str]:
    """All that a design file may name."""
    tenths = [name + WORST_TENTH for name, kind in EFFECTS.items() if not kind.is_share]
    return [AREAL_DENSITY, *EFFECTS, *tenths]


def effect_of(measure: str) -> str:
    """The effect that a measure is made of."""
    return measure.removesuffix(WORST_TENTH)


def higher_is_better(measure: str) -> bool:
    """Of a measure by its name."""
    return measure != AREAL_DENSITY and EFFECTS[effect_of(measure)].higher_is_better
