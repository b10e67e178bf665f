"""Figure and tables of the published limit velocities beside their predictions."""

from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from .limit_laws import LAWS, RIVALS, thin_plate, unit_velocity
from .limit_rows import CORE, STORED, Array, Rows

FIGURE = STORED / "limit_velocities.png"
PAGE = Path(__file__).parents[2] / "docs" / "validation.md"
BESIDE = ("De Marre, fitted", "energy per area")
"""Rivals that stand beside the chosen law."""
FRICTION = 0.05
"""η of the stress that each row asks for."""
_COLOURS = ("#0072b2", "#e69f00", "#009e73", "#cc79a7", "#56b4e9", "#d55e00", "#000000", "#882255", "#999999")
_MARKS = ("o", "s", "^", "D", "v", "P", "X", "h", "*")


def asked_stress(rows: Rows) -> Array:
    """Constant stress over flow stress with which each row would be met exactly, shape [rows]."""
    zero = np.zeros(len(rows))
    return np.exp(2.0 * (np.log(rows.velocity) - unit_velocity(rows, FRICTION, zero, zero))) / rows.flow_stress


def draw(rows: Rows, found: pd.DataFrame, result: dict[str, Any]) -> None:
    """Store the figure: predicted over published, and the stress that each row asks for over the thickness."""
    figure = Figure(figsize=(12.0, 5.4), layout="constrained")
    left, right = figure.subplots(1, 2)
    law, asked, calibres = result["law"], asked_stress(rows), rows.thickness / CORE.diameter
    shown = found[(found["split"] == "one left out") & (found["method"] == law)]
    names = list(dict.fromkeys(rows.material.tolist()))
    fitted = list(dict.fromkeys(shown["material"]))
    for name in names:
        own = rows.material == name
        is_fitted = name in fitted
        look = {"color": _COLOURS[fitted.index(name)], "marker": _MARKS[fitted.index(name)]} if is_fitted else _FEW
        label = name if is_fitted else ("fewer than three rows" if name == _first_few(names, fitted) else None)
        right.scatter(calibres[own], asked[own], s=28, alpha=0.8, linewidths=0.0, label=label, **look)
        if is_fitted:
            some = shown[shown["material"] == name]
            bars = np.abs(some[["low", "high"]].to_numpy().T - some["predicted"].to_numpy())
            line = {"fmt": look["marker"], "color": look["color"], "ms": 5, "alpha": 0.8, "elinewidth": 0.7}
            left.errorbar(some["published"], some["predicted"], yerr=bars, **line)
    ends = np.array([320.0, 1120.0])
    left.plot(ends, ends, color="0.3", lw=1.0)
    left.fill_between(ends, 0.95 * ends, 1.05 * ends, color="0.85", zorder=0, label="within 5 %")
    left.set(xlim=ends, ylim=ends, xlabel="published limit velocity, m/s", ylabel="predicted limit velocity, m/s")
    left.set_title(f"each row predicted from the others of its material ({law} law; bars: 90 %)", fontsize=10)
    left.legend(loc="upper left", frameon=False)
    line = np.geomspace(0.45, 10.0, 200)
    right.plot(line, thin_plate(line * CORE.diameter), color="0.3", lw=1.2, label="ductile plate (Rosenberg, Dekel)")
    right.set(xscale="log", xlabel="thickness, calibres of the core", ylabel="constant stress asked for / flow stress")
    right.set_xticks([0.5, 1, 2, 4, 8], ["0.5", "1", "2", "4", "8"], minor=False)
    right.xaxis.set_minor_formatter("")
    right.set_ylim(0.0, 5.0)
    right.set_title(f"stress that each row asks for (constant, η = {FRICTION:g})", fontsize=10)
    right.legend(fontsize=8, loc="lower right", frameon=False, ncols=2)
    figure.savefig(FIGURE, dpi=110, metadata={"Software": None})


_FEW = {"color": "0.6", "marker": "."}


def _first_few(names: list[str], fitted: list[str]) -> str | None:
    return next((name for name in names if name not in fitted), None)


def tables(rows: Rows, result: dict[str, Any]) -> dict[str, str]:
    """The tables of the page by name, as Markdown."""
    errors = {(one["split"], one["method"], one["material"]): one for one in result["errors"]}
    found = {
        "materials": _materials(rows, result, errors),
        "methods": _methods(result, errors),
        "strengths": _strengths(rows, result),
    }
    if any(split == "other materials" for split, _, _ in errors):
        found["other materials"] = _other_materials(rows, result, errors)
    return found


def write_tables(rows: Rows, result: dict[str, Any]) -> None:
    """Put the tables into the page, between the marks of each."""
    PAGE.write_text(with_tables(PAGE.read_text(encoding="utf-8"), tables(rows, result)), encoding="utf-8")


def with_tables(page: str, parts: dict[str, str]) -> str:
    """A page with its tables replaced."""
    for name, table in parts.items():
        begin, end = f"<!-- {name} -->\n", f"<!-- end of {name} -->\n"
        before, rest = page.split(begin)
        page = f"{before}{begin}\n{table}\n\n{end}{rest.split(end)[1]}"
    return page


def _materials(rows: Rows, result: dict[str, Any], errors: dict[Any, Any]) -> str:
    methods = (result["law"], *BESIDE)
    lines = ["| material | rows | thickness, mm | angle | " + " | ".join(methods) + " |"]
    lines.append("|---|---|---|---|" + "---|" * len(methods))
    for name in [*result["strength"], "all"]:
        own = rows[rows.material == name] if name != "all" else rows[np.isin(rows.material, list(result["strength"]))]
        angles = np.unique(np.degrees(own.obliquity).round()).astype(int)
        span = f"{1e3 * own.thickness.min():.3g}–{1e3 * own.thickness.max():.3g}"
        angle = f"{angles[0]}°" if len(angles) == 1 else f"{angles[0]}–{angles[-1]}°"
        cells = [_percents(errors["one left out", method, name]) for method in methods]
        lines.append(f"| {name} | {len(own)} | {span} | {angle} | " + " | ".join(cells) + " |")
    cells = [_middle(errors, "one left out", method, list(result["strength"])) for method in methods]
    return "\n".join([*lines, "| median of the materials | | | | " + " | ".join(cells) + " |"])


def _methods(result: dict[str, Any], errors: dict[Any, Any]) -> str:
    kinds = ("one left out", "thicker", "oblique", "other materials")
    counts = [errors.get((kind, "static", "all"), {"rows": 0})["rows"] for kind in kinds]
    heads = [f"{kind} ({count})" for kind, count in zip(kinds, counts, strict=True)]
    law = result["law"]
    lines = ["| method | free | " + " | ".join(heads) + f" | inside 90 % | evidence | {law} nearer |"]
    lines.append("|---|---|" + "---|" * 7)
    free = {law.name: law.parameters for law in (*LAWS, *RIVALS)}
    for name in (*free, "De Marre, fitted"):
        cells = [_percents(errors.get((kind, name, "all"))) for kind in kinds]
        inside = errors["one left out", name, "all"]["inside"]
        known = result["evidence"].get(name)
        cells.append("" if inside is None else f"{100 * inside:.0f} %")
        cells.append("" if known is None else f"{sum(known.values()):.1f}")
        nearer = result["rows nearer than"].get(name)
        cells.append("" if nearer is None else f"{100 * nearer:.0f} %")
        lines.append(f"| {name} | {free.get(name, 2)} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _other_materials(rows: Rows, result: dict[str, Any], errors: dict[Any, Any]) -> str:
    methods = (result["law"], "static, thin plate", "energy per area", "De Marre, 0.7")
    lines = ["| material | rows | flow stress, MPa | " + " | ".join(methods) + " |", "|---|---|---|" + "---|" * 4]
    for name in [*dict.fromkeys(rows.material.tolist()), "all"]:
        some = [errors["other materials", method, name] for method in methods]
        flow = "" if name == "all" else f"{rows.flow_stress[rows.material == name].mean() / 1e6:.0f}"
        cells = [f"{100 * one['median']:.1f}" for one in some]
        lines.append(f"| {name} | {some[0]['rows']} | {flow} | " + " | ".join(cells) + " |")
    names = list(dict.fromkeys(rows.material.tolist()))
    cells = [_middle(errors, "other materials", method, names) for method in methods]
    return "\n".join([*lines, "| median of the materials | | | " + " | ".join(cells) + " |"])


def _strengths(rows: Rows, result: dict[str, Any]) -> str:
    names = list(next(iter(result["strength"].values())))
    heads = [f"Y, {name}, GPa" for name in names]
    lines = ["| material | flow stress, MPa | " + " | ".join(heads) + " |", "|---|---|" + "---|" * len(names)]
    for material, found in result["strength"].items():
        flow = rows.flow_stress[rows.material == material].mean() / 1e6
        cells = [f"{y:.2f} ({low:.2f}–{high:.2f})" for y, low, high in found.values()]
        lines.append(f"| {material} | {flow:.0f} | " + " | ".join(cells) + " |")
    return "\n".join(lines)


def _middle(errors: dict[Any, Any], split: str, method: str, names: list[str]) -> str:
    return f"{100 * np.median([errors[split, method, name]['median'] for name in names]):.1f}"


def _percents(one: dict[str, Any] | None) -> str:
    return "" if one is None else f"{100 * one['median']:.1f} / {100 * one['p90']:.1f}"
