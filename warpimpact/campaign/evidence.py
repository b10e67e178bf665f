"""What is known of a campaign: its names in the catalogue, how sure its Y is, and where it leaves what was measured.

Measured were limit velocities of solid plates, and two shots at one slotted plate (docs/validation.md).
"""

import json
import math
import re
from collections.abc import Collection, Iterable, Iterator, Mapping
from functools import cache

import numpy as np

from ..catalogue.catalogue import DATA_FOLDER, Catalogue, flow_entry
from ..catalogue.entries import Material, Threat
from ..catalogue.strength import Z_90
from ..continuum.handover import layers_before_base
from ..scene import Core, Layer, Plate
from ..scene.units import list_text
from .campaign import CORES_STAYED_WHOLE, Campaign
from .elements import layer_materials, with_layers
from .resistance import entry_velocity

Curve = tuple[tuple[float, ...], tuple[float, ...]]
Sentences = Iterator[tuple[str, str]]
"""What leaves the range, in a word or two, and its value with what was measured."""

_THINNEST, _POINTS = 1e-3, 128
"""Least thickness of a curve as a share of the largest, and number of its points. The points are closer than a tenth of
the width within which the fit takes thicknesses as nearly equal (`catalogue.strength.SAME_THICKNESS`, as logarithms).
Linear interpolation is wrong by at most 0.1 %."""
_SLACK = 0.05
"""Relative distance beyond the end of a range that still counts as inside."""
_HEAVY, _CARBIDE = 5000.0, 11_000.0
"""Density above which a plate is steel, and above which a core is a carbide or a heavy metal [kg/m³]."""
_STRONG = 2.0e9
"""Resistance from which a steel may be hard [Pa]; below a calibre its resistance falls."""
_NOSE, _SHORT = 0.95, 0.75
"""Share of the largest radius at which a nose ends; length in diameters below which it is blunt."""
_STRAIGHT = 2.0
"""Obliquity or yaw that a straight shot may have [degree]."""
_HOLED_CALIBRES, _HOLED_LIGAMENT, _SIMILAR_RATIO = 0.66, 1.0, 1.5
"""The plate of the two shots: its thickness in calibres, and its approximate ligament over its thickness, because the
spacing of the slots is not published (the paper's §2); and the chosen ratio up to which another plate is similar."""

_HOLES = {"circle": "round holes", "slot": "slots", "polygons": "holes"}


def is_drawn(campaign: Campaign, quantity: str, layers: Collection[int] = (0,)) -> bool:
    """Whether a quantity differs from shot to shot, by a distribution or a file of hits."""
    scattered = any(name == quantity and k in layers for name, k in campaign.scatter.given)
    return scattered or quantity in (campaign.hits.listed or {})


def resistance_by_thickness(campaign: Campaign, layer: int, thickest: float) -> Curve | None:
    """Thicknesses of a layer, ascending to the thickest [m], and its resistance there, where the catalogue gives it;
    None elsewhere. The resistance of the layer is 1."""
    plate = campaign.target.layers[layer]
    known = None if is_drawn(campaign, "resistance", [layer]) else campaign.catalogue_resistance(plate)
    if known is None:
        return None
    thicknesses = np.geomspace(_THINNEST * thickest, thickest, _POINTS).tolist()
    others = (campaign.catalogue_resistance(plate, thickness) for thickness in thicknesses)
    return tuple(thicknesses), tuple(other.median / known.median for other in others if other is not None)


def limit_velocity_factors(campaign: Campaign) -> tuple[float, float] | None:
    """Ends of the 90 % interval of a limit velocity, over the velocity, from the uncertainty of the resistance in the
    published rows, and from the scatter of a test. None but for a solid plate of a material that does not weaken."""
    plate, stress = campaign.plate, (campaign.interaction, campaign.plate.shear_coefficient)
    known = campaign.catalogue_resistance(plate)
    if campaign.layer or plate != plate.solid or plate.degradation < 1.0 or known is None or not known.deviation:
        return None
    values = known.median * np.exp(Z_90 * math.hypot(known.deviation, known.test) * np.array([-1.0, 0.0, 1.0]))
    low, middle, high = entry_velocity(campaign.core, plate, campaign.impact.obliquity, stress, values).tolist()
    return low / middle, high / middle


def limit_velocity_deviation(campaign: Campaign) -> float | None:
    """Standard deviation of the logarithm of the limit velocity of a plate, from the error of the catalogue's Y; of a
    plate with holes, as of a solid one. None where the error is not known, and before further layers."""
    plate, stress = campaign.plate, (campaign.interaction, campaign.plate.shear_coefficient)
    known = None if campaign.layer or is_drawn(campaign, "resistance") else campaign.catalogue_resistance(plate)
    if known is None or not known.deviation:
        return None
    values = known.median * np.exp(known.deviation * np.array([-1.0, 1.0]))
    low, high = entry_velocity(campaign.core, plate.solid, campaign.impact.obliquity, stress, values).tolist()
    return 0.5 * math.log(high / low)


def scene_words(campaign: Campaign) -> str:
    """What is shot at what, in one clause: the threat with its velocity and obliquity, and the layers."""
    core, impact = campaign.core, campaign.impact
    threat = core.threat or f"a core of {2e3 * core.max_radius:.3g} mm, {1e3 * core.mass_properties.mass:.3g} g,"
    angle = math.degrees(impact.obliquity)
    layers = []
    for plate in campaign.target.layers:
        material = plate.material or f"{plate.density:.4g} kg/m³ and resistance {plate.resistance / 1e9:.3g} GPa"
        words = _HOLES.get(plate.pattern.shape, f"{plate.pattern.shape} holes")
        holes = f" with {words}, {plate.open_area:.0%} open" if plate.open_area else ""
        gap = f"{1e3 * plate.gap:.4g} mm of air and " if isinstance(plate, Layer) and plate.gap else ""
        layers.append(f"{gap}{1e3 * plate.thickness:.4g} mm of {material}{holes}")
    weights = ", ".join(f"{name} {weight:.3g} kg/m²" for name, weight in campaign.target.weights.items())
    return f"{threat} at {impact.velocity:.4g} m/s and {angle:.3g}° against {', then '.join(layers)} ({weights})"


def catalogue_names(campaign: Campaign) -> list[str]:
    """A line for each name of the catalogue in a campaign: how well it is known, and whether Y is the user's."""
    catalogue, core, lines = Catalogue.of(campaign.catalogue), campaign.core, list[str]()
    if core.threat is not None:
        lines.append(f"core: {core.threat}{_evidence(catalogue.all(Threat).get(core.threat))}")
    for place, plate in campaign.target.named:
        if plate.material is not None:
            known, y = campaign.catalogue_resistance(plate), f"{plate.resistance / 1e9:.3g} GPa"
            low, high = (0.0, 0.0) if known is None else (end / 1e9 for end in known.ends)
            interval = f", {low:.3g} to {high:.3g} with 90 %" if low < high else ""
            of_plate = f", your resistance {y}" if known is None else f", resistance {y}{interval}"
            lines.append(f"{place}: {plate.material}{of_plate}{_evidence(catalogue.all(Material).get(plate.material))}")
    return lines


def _evidence(entry: Threat | Material | None) -> str:
    return ", which is not in the catalogue" if entry is None else f" ({entry.evidence})"


def outside_tested_range(campaign: Campaign) -> list[str]:
    """A sentence for each property of a campaign that leaves what was measured; layers that do so alike share one."""
    materials = Catalogue.of(campaign.catalogue).all(Material)
    places: dict[tuple[str, str], list[str]] = {sentence: [] for sentence in _of_shot(campaign)}
    for place, plate in campaign.target.named:
        for sentence in dict.fromkeys(_of_plate(campaign, plate, materials.get(str(plate.material)))):
            places.setdefault(sentence, []).append(place)
    return [
        f"{subject}{f' ({where[0]}{more})' if where else ''}: {text}"
        for (subject, text), where in places.items()
        for more in [f" and {len(where) - 1} more" if len(where) > 1 else ""]
    ]


def range_line(sentences: Iterable[str]) -> str:
    """One line on whether a campaign lies in the tested range, from its sentences."""
    subjects = dict.fromkeys(re.split(r" \(|: ", sentence, maxsplit=1)[0] for sentence in sentences)
    return f"Outside the tested range: {', '.join(subjects)}." if subjects else "Inside the tested range."


def nose_length(core: Core) -> float:
    """Distance behind the tip at which a core is nearly at its widest, in its largest diameters."""
    s = np.linspace(0.0, core.length, 1001)
    first = int(np.argmax(core.radius(s) >= _NOSE * core.max_radius))
    return float(s[first] / (2.0 * core.max_radius))


@cache
def _figures() -> Mapping[str, Mapping[str, float]]:
    """Ranges of what was measured, and errors of what the model fails at (tests/validation/limit_catalogue.py)."""
    figures: Mapping[str, Mapping[str, float]] = json.loads((DATA_FOLDER / "figures.json").read_text(encoding="utf-8"))
    return figures


def _of_shot(campaign: Campaign) -> Sentences:
    """Properties of core and shot that leave what was measured."""
    core, impact, layers = campaign.core, campaign.impact, campaign.target.layers
    nose, rows, oblique = nose_length(core), _figures()["core"], math.degrees(impact.obliquity) > _STRAIGHT
    if nose < _SHORT:
        yield (
            "the blunt nose",
            f"it is {nose:.2g} diameters long, but the cores with a limit velocity had a nose of {rows['nose']:.2g}; "
            "a blunt nose shears out a plug, which the model lacks",
        )
    yield from _outside(
        "the diameter of the core", 2e3 * core.max_radius, rows["diameter_low"], rows["diameter_high"], "mm"
    )
    yield from _outside("the impact velocity", impact.velocity, rows["velocity_low"], rows["velocity_high"], "m/s")
    if math.degrees(max(abs(impact.pitch), abs(impact.yaw))) > _STRAIGHT:
        yield "yaw on impact", "no published shot with known numbers had any"
    if len(layers) > 1:
        yield "several layers", "no published shot with known numbers was at several layers"
    if touching := campaign.target.touching_layers(layers_before_base(core, campaign.target)):
        yield "layers that touch, by finite elements", touching
    yield from _of_bodies(campaign)
    if any(layer.degradation < 1.0 for layer in layers):
        yield "weakening", "degradation below 1 rests on the two shots alone; solid plates were fitted without it"
        if oblique:
            yield (
                "weakening at an angle",
                "an oblique plate that weakens is weaker than a straight one: with the paper's core the limit velocity "
                "at 30° is 0.90 to 0.92 of that at 0°, where published ones of aluminium are 1.16 of it",
            )
    holed = any(layer.open_area for layer in layers)
    if oblique and holed:
        yield "oblique shots at holes", "both published shots with known numbers were along the normal"
    if holed or campaign.output.bending:
        known = "[core] gives no strength, so fracture is not computed"
        deforms = campaign.bodies.core != "rigid"
        if deforms:
            known = "the fast law has none; by finite elements its constants were chosen at two limit velocities"
        elif campaign.has_strength:
            known = "the strength is assumed, as no published shot shows where cores begin to break"
        if not deforms and any(layer.density > _HEAVY for layer in layers):
            known += "; in whole bullets by finite elements cores break in steel, most at an angle, and fewer pass"
            known += ' (continuum.bullet = "whole", continuum.core = "deformable")'
        yield "fracture of the core", f"{known}; {CORES_STAYED_WHOLE}"


def _of_bodies(campaign: Campaign) -> Sentences:
    """What strength factors of materials do not know of the bullet that finite elements compute."""
    is_whole, deforms = campaign.bodies.bullet != "core", campaign.bodies.core != "rigid"
    if campaign.bodies.are_as_fired:
        names = campaign.continuum.materials or layer_materials(campaign, with_layers(campaign).layers)
        unknown = [name for name in dict.fromkeys(names) if name and _lacks_whole_factor(name)]
        if unknown:
            yield (
                "a whole bullet, by finite elements",
                f"no strength factor of {list_text(unknown)} is found with whole bullets whose cores deform",
            )
    elif is_whole:
        yield "a whole bullet, by finite elements", "strength factors of materials are found with rigid bare cores"
    elif deforms:
        yield (
            "a core that deforms, by finite elements",
            "strength factors of materials are found with rigid cores, and with such ones in their bullets only",
        )


def _lacks_whole_factor(material: str) -> bool:
    """Whether a material has constants, but no strength against whole bullets."""
    try:
        return flow_entry(material).whole_factor is None
    except ValueError:  # it has no constants
        return False


def _of_plate(campaign: Campaign, plate: Plate, material: Material | None) -> Sentences:
    """Properties in which a plate leaves what was measured. Rows of its material replace those of all materials."""
    core, calibres = campaign.core, plate.thickness / (2.0 * campaign.core.max_radius)
    kind = "steel" if plate.density > _HEAVY else "aluminium"
    rows, thin, carbide = (_figures()[name] for name in (kind, "thin hard steel", "carbide"))
    if not _within(plate.density, rows["density_low"], rows["density_high"], 0.03):
        yield "the kind of material", f"{plate.density:.4g} kg/m³ is neither steel nor aluminium"
        return
    share, y = plate.ligament / plate.thickness, plate.resistance / 1e9
    if plate.open_area and not (_similar(calibres, _HOLED_CALIBRES) and _similar(share, _HOLED_LIGAMENT)):
        yield (
            "size of the holes",
            f"{calibres:.2g} calibres thick, ligaments of {1e3 * plate.ligament:.3g} mm ({share:.2g} of the thickness)"
            f"; the two shots were at one plate of {_HOLED_CALIBRES:.2g} calibres, ligaments about as wide as thick",
        )
    if material is not None and material.rows:
        name, thickest = material.name, material.thickness_high or math.inf
        yield from _outside(
            "thickness", 1e3 * plate.thickness, 1e3 * material.thickness_low, 1e3 * thickest, "mm", name
        )
        high = material.calibres_high or math.inf
        yield from _outside("thickness", calibres, material.calibres_low, high, "calibres", name)
        farthest = math.inf if material.obliquity_high is None else material.obliquity_high  # 0: no row is oblique
        yield from _oblique(campaign, material.obliquity_low, farthest, name, "; resistance extrapolated over {:.3g}°")
        if core.threat not in material.rows:
            threat = "this core" if core.threat is None else f"the {core.threat}"
            yield "the threat", f"no limit velocity of {name} is of {threat}, but of {', '.join(material.rows)}"
    else:
        yield from _outside("thickness", calibres, rows["calibres_low"], rows["calibres_high"], "calibres", kind)
        yield from _oblique(campaign, 0.0, math.radians(rows["obliquity_high"]), kind)
        yield from _outside("resistance", y, rows["resistance_low"], rows["resistance_high"], "GPa", kind)
    if material is None and kind == "steel" and calibres < 1.0 and plate.resistance >= _STRONG:
        yield (
            "thin hard steel",
            f"steel that may be hard, {calibres:.2g} calibres thick: hard steel with {thin['calibres']:.2g} has "
            f"{thin['share']:.0%} of its resistance at one calibre (median of {thin['materials']:.0f} steels); check "
            "that your resistance is of such a thickness",
        )
    if (material is None or core.threat not in material.rows) and core.mass_properties.mass / core.volume >= _CARBIDE:
        bias = carbide[kind]
        yield (
            "the dense core",
            "the core is as dense as a carbide: from rows of steel cores the model predicts limit velocities of the "
            f"BS41 carbide core in {kind} {abs(bias):.0%} too {'high' if bias > 0 else 'low'} "
            f"(median of {carbide[f'{kind} rows']:.0f})",
        )


def _oblique(campaign: Campaign, low: float, high: float, whose: str, note: str = "") -> Sentences:
    """An obliquity beyond the measured range [rad], with a tolerance for the shots of a test."""
    at, first, last = (math.degrees(angle) for angle in (campaign.impact.obliquity, low, high))
    beyond = max(first - at, at - last)
    for subject, text in _outside("obliquity", at, first, last, "°", whose) if beyond > _STRAIGHT else ():
        yield subject, text + note.format(beyond)


def _similar(value: float, other: float) -> bool:
    return other / _SIMILAR_RATIO <= value <= other * _SIMILAR_RATIO


def _outside(subject: str, value: float, low: float, high: float, unit: str, whose: str = "") -> Sentences:
    """A number that lies beyond a measured range."""
    if not _within(value, low, high):
        of = f" of {whose}" if whose else ""
        measured = f"{low:.3g} to {high:.3g}" if math.isfinite(high) else f"from {low:.3g} on"
        measured = f"{low:.3g}" if low == high else measured
        yield (
            subject,
            f"{value:.3g} {unit}, but limit velocities{of} were measured at {measured} {unit}".replace(" °", "°"),
        )


def _within(value: float, low: float, high: float, close: float = _SLACK) -> bool:
    return low * (1.0 - close) - 1e-12 <= value <= high * (1.0 + close) + 1e-12
