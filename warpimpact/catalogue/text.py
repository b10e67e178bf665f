"""The catalogue as text: its list, and an entry with what is known from where and what is assumed."""

from __future__ import annotations

import math
from collections.abc import Iterator

import numpy as np

from warpimpact.catalogue.catalogue import Catalogue
from warpimpact.catalogue.entries import Material, Threat
from warpimpact.scene import Core

_MM, _G = 1e3, 1e3
_COLUMNS, _ROWS = 64, 6
"""Of the drawing of a core: its length, and its radius if that were a quarter of the length."""
_BLOCKS = " ▁▂▃▄▅▆▇█"
_LEFT = 25


def catalogue_text(catalogue: Catalogue) -> str:
    """All names, each with the state of its evidence."""
    threats, materials = catalogue.all(Threat), catalogue.all(Material)
    width = max(map(len, [*threats, *materials]))
    lines = ["threats: [core] threat = NAME"]
    lines += [f"  {name:<{width}}  {one.evidence}" for name, one in threats.items()]
    lines += ["", "materials: [plate] material = NAME"]
    lines += [f"  {name:<{width}}  {_strength(one)}; {one.evidence}" for name, one in materials.items()]
    return "\n".join(lines)


def threat_text(threat: Threat) -> str:
    """A threat: its core drawn, its mass properties beside the published mass, its velocities and its evidence."""
    lines = [threat.name]
    if threat.shape is not None:
        lines += [*drawn(threat.shape), *_core(threat, threat.shape)]
    else:
        lines.append(_row("core", "not known; give its shape in [core]"))
    lines += [_row("core material", threat.core_material)] if threat.core_material else []
    lines += [_row("core hardness", threat.core_hardness)] if threat.core_hardness else []
    lines += [_row("bullet", f"{_G * threat.bullet_mass:.4g} g")] if threat.bullet_mass else []
    for one in threat.velocities:
        tolerance = "tolerance not known" if one.tolerance is None else f"± {one.tolerance:g} m/s"
        distance = "range not known" if one.range is None else f"at {one.range:g} m"
        lines.append(_row("velocity", f"{one.value:g} m/s, {tolerance}, {distance}: {one.standard}"))
    if not threat.velocities:
        lines.append(_row("velocity", "none known; give impact.velocity"))
    return "\n".join([*lines, *_sources(threat.known, threat.assumed)])


def material_text(material: Material) -> str:
    """A material: its strength and law with their uncertainty, the rows that they come from, and its evidence."""
    law = (
        f"Y = {material.resistance / 1e9:.3g} GPa · (h / d)^{material.thickness_exponent:.3g}, "
        f"η = {material.shear_coefficient:g}, B = {material.quadratic:g}, C = {material.linear:g}, "
        f"κ = {material.onset:g}"
    )
    lines = [material.name, _row("density", f"{material.density:g} kg/m³"), _row("law", law)]
    if material.resistance_low is not None and material.resistance_high is not None:
        low, high = material.resistance_low / 1e9, material.resistance_high / 1e9
        lines.append(_row("Y, 90 %", f"{low:.3g} to {high:.3g} GPa, of a plate one calibre thick"))
    if material.hardness is not None:
        lines.append(_row("hardness", f"{material.hardness:g} HV"))
    lines += list(_rows(material))
    if material.misfit is not None and material.misfit_p90 is not None:
        inside = "" if material.coverage is None else f"; {material.coverage:.0%} inside their 90 % interval"
        lines.append(_row("misfit", f"{material.misfit:.1%} median, {material.misfit_p90:.1%} 90th percentile{inside}"))
    return "\n".join([*lines, *_sources(material.known, material.assumed)])


def drawn(core: Core) -> list[str]:
    """The upper half of the profile of a core, nose to the left, in blocks of text; a column is as high as two wide."""
    edge = core.length / _COLUMNS
    radius = core.radius(np.asarray((np.arange(_COLUMNS) + 0.5) * edge)) / (2.0 * edge)  # in rows
    rows = min(_ROWS, math.ceil(radius.max()))
    filled = np.clip(radius[None, :] - np.arange(rows)[::-1, None], 0.0, 1.0)
    lines = ["".join(_BLOCKS[round(8 * share)] for share in row).rstrip() for row in filled.tolist()]
    scale = f"{_MM * core.length:.4g} mm long, {2 * _MM * core.max_radius:.4g} mm wide; the upper half is drawn"
    return [*lines, "─" * _COLUMNS, scale]


def _core(threat: Threat, core: Core) -> Iterator[str]:
    own = core.mass_properties
    published = "" if threat.core_mass is None else f"; published {_G * threat.core_mass:.4g} g"
    if threat.core_density is not None:
        by_volume = core.model_copy(update={"mass": None, "density": threat.core_density}).mass_properties.mass
        volume = f"; its volume at {threat.core_density:g} kg/m³ weighs {_G * by_volume:.4g} g"
    else:
        volume = ""
    yield _row("core mass", f"{_G * own.mass:.4g} g{published}{volume}")
    yield _row("centre of mass", f"{_MM * own.centre_of_mass:.4g} mm behind the nose")
    inertia = f"axial {own.inertia_axial:.4g} kg m², transverse {own.inertia_transverse:.4g} kg m²"
    yield _row("moments of inertia", inertia)


def _rows(material: Material) -> Iterator[str]:
    if not material.rows:
        return
    told = ", ".join(f"{count} of {name}" for name, count in material.rows.items())
    yield _row("limit velocities", f"{material.count}: {told}")
    calibres = f"{material.calibres_low:.3g} to {material.calibres_high or 0.0:.3g} calibres"
    thickness = f"{_MM * material.thickness_low:.4g} to {_MM * (material.thickness_high or 0.0):.4g} mm, {calibres}"
    low, high = math.degrees(material.obliquity_low), math.degrees(material.obliquity_high or 0.0)
    yield _row("range", f"{thickness}, {low:.3g} to {high:.3g}°; beyond it a campaign gets a warning")
    yield _row("sources", ", ".join(material.sources))


def _strength(material: Material) -> str:
    return f"Y {material.resistance / 1e9:.3g} GPa"


def _sources(known: dict[str, str], assumed: dict[str, str]) -> Iterator[str]:
    for name, source in known.items():
        mark = "assumed, as second-hand" if "second-hand" in source else "known"
        yield _row(mark, f"{name.replace('_', ' ')}: {source}")
    for name, stand_in in assumed.items():
        yield _row("assumed", f"{name.replace('_', ' ')}: {stand_in}")


def _row(label: str, text: str) -> str:
    return f"{label:<{_LEFT}}{text}"
