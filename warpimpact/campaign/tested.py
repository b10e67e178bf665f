"""What of a campaign was ever measured: published limit velocities of solid plates, and two shots at one slotted plate
(docs/validation.md). Everything else rests on the model alone, and is named here with its range."""

from __future__ import annotations

import json
import math
from collections import Counter
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..catalogue.catalogue import HERE, Catalogue
from ..catalogue.entries import Material
from ..results.attributes import RESTS_ON
from ..scene import Core, Plate
from .catalogued import calibres_of

if TYPE_CHECKING:
    from .campaign import Campaign

Figures = Mapping[str, Mapping[str, float]]

_SLACK = 0.05
"""Relative distance beyond the end of a range that still counts as inside."""
_HEAVY, _CARBIDE = 5000.0, 11_000.0
"""Density above which a plate is steel, and above which a core is a carbide or a heavy metal [kg/m³]."""
_STRONG, _STEP = 2.0e9, 1.0
"""Resistance from which a steel may be hard [Pa]; thickness in calibres below which its resistance falls."""
_NOSE, _SHORT = 0.95, 0.75
"""Share of the largest radius at which a nose ends; length in diameters below which it is blunt."""
_STRAIGHT = math.radians(2.0)
"""Obliquity or yaw on impact that the two shots through holes may have had [rad]."""
_HOLED_CALIBRES, _HOLED_LIGAMENT = 0.66, 1.0
"""The plate of the two shots: its thickness in calibres, and its approximate ligament over its thickness, because the
spacing of the slots is not published (the paper's §2)."""
_SIMILAR_RATIO = 1.5
"""Largest ratio at which a plate with holes counts as similar to that of the two shots. It is chosen."""


class Standing(NamedTuple):
    """A property of a campaign that lies beyond what was measured, or that nobody measured.

    Attributes:
        subject: the property in a word or two.
        text: the value found, and what was measured.
        place: layer of the target as a campaign names it; empty for the shot as a whole.
    """

    subject: str
    text: str
    place: str = ""

    @property
    def sentence(self) -> str:
        """Subject, place and text."""
        return f"{self.subject}{f' ({self.place})' if self.place else ''}: {self.text}"


def standings_of(campaign: Campaign) -> list[Standing]:
    """Everything of a campaign that lies beyond what was measured. Layers with the same text are named together."""
    figures, materials = _figures(), Catalogue.of(campaign.catalogue).all(Material)
    standings = list(_of_shot(campaign, figures))
    for place, plate in campaign.target.named:
        material = None if plate.material is None else materials.get(plate.material)
        standings += [standing._replace(place=place) for standing in _of_plate(campaign, plate, material, figures)]
    places: dict[tuple[str, str], list[str]] = {}
    for subject, text, place in standings:
        places.setdefault((subject, text), []).append(place)
    return [Standing(subject, text, _joined(where)) for (subject, text), where in places.items()]


def summary_of(campaign: Campaign, standings: Sequence[Standing]) -> str:
    """One sentence on what an answer for the campaign rests on."""
    return _summary([campaign], [[standing.subject for standing in standings]], "")


def summary_of_all(campaigns: Iterable[Campaign], what: str) -> str:
    """One sentence on what answers for several campaigns, called `what`, such as "designs", rest on."""
    several = list(campaigns)
    subjects = [[standing.subject for standing in standings_of(campaign)] for campaign in several]
    return _summary(several, subjects, what)


def _summary(campaigns: Sequence[Campaign], subjects: Sequence[Sequence[str]], what: str) -> str:
    """What answers rest on, and what lies beyond the tests; for several campaigns, each with their number."""
    holed = any(plate.open_area for campaign in campaigns for plate in campaign.target.layers)
    base = "two shots at one slotted plate, and limit velocities of solid plates" if holed else "limit velocities"
    counts = Counter(subject for beyond in subjects for subject in dict.fromkeys(beyond))
    if not counts:
        return f"{RESTS_ON}inside what was measured ({base})"
    total = len(campaigns)
    told = [f"{name} ({count} of {total} {what})" if count < total else name for name, count in counts.items()]
    return f"{RESTS_ON}{base}; beyond them: {', '.join(told)}"


def nose_length(core: Core) -> float:
    """Distance behind the tip at which a core is nearly at its widest, in its largest diameters."""
    s = np.linspace(0.0, core.length, 1001)
    first = int(np.argmax(core.radius(s) >= _NOSE * core.max_radius))
    return float(s[first] / (2.0 * core.max_radius))


def _joined(places: list[str]) -> str:
    named = list(dict.fromkeys(filter(None, places)))
    return named[0] if len(named) == 1 else f"{named[0]} and {len(named) - 1} more" if named else ""


@cache
def _figures() -> Figures:
    """Ranges of what was measured, and errors of what the model fails at (tests/validation/limit_catalogue.py)."""
    figures: Figures = json.loads((HERE / "figures.json").read_text(encoding="utf-8"))
    return figures


def _of_shot(campaign: Campaign, figures: Figures) -> Iterator[Standing]:
    core, impact, layers = campaign.core, campaign.impact, campaign.target.layers
    nose, rows = nose_length(core), figures["core"]
    if nose < _SHORT:
        yield Standing(
            "the blunt nose",
            f"it is {nose:.2g} diameters long, but every core with a limit velocity had a nose of {rows['nose']:.2g}; "
            "a blunt nose shears out a plug, which the model lacks",
        )
    yield from _outside(
        "the diameter of the core", 2e3 * core.max_radius, rows["diameter_low"], rows["diameter_high"], "mm"
    )
    yield from _outside("the impact velocity", impact.velocity, rows["velocity_low"], rows["velocity_high"], "m/s")
    if max(abs(impact.pitch), abs(impact.yaw)) > _STRAIGHT:
        yield Standing("yaw on impact", "no published shot had any")
    if len(layers) > 1:
        yield Standing("several layers", "no published shot was at more than one")
    if any(layer.degradation < 1.0 for layer in layers):
        yield Standing(
            "weakening", "β is below 1, which rests on the two shots alone; solid plates were fitted without it"
        )
        if impact.obliquity > _STRAIGHT:
            yield Standing(
                "weakening at an angle",
                "with β below 1 an oblique plate is weaker than a straight one: with the paper's core the limit "
                "velocity at 30° is 0.90 to 0.92 of that at 0°, where published ones of aluminium are 1.16 of it",
            )
    holed = [layer for layer in layers if layer.open_area]
    if holed and impact.obliquity > _STRAIGHT:
        yield Standing("holes hit at an angle", "both shots at a plate with holes were along its normal")
    if holed and core.strength is None:
        yield Standing(
            "whether the core breaks",
            "[core] gives no strength, so it cannot; the paper's plate is meant to break cores",
        )


def _of_plate(campaign: Campaign, plate: Plate, material: Material | None, figures: Figures) -> Iterator[Standing]:
    """Properties in which a plate leaves what was measured. Rows of its material replace those of all materials."""
    core, steel = campaign.core, plate.density > _HEAVY
    rows = figures["steel" if steel else "aluminium"]
    if not _within(plate.density, rows["density_low"], rows["density_high"], 0.03):
        yield Standing(
            "the kind of material",
            f"{plate.density:.4g} kg/m³ is neither steel nor aluminium, and no other plate was measured",
        )
        return
    if plate.open_area:
        yield from _of_holes(core, plate)
    if material is not None and material.rows:
        yield from _of_rows(campaign, plate, material)
    else:
        kind = "steel" if steel else "aluminium"
        ratio = calibres_of(core, plate)
        yield from _outside("thickness", ratio, rows["calibres_low"], rows["calibres_high"], "calibres", kind)
        yield from _oblique(campaign, 0.0, math.radians(rows["obliquity_high"]), kind)
        resistance = plate.resistance / 1e9
        yield from _outside("resistance", resistance, rows["resistance_low"], rows["resistance_high"], "GPa", kind)
    if material is None:
        yield from _thin_hard(core, plate, figures["thin hard steel"])
    if material is None or core.threat not in material.rows:
        yield from _dense(core, plate, figures["carbide"])


def _of_rows(campaign: Campaign, plate: Plate, material: Material) -> Iterator[Standing]:
    """Properties in which a plate leaves the rows of its material."""
    core, name = campaign.core, material.name
    high = material.calibres_high or math.inf
    thickest = material.thickness_high or math.inf
    yield from _outside("thickness", 1e3 * plate.thickness, 1e3 * material.thickness_low, 1e3 * thickest, "mm", name)
    yield from _outside("thickness", calibres_of(core, plate), material.calibres_low, high, "calibres", name)
    farthest = math.inf if material.obliquity_high is None else material.obliquity_high  # 0 where no row is oblique
    yield from _oblique(campaign, material.obliquity_low, farthest, name)
    if core.threat not in material.rows:
        threat = "this core" if core.threat is None else f"the {core.threat}"
        told = ", ".join(material.rows)
        yield Standing("the threat", f"no limit velocity of {name} is of {threat}, but of {told}")


def _oblique(campaign: Campaign, low: float, high: float, whose: str) -> Iterator[Standing]:
    """An obliquity beyond the measured range [rad], with a tolerance for the shots of a test."""
    obliquity = campaign.impact.obliquity
    if not low - _STRAIGHT <= obliquity <= high + _STRAIGHT:
        ends = math.degrees(low), math.degrees(high)
        yield from _outside("obliquity", math.degrees(obliquity), ends[0], ends[1], "°", whose)


def _of_holes(core: Core, plate: Plate) -> Iterator[Standing]:
    """How a plate with holes differs from the one that was shot at."""
    ratio, share = calibres_of(core, plate), plate.ligament / plate.thickness
    if not _alike(ratio, _HOLED_CALIBRES) or not _alike(share, _HOLED_LIGAMENT):
        yield Standing(
            "holes",
            f"{ratio:.2g} calibres thick, ligaments of {1e3 * plate.ligament:.3g} mm ({share:.2g} of the thickness); "
            f"the two shots were at one plate of {_HOLED_CALIBRES:.2g} calibres, with ligaments about as wide as thick",
        )


def _alike(value: float, other: float) -> bool:
    return other / _SIMILAR_RATIO <= value <= other * _SIMILAR_RATIO


def _thin_hard(core: Core, plate: Plate, figure: Mapping[str, float]) -> Iterator[Standing]:
    """The limits of the model for a thin hard plate whose Y is not the catalogue's, which follows the thickness."""
    ratio = calibres_of(core, plate)
    if plate.density < _HEAVY or ratio >= _STEP or plate.resistance < _STRONG:
        return
    yield Standing(
        "thin hard steel",
        f"steel that may be hard, {ratio:.2g} calibres thick: hard steel has {figure['share']:.0%} of its Y at one "
        f"calibre where it is {figure['calibres']:.2g} calibres thick (median of {figure['materials']:.0f} steels); "
        "check that your Y is of such a thickness",
    )


def _dense(core: Core, plate: Plate, figure: Mapping[str, float]) -> Iterator[Standing]:
    """The limits of the model for a core of a carbide or a heavy metal that has no rows of its own."""
    if _density(core) < _CARBIDE:
        return
    steel = plate.density >= _HEAVY
    bias, rows = (figure["steel"], figure["steel rows"]) if steel else (figure["aluminium"], figure["aluminium rows"])
    yield Standing(
        "the dense core",
        "the core is as dense as a carbide: from rows of steel cores the model predicts limit velocities of the BS41 "
        f"carbide core in {'steel' if steel else 'aluminium'} {abs(bias):.0%} too {'high' if bias > 0 else 'low'} "
        f"(median of {rows:.0f})",
    )


def _density(core: Core) -> float:
    """Mass over volume [kg/m³]."""
    if core.density is not None:
        return core.density
    s = np.linspace(0.0, core.length, 2001)
    volume = float(np.trapezoid(np.pi * core.radius(s) ** 2, s))
    return core.mass_properties.mass / volume


def _outside(subject: str, value: float, low: float, high: float, unit: str, whose: str = "") -> Iterator[Standing]:
    """A number that lies beyond a measured range."""
    if _within(value, low, high):
        return
    of = f" of {whose}" if whose else ""
    measured = f"{low:.3g} to {high:.3g}" if math.isfinite(high) else f"from {low:.3g} on"
    measured = f"{low:.3g}" if low == high else measured
    text = f"{value:.3g} {unit}, but limit velocities{of} are of {measured} {unit}"
    yield Standing(subject, text.replace(" °", "°"))


def _within(value: float, low: float, high: float, close: float = _SLACK) -> bool:
    return low * (1.0 - close) - 1e-12 <= value <= high * (1.0 + close) + 1e-12
