"""Layered targets drawn from a seed: a plate of random_scenes.py with one to three layers behind it.

They are laminated, close or far, thin or thick, patterned or solid, weakening or not. Together they take up to all of
the core's energy, so that some stop a part or all of the hits.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray
from random_scenes import Case, _pattern, draw

from warpimpact.scene import (
    Interaction,
    Layer,
    NoPattern,
    Pattern,
    Record,
    Scene,
    Target,
)

Array = NDArray[np.float64]


def drawn(seed: int, index: int) -> Case:
    """The case of an index, a function of (seed, index) alone."""
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
    scene = Scene(core=core, target=target, interaction=Interaction(), record=Record(standoffs=(0.13,)))
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
