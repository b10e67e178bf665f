"""How the resistance of a solid plate grows with its thickness: forms of a local law beside published limit velocities.

    python -m tests.validation.thickness_laws

A form gives the static stress at a surface element of radius r in a plate of thickness H as a share of the material's
strength P; C √(ρ P) v_n is added to it. For each row of limit_rows.py, P is the median of what the other thicknesses
of its projectile, material and angle ask for. So no form is fitted to a row that it predicts, and a form that grows
wrongly with the thickness misses. The path is H / cos θ; there is no friction.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import NamedTuple

import numpy as np

from .limit_rows import Array, Rows, core, published

DENSITY = {"steel": 7850.0, "aluminium": 2700.0}
STATIONS, DEPTHS = 200, 160
ALIKE, LEAST_ROWS, SPREAD = 0.05, 3, 1.3
"""Relative difference up to which thicknesses are one; rows of a group, and its largest thickness over its least."""
COEFFICIENTS = (0.0, 0.5, 1.0, 1.5, 2.0, 2.5)
"""C of the rate term."""

Form = Callable[[Array], Array]
FORMS: dict[str, Form] = {
    "constant": np.ones_like,
    "ln(1 + H/r)": lambda x: np.log(1.0 + 1.0 / x),
    "1/(1 + r/2H)": lambda x: 1.0 / (1.0 + 0.5 * x),
    "1/(1 + r/H)": lambda x: 1.0 / (1.0 + x),
    "1/(1 + 2r/H)": lambda x: 1.0 / (1.0 + 2.0 * x),
    "1/(1 + (r/H)²)": lambda x: 1.0 / (1.0 + x * x),
    "1/(1 + (2r/H)²)": lambda x: 1.0 / (1.0 + 4.0 * x * x),
    "exp(−r/H)": lambda x: np.exp(-x),
}
"""Share of the strength by r/H."""


class Nose(NamedTuple):
    """Rings of a core up to its largest radius: station, radius, area along the axis, and the normal along it."""

    station: Array
    radius: Array
    area: Array
    facing: Array
    mass: float


def nose_of(projectile: str) -> Nose:
    """Of the core of a projectile; a blunt tip is one ring."""
    body = core(projectile)
    edges = np.linspace(0.0, body.length, STATIONS + 1)
    radii = body.radius(edges)
    edges, radii = edges[: radii.argmax() + 1], radii[: radii.argmax() + 1]
    slope = np.diff(radii) / np.diff(edges)
    middle = 0.5 * (radii[1:] + radii[:-1])
    tip = np.pi * radii[0] ** 2
    return Nose(
        np.append(0.0, 0.5 * (edges[1:] + edges[:-1])),
        np.append(2.0 / 3.0 * max(radii[0], 1e-6), middle),
        np.append(tip, 2.0 * np.pi * middle * np.diff(radii)),
        np.append(1.0, slope / np.sqrt(1.0 + slope**2)),
        body.mass_properties.mass,
    )


def limits(nose: Nose, form: Form, strengths: Array, thickness: float, cosine: float, rate: float) -> Array:
    """Limit velocities [m/s] of plates of some strengths [Pa]: the motion from the rest behind the plate back to its
    front. `rate` is C √ρ."""
    way = thickness / cosine
    depths = np.linspace(way + nose.station[-1], 0.0, DEPTHS + 1)
    middle, step = 0.5 * (depths[1:] + depths[:-1]), depths[0] - depths[1]
    inside = (middle[:, None] > nose.station) & (middle[:, None] < nose.station + way)
    static = inside @ (nose.area * form(nose.radius / thickness))
    rating = inside @ (nose.area * nose.facing)
    velocity = np.zeros(len(strengths))
    for at, by_speed in zip(static, rating, strict=True):
        force = strengths * at + rate * np.sqrt(strengths) * by_speed * velocity
        velocity = np.sqrt(velocity**2 + 2.0 * force / nose.mass * step)
    return velocity


def groups(rows: Rows, metal: str) -> Iterator[Array]:
    """Rows of one projectile, material and angle of several thicknesses."""
    labels = [
        f"{a}|{b}|{c}|{d:.0f}"
        for a, b, c, d in zip(rows.projectile, rows.bare, rows.material, np.degrees(rows.obliquity), strict=True)
    ]
    for label in dict.fromkeys(labels):
        chosen = np.flatnonzero((np.array(labels) == label) & (rows.steel == (metal == "steel")))
        if len(chosen) >= LEAST_ROWS and np.ptp(np.log(rows.thickness[chosen])) > np.log(SPREAD):
            yield chosen


def errors(rows: Rows, metal: str, form: Form, coefficient: float) -> Array:
    """Relative errors of the limit velocities, each predicted from other thicknesses."""
    found = []
    tried, rate = np.geomspace(2e7, 4e10, 60), coefficient * np.sqrt(DENSITY[metal])
    for chosen in groups(rows, metal):
        nose, cosine = nose_of(str(rows.projectile[chosen[0]])), float(np.cos(rows.obliquity[chosen[0]]))
        tables = [np.log(limits(nose, form, tried, h, cosine, rate)) for h in rows.thickness[chosen]]
        asked = np.array([
            np.interp(np.log(v), table, np.log(tried)) for v, table in zip(rows.velocity[chosen], tables, strict=True)
        ])  # fmt: skip
        thickness = np.log(rows.thickness[chosen])
        for k, table in enumerate(tables):
            others = np.abs(thickness - thickness[k]) > ALIKE
            if others.any():
                predicted = np.interp(np.median(asked[others]), np.log(tried), table)
                found.append(np.expm1(predicted - np.log(rows.velocity[chosen[k]])))
    return np.array(found)


def main() -> None:
    """Print the median and the mean absolute error of every form, in %, with the rate term that serves it best."""
    rows = published()
    for metal in DENSITY:
        for name, form in FORMS.items():
            tried = {c: np.abs(errors(rows, metal, form, c)) for c in COEFFICIENTS}
            best = min(tried, key=lambda c: tried[c].mean())
            cells = " ".join(f"C {c:g}: {100 * np.median(e):.1f}, {100 * e.mean():.1f};" for c, e in tried.items())
            print(f"{metal:9} {name:16} {len(tried[best])} rows, best C {best:g} | {cells}", flush=True)


if __name__ == "__main__":
    main()
