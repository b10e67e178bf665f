"""The view of the catalogue: its list, and an entry with the sources of its values and its assumptions."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Iterator, Sequence

import pandas as pd

from warpimpact.catalogue.catalogue import Catalogue, flow_entries, flow_entry
from warpimpact.catalogue.entries import Material, Threat
from warpimpact.catalogue.strength import limit_fit, resistance_of
from warpimpact.scene import Core

_MM, _G = 1e3, 1e3
View = dict[str, list[str | pd.DataFrame]]


def catalogue_view(catalogue: Catalogue) -> View:
    """All names, each with the state of its evidence."""
    threats = [(name, threat.evidence) for name, threat in catalogue.all(Threat).items()]
    materials = [(k, f"Y {one.resistance / 1e9:.3g} GPa, {one.evidence}") for k, one in catalogue.all(Material).items()]
    elements = list[tuple[str, str]]()
    for name, entry in flow_entries().items():
        met = "; ".join(words for key, words in entry.tested.items() if not key.startswith("rms"))
        elements.append((name, met if entry.strength_error else entry.evidence))
    return {
        "threats: [core] threat = NAME": _labelled(threats),
        "materials: [plate] material = NAME": _labelled(materials),
        "finite elements: [continuum] materials = [NAME]": _labelled(elements),
    }


def _labelled(rows: Sequence[tuple[str, str]]) -> list[str | pd.DataFrame]:
    """Labels and texts, a line each."""
    return [f"{label:<{max(len(one) for one, _ in rows)}}  {text}" for label, text in rows]


def threat_view(threat: Threat) -> View:
    """A threat: its mass properties beside the published mass, its velocities and its evidence."""
    unknown = [("core", "not known; give its shape in [core]")]
    rows = unknown if threat.shape is None else list(_core(threat, threat.shape))
    rows += [("core material", threat.core_material)] if threat.core_material else []
    rows += [("core hardness", threat.core_hardness)] if threat.core_hardness else []
    rows += [("bullet", f"{_G * threat.bullet_mass:.4g} g")] if threat.bullet_mass else []
    for velocity in threat.velocities:
        tolerance = "tolerance not known" if velocity.tolerance is None else f"± {velocity.tolerance:g} m/s"
        distance = "range not known" if velocity.range is None else f"at {velocity.range:g} m"
        rows.append(("velocity", f"{velocity.value:g} m/s, {tolerance}, {distance}: {velocity.standard}"))
    if not threat.velocities:
        rows.append(("velocity", "none known; give impact.velocity"))
    return {threat.name: _labelled([*rows, *_sources(threat.known, threat.assumed)])}


def material_view(material: Material, *, is_own: bool = False) -> View:
    """A material: its strength and law with their uncertainty, the rows that they come from, and its evidence. The
    numbers of a user's own one are the whole evidence."""
    law = (
        f"Y = {material.resistance / 1e9:.3g} GPa · (h / d)^{material.thickness_exponent:.3g}, "
        f"η = {material.shear_coefficient:g}, B = {material.quadratic:g}, C = {material.linear:g}, "
        f"κ = {material.onset:g}"
    )
    rows = [("density", f"{material.density:g} kg/m³"), ("law", law)]
    if material.resistance_low is not None and material.resistance_high is not None:
        low, high = material.resistance_low / 1e9, material.resistance_high / 1e9
        rows.append(("Y, 90 %", f"{low:.3g} to {high:.3g} GPa, of a plate one calibre thick"))
    rows += [] if is_own else _predicted(material)
    if material.hardness is not None:
        rows.append(("hardness", f"{material.hardness:g} HV"))
    rows += _rows(material)
    if material.misfit is not None and material.misfit_p90 is not None:
        inside = "" if material.coverage is None else f"; {material.coverage:.0%} inside their 90 % interval"
        rows.append(("misfit", f"{material.misfit:.1%} median, {material.misfit_p90:.1%} 90th percentile{inside}"))
    view = {material.name: _labelled([*rows, *_sources(material.known, material.assumed)])}
    return view if is_own else {**view, "finite elements": list(_elements(material.name))}


def _elements(material: str) -> Iterator[str]:
    """Evidence of the constants of the continuum, and the limits that they were made to meet."""
    try:
        entry = flow_entry(material)
    except ValueError as error:
        yield str(error)
    else:
        yield entry.evidence
        yield from (f"{plate}: {words}" for plate, words in entry.limits.items())


def _core(threat: Threat, core: Core) -> Iterator[tuple[str, str]]:
    properties = core.mass_properties
    yield "core", f"{_MM * core.length:.4g} mm long, {2 * _MM * core.max_radius:.4g} mm wide"
    published = "" if threat.core_mass is None else f"; published {_G * threat.core_mass:.4g} g"
    if threat.core_density is not None:
        by_volume = core.model_copy(update={"mass": None, "density": threat.core_density}).mass_properties.mass
        volume = f"; its volume at {threat.core_density:g} kg/m³ weighs {_G * by_volume:.4g} g"
    else:
        volume = ""
    yield "core mass", f"{_G * properties.mass:.4g} g{published}{volume}"
    yield "centre of mass", f"{_MM * properties.centre_of_mass:.4g} mm behind the nose"
    inertia = f"axial {properties.inertia_axial:.4g} kg m², transverse {properties.inertia_transverse:.4g} kg m²"
    yield "moments of inertia", inertia


def _predicted(material: Material) -> Iterator[tuple[str, str]]:
    """Y against each projectile with rows, at the ends of their thicknesses, at the angle of most of them."""
    rows = limit_fit(material.name).rows
    for projectile in material.rows:
        of_it = (rows.material == material.name) & (rows.projectile == projectile)
        thickness, calibres, angles = rows.thickness[of_it], rows.calibres[of_it], rows.obliquity[of_it]
        obliquity = Counter(angles.tolist()).most_common(1)[0][0]
        parts = []
        for place in dict.fromkeys((int(thickness.argmin()), int(thickness.argmax()))):
            known = resistance_of(
                material.name,
                projectile=projectile,
                diameter=thickness[place] / calibres[place],
                thickness=thickness[place],
                obliquity=obliquity,
            )
            low, high = (end / 1e9 for end in known.ends)
            parts.append(
                f"{known.median / 1e9:.3g} GPa ({low:.3g} to {high:.3g}, 90 %) of {_MM * thickness[place]:.4g} mm"
            )
        yield f"Y, {projectile}", f"{'; '.join(parts)}, at {math.degrees(obliquity):.3g}°"


def _rows(material: Material) -> Iterator[tuple[str, str]]:
    if not material.rows:
        return
    rows = ", ".join(f"{count} of {name}" for name, count in material.rows.items())
    yield "limit velocities", f"{material.count}: {rows}"
    calibres = f"{material.calibres_low:.3g} to {material.calibres_high or 0.0:.3g} calibres"
    thickness = f"{_MM * material.thickness_low:.4g} to {_MM * (material.thickness_high or 0.0):.4g} mm, {calibres}"
    low, high = math.degrees(material.obliquity_low), math.degrees(material.obliquity_high or 0.0)
    yield "range", f"{thickness}, {low:.3g} to {high:.3g}°; beyond it a campaign gets a warning"
    yield "sources", ", ".join(material.sources)


def _sources(known: dict[str, str], assumed: dict[str, str]) -> Iterator[tuple[str, str]]:
    for name, source in known.items():
        mark = "quoted at second hand" if "second-hand" in source else "known"
        yield mark, f"{name.replace('_', ' ')}: {source}"
    for name, stand_in in assumed.items():
        yield "assumed", f"{name.replace('_', ' ')}: {stand_in}"
