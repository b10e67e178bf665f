"""What may be asked of how well a plate protects: every effect with its label, unit, definition and source, once.

`inspect`, `compare`, reports, figures and searches for designs take their words from here. What each shot says of an
effect is in effects.py.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import NamedTuple

MIL_STD_662F = "MIL-STD-662F, V50 Ballistic Test for Armor"


@dataclass(frozen=True, kw_only=True)
class Meaning:
    """An effect: one number per shot, and what is said of it.

    Attributes:
        name: for programs.
        label: for people; with {angle}, {standoff} or {layer} where these are part of what is asked.
        units: "1", "mm", "J mm-2", "kg m-2" or "m s-1".
        definition: one sentence, with {highest} where the largest value that was tried is part of it.
        source: where it comes from.
        higher_is_better: for whoever is behind the plate.
        kind: "mean" of any numbers, or "share" of numbers 0 and 1.
        needs: what a campaign needs to have it: "standoff", "layer", "bending" or "".
        is_limit: whether a search of limits tells it.
    """

    name: str
    label: str
    units: str
    definition: str
    source: str
    higher_is_better: bool
    kind: str
    needs: str = ""
    is_limit: bool = False


class Statistic(NamedTuple):
    """What is made of the numbers of an effect: the endings of its name, label, definition and source."""

    name: str
    label: str
    definition: str
    source: str


SHARE = Statistic("", "", "", "")
MEAN = Statistic("", ", mean", " Mean over the area.", "")
WORST_TENTH = Statistic(
    "_worst_tenth",
    ", worst tenth",
    " Mean over the worst tenth of the area.",
    "; R. T. Rockafellar, S. Uryasev, Journal of Risk 2 (2000) 21",
)
WORST_POINT = Statistic("_worst_point", ", worst point", " The worst of the hits, an observed extreme.", "")

SHOWN_UNITS = {"1": "", "mm": " [mm]", "J mm-2": " [J/mm²]", "kg m-2": " [kg/m²]", "m s-1": " [m/s]"}
"""Units of effects behind a label, as people read them."""


EFFECTS: Mapping[str, Meaning] = {
    meaning.name: meaning
    for meaning in (
        Meaning(
            name="base_perforated_share",
            label="P(base perforated)",
            units="1",
            definition="Share of the shots that pass the last layer, the base: they perforate it, or go through a hole "
            "of it or past its rim. Of the solid plate: the share that perforates it.",
            source=f"complete penetration as in {MIL_STD_662F}",
            higher_is_better=False,
            kind="share",
            needs="layer",
        ),
        Meaning(
            name="base_pierced_share",
            label="P(base pierced)",
            units="1",
            definition="Share of the shots in which the core comes out of the rear face of the last layer, the base, "
            "whether it rests there or passes.",
            source="Army criterion; P(base perforated) is that of the Navy: J. A. Zukas and others, Impact Dynamics, "
            "Wiley 1982",
            higher_is_better=False,
            kind="share",
            needs="layer",
        ),
        Meaning(
            name="base_depth",
            label="depth in the base",
            units="mm",
            definition="How far behind the front face of the last layer, the base, any point of a core comes that "
            "rests in it, at most the thickness of the base; 0 for a core that stops before the base or bounces off "
            "it. A core that passes the base counts with this thickness, too: the numbers are lower bounds if any core "
            "pierces the base.",
            source="residual depth of penetration in a backing: Z. Rosenberg, E. Dekel, Terminal Ballistics, Springer "
            "2012",
            higher_is_better=False,
            kind="mean",
            needs="layer",
        ),
        Meaning(
            name="residual_energy_fraction",
            label="residual energy fraction",
            units="1",
            definition="Kinetic energy of translation behind the plate as a fraction of that on impact, (v_r/v_0)²; 0 "
            "for a core that was arrested or ricocheted.",
            source="R. F. Recht, T. W. Ipson, Journal of Applied Mechanics 30 (1963) 384",
            higher_is_better=False,
            kind="mean",
        ),
        Meaning(
            name="residual_energy_density",
            label="proxy: energy per presented area at {standoff}",
            units="J mm-2",
            definition="Kinetic energy of translation behind the plate over the area of the core's silhouette along "
            "the line of fire {standoff} behind it, nose or base first alike; 0 for a core that was arrested or "
            "ricocheted. A proxy of how deep the core goes into what follows, which takes resistance times area from "
            "it per depth.",
            source="G. Ben-Dor, A. Dubinsky, T. Elperin, Applied Mechanics Reviews 58 (2005) 355; the silhouette of "
            "a convex body is Cauchy's",
            higher_is_better=False,
            kind="mean",
            needs="standoff",
        ),
        Meaning(
            name="tilted_share",
            label="P(inclined > {angle} at {standoff}, either end first, or stopped)",
            units="1",
            definition="Share of the shots that {standoff} behind the plate are inclined to the line of fire by more "
            "than {angle}, tilt beyond 90° counted back from 180°, or that do not get there because they were arrested "
            "or ricocheted.",
            source="Numerical and experimental investigation of asymmetrical contact between a steel plate and "
            "armour-piercing projectiles: what protects is mostly the distortion of the trajectory",
            higher_is_better=True,
            kind="share",
            needs="standoff",
        ),
        Meaning(
            name="stopped_share",
            label="P(stopped)",
            units="1",
            definition="Share of the shots that do not pass the plate: arrested in it, or ricocheted off it.",
            source=f"partial penetration as in {MIL_STD_662F}",
            higher_is_better=True,
            kind="share",
        ),
        Meaning(
            name="broken_share",
            label="P(broken)",
            units="1",
            definition="Share of the shots whose nominal bending stress passed the strength of the core.",
            source="beam theory for a rigid core; a bound, not a prediction of fragments",
            higher_is_better=True,
            kind="share",
            needs="bending",
        ),
        Meaning(
            name="stopped_or_broken_share",
            label="P(stopped, or broken)",
            units="1",
            definition="Share of the shots that do not pass the plate, or pass it with a broken core.",
            source=f"partial penetration as in {MIL_STD_662F}; a broken core counts as stopped",
            higher_is_better=True,
            kind="share",
            needs="bending",
        ),
        Meaning(
            name="limit_velocity",
            label="limit velocity",
            units="m s-1",
            definition="Impact velocity at which a core just perforates the target; 0 for a core that touches no "
            "material, and {highest} for one that is stopped even at that velocity, the largest tried.",
            source=f"ballistic limit as in {MIL_STD_662F}",
            higher_is_better=True,
            kind="mean",
            is_limit=True,
        ),
        Meaning(
            name="limit_thickness",
            label="limit thickness of {layer}",
            units="mm",
            definition="Thickness of {layer} that a core just perforates; a core that perforates the largest thickness "
            "tried, {highest}, counts with that.",
            source=f"ballistic limit as in {MIL_STD_662F}, of the thickness at one velocity",
            higher_is_better=False,
            kind="mean",
            is_limit=True,
        ),
        Meaning(
            name="limit_areal_density",
            label="areal density needed",
            units="kg m-2",
            definition="Mass per area of the whole target where {layer} has the limit thickness of the hit.",
            source="armour is compared by its areal density at the limit: Z. Rosenberg, E. Dekel, Terminal Ballistics, "
            "Springer 2012",
            higher_is_better=False,
            kind="mean",
            is_limit=True,
        ),
    )
}
"""All effects by their names, in the order in which they are told."""


def angle_text(degrees: float) -> str:
    return f"{degrees:g}°"


def length_text(length: float) -> str:
    """A length [m], in mm."""
    return f"{length * 1e3:g} mm"


def layer_text(layer: int) -> str:
    return f"layer {layer}" if layer else "the plate"
