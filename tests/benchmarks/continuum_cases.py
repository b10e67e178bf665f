"""The plates on which the fast law stands beside the continuum."""

from __future__ import annotations

import math
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd

from warpimpact import (
    CirclePattern,
    Hits,
    Impact,
    Layer,
    OgiveCore,
    Plate,
    Record,
    Scene,
    SlotPattern,
    catalogue,
    make_shots,
)
from warpimpact.scene import HexagonPattern, PolynomialCore, Scatter, Shots, SquarePattern
from warpimpact.scene.pattern import Pattern
from warpimpact.scene.scatter import Normal, Uniform

CORE = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, mass=4.0e-3)
BULLET_CORE = OgiveCore(diameter=6.248e-3, crh=3.0, length=27.5e-3, mass=5.3e-3)
"""Core of the .30 AP M2, with which limit velocities of solid plates are published."""
PAPER = {"resistance": 2.6e9, "shear_coefficient": 0.05, "degradation": 0.8, "degradation_interval": 1e-6}
ALUMINIUM = {"resistance": 1.1e9, "shear_coefficient": 0.05, "density": 2700.0}
SLOTS = SlotPattern(length=12e-3, width=4e-3, spacing=(8e-3, 16e-3), staggered=True)
STEEL = "ARMOX560T Johnson-Cook"
YAWED = Normal(mean=0.0, std=math.radians(1.5))
"""Pitch and yaw of the hits of a solid plate."""


def round_holes(diameter: float, pitch: float) -> CirclePattern:
    """On a hexagonal lattice."""
    return CirclePattern(diameter=diameter, spacing=(0.5 * pitch * 3**0.5, pitch), staggered=True)


class Case(NamedTuple):
    """A target, the materials of its layers, the core and how it arrives.

    Attributes:
        title: what it is, for a table.
        layers: with the parameters of the fast law.
        flows: materials of the continuum, by layer.
        velocities: limits of the velocity, which differs from hit to hit at a solid plate [m/s].
    """

    title: str
    layers: tuple[Plate | Layer, ...]
    flows: tuple[str, ...]
    impact: Impact = Impact(velocity=825.0)
    core: PolynomialCore | OgiveCore = CORE
    velocities: tuple[float, float] | None = None

    @property
    def scene(self) -> Scene:
        return Scene(core=self.core, target=self.layers, record=Record(standoffs=(0.05, 0.13)))

    def shots(self, count: int) -> Shots:
        """The first hits; more of them begin with the same ones."""
        scatter = None
        if self.velocities is not None:
            low, high = self.velocities
            scatter = Scatter(velocity=Uniform(low=low, high=high), pitch=YAWED, yaw=YAWED)
        return make_shots(self.impact, Hits(count=count, seed=1), self.layers[0], scatter)


def solid(
    title: str, thickness: float, resistance: float, friction: float, flow: str, velocities: tuple[float, float]
) -> Case:
    """A solid plate that the core of the .30 AP M2 hits, with what the catalogue fits to its published limits."""
    density = 2700.0 if flow.startswith("AA") else 7850.0
    plate = Plate(thickness=thickness, resistance=resistance, shear_coefficient=friction, density=density)
    return Case(title, (plate,), (flow,), core=BULLET_CORE, velocities=velocities)


SLOTTED = Plate(thickness=4e-3, pattern=SLOTS, **PAPER)
THIN = Plate(thickness=1.25e-3, pattern=round_holes(5.75e-3, 7.25e-3), **PAPER)
THICK = Plate(thickness=6e-3, pattern=round_holes(5e-3, 8e-3), **PAPER)
SOFT = Plate(thickness=8e-3, pattern=round_holes(5e-3, 8e-3), **ALUMINIUM)
BASE = Layer(thickness=6e-3, gap=50e-3, **ALUMINIUM)
OBLIQUE = Impact(velocity=825.0, obliquity=30.0)
CASES = {
    "slotted": Case("4 mm, slots of 4 × 12 mm (the paper's)", (SLOTTED,), (STEEL,)),
    "thin": Case("1.25 mm, holes of 5.75 mm at 7.25 mm", (THIN,), (STEEL,)),
    "thick": Case("6 mm, holes of 5 mm at 8 mm", (THICK,), (STEEL,)),
    "oblique": Case("the paper's at 30°", (SLOTTED,), (STEEL,), OBLIQUE),
    "based": Case("thin, 50 mm before 6 mm of AA6082-T6", (THIN, BASE), (STEEL, "AA6082-T6")),
    "aluminium": Case("8 mm of AA6082-T6, holes of 5 mm at 8 mm", (SOFT,), ("AA6082-T6",)),
    "solid_6.5": solid("6.5 mm of HARDOX400, solid", 6.5e-3, 3.146e9, 0.039, "HARDOX400", (650.0, 850.0)),
    "solid_12": solid("12 mm of ARMOX560T, solid", 12e-3, 4.041e9, 0.039, STEEL, (900.0, 1100.0)),
    "solid_20": solid("20 mm of AA6082-T6, solid", 20e-3, 0.935e9, 0.05, "AA6082-T6", (600.0, 800.0)),
}


LIMITED = {
    "solid_20_7075": solid("20 mm of AA7075-T651, solid", 20e-3, 1.178e9, 0.039, "AA7075-T651", (700.0, 900.0)),
}
"""Plates of which the limit velocity alone is computed."""


def drawn_pattern(draw: np.random.Generator, shape: int) -> tuple[str, Pattern]:
    """Words and holes of a shape, of a size drawn at random."""
    size, ligament = (1e-3 * draw.uniform(*ends) for ends in ((3.5, 6.0), (1.5, 3.0)))
    pitch = size + ligament
    patterns = {
        "circles": CirclePattern(diameter=size, spacing=(pitch, pitch)),
        "squares": SquarePattern(side=size, spacing=(pitch, pitch), corner_radius=3e-4),
        "hexagons": HexagonPattern(width=size, spacing=pitch, staggered=True),
        "slots": SlotPattern(width=size, length=2.0 * size, spacing=(pitch, pitch + size)),
    }
    name = [*patterns][shape % len(patterns)]
    return f"{name} of {1e3 * size:.1f} mm at {1e3 * pitch:.1f} mm", patterns[name]


def random_plate(seed: int) -> Case:
    """A plate drawn at random, but materials and shapes of holes come in turn."""
    draw = np.random.default_rng(seed)
    flow = (STEEL, "HARDOX400", "AA6082-T6")[seed % 3]
    thickness = 1e-3 * draw.uniform(1.0, 8.0)
    holes, pattern = drawn_pattern(draw, seed)
    obliquity = round(draw.uniform(0.0, 35.0))
    law = {STEEL: PAPER, "HARDOX400": PAPER | {"resistance": 2.2e9}, "AA6082-T6": ALUMINIUM}[flow]
    plate = Plate(thickness=thickness, pattern=pattern, **law)
    core = (CORE, BULLET_CORE)[draw.integers(2)]
    title = f"{1e3 * thickness:.1f} mm of {flow}, {holes}, {obliquity}°"
    impact = Impact(velocity=825.0, obliquity=float(obliquity))
    return Case(title + (", .30 AP M2" if core is BULLET_CORE else ""), (plate,), (flow,), impact, core)


def catalogue_plate(seed: int) -> Case:
    """A plate drawn at random, of a material whose resistance and strength factor meet published limit velocities;
    materials and shapes of holes come in turn."""
    draw, threat = np.random.default_rng([seed, 2]), catalogue.threat(".30 AP M2")
    material = ("HHA Class 1", "AA7085-T711", "ARMOX500", "SECURE400", "AA6061-T651", "BIS HHA")[seed % 6]
    thickness = 1e-3 * draw.uniform(*((8.0, 18.0) if material.startswith("AA") else (3.0, 7.0)))
    holes, pattern = drawn_pattern(draw, seed)
    obliquity = round(draw.uniform(0.0, 30.0))
    how = {"threat": threat, "obliquity": f"{obliquity} deg", "thickness": thickness, "pattern": pattern}
    plate = catalogue.plate(material, **how)
    words = f"{1e3 * thickness:.1f} mm of {material}, {holes}, {obliquity}°, .30 AP M2"
    impact = Impact(velocity=threat.velocity, obliquity=float(obliquity))
    return Case(words, (plate,), (material,), impact, threat.core)


RANDOM = {f"random_{seed}": random_plate(seed) for seed in range(1, 7)}
"""Plates that nothing was fitted to or chosen by."""
NAMED = {f"catalogue_{seed}": catalogue_plate(seed) for seed in range(6)}
FRESH = {f"random_{seed}": random_plate(seed) for seed in range(7, 12)} | {
    f"catalogue_{seed}": catalogue_plate(seed) for seed in range(6, 10)
}
"""Plates from which no error of the laws is learnt: they judge answers."""


def hard_plate(velocity: float, resistance: float, diameter: float = 3e-3) -> Case:
    """8 mm of ARMOX560T with small holes, which elements stop some cores in."""
    plate = Plate(thickness=8e-3, pattern=round_holes(diameter, 12e-3), **PAPER | {"resistance": resistance})
    title = f"8 mm of ARMOX560T, holes of {1e3 * diameter:.0f} mm at 12 mm, {velocity:.0f} m/s"
    return Case(title, (plate,), (STEEL,), Impact(velocity=velocity))


def add_on(thickness: float, pattern: CirclePattern | SlotPattern, flow: str, impact: Impact) -> Case:
    """The perforated plate of an add-on at another speed."""
    plate = Plate(thickness=thickness, pattern=pattern, **PAPER | ({} if flow == STEEL else {"resistance": 2.2e9}))
    words = f"{1e3 * thickness:.1f} mm of {flow}, {impact.velocity:.0f} m/s at {impact.obliquity:.0f}°"
    return Case(words, (plate,), (flow,), impact)


STATED = {
    "add_on_700": add_on(2.5e-3, round_holes(4.5e-3, 6.5e-3), "HARDOX400", Impact(velocity=700.0, obliquity=15.0)),
    "add_on_920": add_on(2e-3, SLOTS, STEEL, Impact(velocity=920.0, obliquity=20.0)),
    "hard_700": hard_plate(700.0, 1.2e9),
    "hard_660": hard_plate(660.0, 2.6e9, 4e-3),
}
"""Plates of which states behind them are computed, beside those above."""
PLATES = {**CASES, **LIMITED, **RANDOM, **NAMED, **FRESH, **STATED}


class Published(NamedTuple):
    """A published limit velocity [m/s], of which projectile and material, and its key in the ballistic limit database
    of Ryan and others (Mendeley Data, 10.17632/4f92y6jzzh.2)."""

    velocity: float
    projectile: str
    material: str
    source: str


PUBLISHED = {
    "solid_6.5": Published(525.0, "complete bullet", "SECURE400, 405 HV", "kaiser_11_isb"),
    "solid_12": Published(871.0, "complete bullet", "ARMOX560, 560 HV", "borvik_09_ijie"),
    "solid_20": Published(514.0, "bare core", "AA6082-T6", "forrestal_14_expmech"),
    "solid_20_7075": Published(633.0, "bare core", "AA7075-T651", "forrestal_10_expmech"),
}

MEASURES = {"velocity": "m/s", "tilt_50": "°", "tilt_130": "°"}
"""Columns of the rows, and their units."""


KEYS = ("plate", "friction", "model")
"""What the columns of rows begin with."""


def written(path: Path) -> pd.DataFrame:
    """The rows of a table; none if there is no file."""
    if not path.exists():
        return pd.DataFrame(columns=["plate", "friction", "spacing", "model", "hit", "velocity", "status", "residual"])
    return pd.read_csv(path, dtype={"friction": str, "spacing": str})


def append(path: Path, rows: pd.DataFrame) -> None:
    """Append rows to a table, which begins with the names of its columns."""
    ordered = rows[[name for name in KEYS if name in rows] + [name for name in rows if name not in KEYS]]
    known = [*written(path).head(0)] if path.exists() else [*ordered]
    ordered[known].to_csv(path, mode="a", header=not path.exists(), index=False)


def measured(rows: pd.DataFrame, plate: str, model: str) -> pd.DataFrame:
    """The measures of the hits of a plate that perforated it, by their numbers."""
    chosen = rows[(rows["plate"] == plate) & (rows["model"] == model) & (rows["status"] == 0)]
    return chosen.set_index("hit")[list(MEASURES)].sort_index()
