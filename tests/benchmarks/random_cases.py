"""Realistic scenes drawn from a seed: single plates, and targets of layers behind them.

A scene is a hardened core of 5 to 11 mm with an ogive, a cone or the paper's nose, with or without a shank, shot at a
perforated steel plate of 0.5 to 1.5 calibres, straight or obliquely, yawed or not. Layers are laminated, close or far,
thin or thick, patterned or solid, weakening or not. Together they take up to all of the core's energy, so that some
stop a part or all of the hits. Add-ons before a base have the threats and materials of the catalogue.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from warpimpact import Campaign
from warpimpact.scene import (
    CirclePattern,
    ConeCore,
    Core,
    Hits,
    Impact,
    Layer,
    NoPattern,
    OgiveCore,
    Pattern,
    Plate,
    PolynomialCore,
    Record,
    Scene,
    Shots,
    SlotPattern,
    SquarePattern,
    Target,
    TrianglePattern,
    make_shots,
)

STEEL = 7850.0
PAPER = {"coefficients": (3.0e-4, 0.24, -5.29), "length": 27.86e-3, "diameter": 6.044e-3}
RECORD = Record(standoffs=(0.13,))
"""Where tilt is compared."""


@dataclass(frozen=True)
class Case:
    """A scene, how its cores arrive, and a name that tells its features."""

    name: str
    scene: Scene
    impact: Impact

    def shots(self, count: int, seed: int = 0) -> Shots:
        """Hits spread evenly over the cell; the same for every count that holds them."""
        return make_shots(self.impact, Hits(count=count, seed=seed), self.scene.target.layers[0])


def draw(seed: int, index: int) -> Case:
    """The single plate of an index, a function of (seed, index) alone."""
    rng = np.random.default_rng([seed, index])
    diameter = rng.uniform(5e-3, 11e-3)
    core, kind = _core(rng, diameter)
    pattern, holes = _pattern(rng, diameter)
    thickness = rng.uniform(0.5, 1.5) * diameter
    shear, lasting = rng.uniform(0.0, 0.15), rng.uniform(0.7, 1.0)
    length = rng.uniform(0.3e-3, 0.8e-3)
    velocity = rng.uniform(500.0, 950.0)
    # A solid plate without friction takes Y h π R² of the core's energy: at most a third of it here.
    energy = 0.5 * core.mass_properties.mass * velocity**2
    strongest = 0.33 * energy / (thickness * math.pi * core.max_radius**2)
    resistance = min(rng.uniform(1e9, 4e9), max(strongest, 1e9))
    oblique, yawed = rng.random(2) < 0.5
    angles = rng.uniform(0.0, [30.0, 360.0, 3.0, 360.0])
    plate = Plate(
        thickness=thickness,
        resistance=resistance,
        shear_coefficient=shear,
        degradation=lasting,
        degradation_length=length,
        pattern=pattern,
    )
    impact = Impact(
        velocity=velocity,
        obliquity=angles[0] if oblique else 0.0,
        azimuth=angles[1] if oblique else 0.0,
        pitch=angles[2] * math.sin(math.radians(angles[3])) if yawed else 0.0,
        yaw=angles[2] * math.cos(math.radians(angles[3])) if yawed else 0.0,
    )
    way = ("oblique" if oblique else "normal") + (" yawed" if yawed else "")
    scene = Scene(core=core, target=Target(layers=(plate,)), record=RECORD)
    return Case(f"{kind}, {holes}, {way}", scene, impact)


def _core(rng: np.random.Generator, diameter: float) -> tuple[Core, str]:
    kind = rng.choice(["ogive", "cone", "paper"], p=[0.5, 0.25, 0.25])
    shank = rng.uniform(0.5, 2.5) * diameter * (rng.random() < 0.6)
    sharpness = rng.random()
    if kind == "paper":
        scale = diameter / PAPER["diameter"]
        coefficients = tuple(c * scale ** (1 - power) for power, c in enumerate(PAPER["coefficients"]))
        return PolynomialCore(coefficients=coefficients, length=scale * PAPER["length"], density=STEEL), "paper"
    if kind == "ogive":
        crh = 2.0 + 3.0 * sharpness
        length = diameter * math.sqrt(crh - 0.25) + shank
        core: Core = OgiveCore(diameter=diameter, crh=crh, length=length, density=STEEL)
    else:
        nose = (1.2 + 1.3 * sharpness) * diameter
        core = ConeCore(diameter=diameter, cone_length=nose, length=nose + shank, density=STEEL)
    return core, f"{kind} + shank" if shank else str(kind)


def _pattern(rng: np.random.Generator, diameter: float) -> tuple[Pattern, str]:
    shape = rng.choice(["slot", "circle", "triangle", "square"])
    width, ligament = rng.uniform([0.5, 0.3], 1.0) * diameter
    longer, staggered = rng.uniform(2.0, 3.5), bool(rng.random() < 0.5)
    across = {"slot": longer * width, "triangle": 1.5 * width}.get(shape, width)
    spacing = ((width if shape == "slot" else across) + ligament, across + ligament)
    lattice: dict[str, Any] = {"spacing": spacing, "staggered": staggered}
    if shape == "slot":
        return SlotPattern(length=across, width=width, **lattice), "slots"
    if shape == "circle":
        return CirclePattern(diameter=width, **lattice), "circles"
    if shape == "triangle":
        return TrianglePattern(side=across, **lattice), "triangles"
    return SquarePattern(side=width, **lattice), "squares"


def draw_layers(seed: int, index: int) -> Case:
    """The same plate with one to three layers behind it."""
    front, rng = draw(seed, index), np.random.default_rng([seed, index, 1])
    core, plate = front.scene.core, front.scene.target.layers[0]
    calibre, count = 2.0 * core.max_radius, int(rng.integers(1, 4))
    # A solid plate without friction takes Y h π R² of the core's energy.
    energy = 0.5 * core.mass_properties.mass * front.impact.velocity**2 * rng.uniform(0.2, 1.2)
    shares = rng.dirichlet(np.ones(count))
    layers = tuple(_layer(rng, calibre, share * energy / (math.pi * core.max_radius**2)) for share in shares)
    path = {"degradation_interval": None, "degradation_distance": rng.uniform(0.5e-3, 1e-3)}
    by_path: dict[str, Any] = path if rng.random() < 0.5 else {}
    target = Target(layers=(plate.model_copy(update=by_path), *layers))
    scene = Scene(core=core, target=target, record=RECORD)
    kinds = " + ".join("solid" if isinstance(one.pattern, NoPattern) else "holes" for one in layers)
    return Case(f"{front.name} | {kinds}", scene, front.impact)


def _layer(rng: np.random.Generator, calibre: float, work: float) -> Layer:
    """A layer that takes about this energy over the cross section of the core [J/m²]."""
    gap = float(rng.choice([0.0, rng.uniform(0.0, 0.02), rng.uniform(0.02, 0.15)]))
    thickness = float(rng.uniform(0.2, 2.5)) * calibre
    pattern: Pattern = _pattern(rng, calibre)[0] if rng.random() < 0.4 else NoPattern()
    weakens, by_path = rng.random(2) < 0.5
    return Layer(
        gap=gap,
        thickness=thickness,
        resistance=min(work / thickness, 6e9),
        shear_coefficient=float(rng.uniform(0.0, 0.15)),
        degradation=float(rng.uniform(0.7, 1.0)) if weakens else 1.0,
        degradation_length=float(rng.uniform(0.3e-3, 0.8e-3)),
        degradation_distance=0.8e-3 if by_path else None,
        pattern=pattern,
        offset=tuple(rng.uniform(-0.5, 0.5, 2) * calibre),
    )


def draw_addon(seed: int, index: int) -> Case:
    """A perforated plate of hard steel before a base of steel or aluminium, with the names of the catalogue."""
    rng = np.random.default_rng([seed, index, 2])
    threat = rng.choice([".30 AP M2", "7.62x51 P80 AP", "7.62x54R 7N13"])
    hard = rng.choice(["HHA Class 1", "ARMOX500", "MARS440", "SECURE400"])
    hole, ligament = rng.uniform([4.0, 2.5], [9.0, 5.0])
    steels, alloys = ("SECURE350", "SECURE400", "ARMOX370 Class 1"), ("AA5083-H131", "AA7075-T651", "AA6061-T651")
    bases, thickest = (steels, 12.0) if rng.random() < 0.5 else (alloys, 22.0)
    base = rng.choice(bases)
    plate, thickness, velocity, obliquity = rng.uniform([4.0, 5.0, 450.0, 0.0], [8.0, thickest, 880.0, 30.0])
    gap = rng.choice([0.0, rng.uniform(5.0, 100.0)])
    text = f"""
title = "add-on"
core = {{ threat = "{threat}" }}
impact = {{ velocity = "{velocity:.0f} m/s", obliquity = "{obliquity:.1f} deg" }}
hits = {{ count = 512 }}
[plate]
material = "{hard}"
thickness = "{plate:.1f} mm"
pattern = {{ shape = "circle", diameter = "{hole:.1f} mm", spacing = "{hole + ligament:.1f} mm", staggered = true }}
[[layer]]
material = "{base}"
thickness = "{thickness:.1f} mm"
gap = "{gap:.0f} mm"
"""
    campaign = Campaign.from_text(text, name="add-on", folder=Path())
    name = f"{plate:.1f} mm {hard}, {gap:.0f} mm, {thickness:.1f} mm {base}; {velocity:.0f} m/s, {obliquity:.0f}°"
    return Case(name, campaign.scene, campaign.impact)
