"""What a search may ask of a design: the effects of analysis/vocabulary.py, their worst tenths, and areal density."""

from __future__ import annotations

import math
from typing import NamedTuple

from warpimpact.analysis.vocabulary import EFFECTS, SHOWN_UNITS, WORST_TENTH, angle_text, layer_text, length_text

AREAL_DENSITY = "areal_density"


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


def names() -> list[str]:
    """All that a design file may name."""
    tenths = [name + WORST_TENTH.name for name, effect in EFFECTS.items() if effect.kind != "share"]
    return [AREAL_DENSITY, *EFFECTS, *tenths]


def effect_of(measure: str) -> str:
    """The effect that a measure is made of."""
    return measure.removesuffix(WORST_TENTH.name)


def higher_is_better(measure: str) -> bool:
    """Of a measure by its name."""
    return measure != AREAL_DENSITY and EFFECTS[effect_of(measure)].higher_is_better


def label_of(measure: str, key: Key) -> str:
    """A measure for people, with its unit."""
    if measure == AREAL_DENSITY:
        return f"areal density{SHOWN_UNITS['kg m-2']}"
    words = {
        "angle": angle_text(math.degrees(key.angle)),
        "standoff": "the last stand-off" if key.standoff is None else length_text(key.standoff),
        "layer": layer_text(key.layer),
    }
    effect = EFFECTS[key.effect]
    tenth = WORST_TENTH.label if measure != key.effect else ""
    return effect.label.format(**words) + tenth + SHOWN_UNITS[effect.units]
