"""Published limit velocities of solid plates beside those that the model and simple rivals predict from other rows.

`python -m tests.validation.limit_velocities` fits the stored rows, and writes predictions, summary and figure. The page
docs/validation.md shows them.
"""

import json
from typing import Any

import numpy as np
import pandas as pd
from matplotlib.figure import Figure

from .limit_model import METALS, Fit, fit
from .limit_rows import PROJECTILES, STORED, Rows, published
from .limit_splits import CARBIDE, LAW, RIVALS, left_out, predictions, questions

PREDICTIONS = STORED / "limit_predictions.csv"
SUMMARY = STORED / "limit_summary.json"
FIGURE = STORED / "limit_velocities.png"
Table = tuple[tuple[str, ...], list[tuple[str, ...]]]
"""Heads of columns, and rows."""
KEPT = ("one row out", "one thickness out", "one material out", CARBIDE)
"""Splits whose predictions are stored."""
LEAST_ROWS = 6
_COLOURS = {".30 AP M2": "#0072B2", ".50 AP M2": "#E69F00", "14.5 mm B32": "#009E73", "14.5 mm BS41": "#D55E00"}
_MARKS = {".30 AP M2": "o", ".50 AP M2": "s", "14.5 mm B32": "^", "14.5 mm BS41": "D"}
_ENDS = np.array([300.0, 1150.0])


def stored_fit() -> Fit:
    """The fit of the stored rows."""
    stored = json.loads(SUMMARY.read_text(encoding="utf-8"))["fit"]
    return Fit(np.array(stored["values"]), stored["log_posterior"])


def every_prediction(rows: Rows, whole_fit: Fit) -> pd.DataFrame:
    """Of all splits of some rows."""
    splits = [*left_out(rows), *questions(rows)]
    return pd.concat([predictions(rows, one, whole_fit) for one in splits if one.groups])


def errors(predicted: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    """Median and 90th percentile of the relative error, its median with its sign, share inside the intervals."""
    error = predicted["predicted"] / predicted["published"] - 1.0
    inside = predicted["published"].between(predicted["low"], predicted["high"]).where(predicted["low"].notna())
    table = predicted.assign(error=error.abs(), bias=error, inside=inside)
    groups = table.groupby(by, sort=False)
    return pd.DataFrame({
        "fitted": groups["fitted"].median().astype(int),
        "rows": groups["error"].size(),
        "median": groups["error"].median().round(4),
        "p90": groups["error"].quantile(0.9).round(4),
        "bias": groups["bias"].median().round(4),
        "inside": groups["inside"].mean().astype(float).round(3),
    }).reset_index()  # fmt: skip


def write(whole_fit: Fit, predicted: pd.DataFrame) -> None:
    """Store predictions, summary and figure."""
    kept = predicted[predicted["split"].isin(KEPT) & (predicted["method"] == LAW)]
    kept.to_csv(PREDICTIONS, index=False)
    summary = {
        "fit": {
            "values": [float(f"{value:.6g}") for value in whole_fit.values],
            "log_posterior": round(whole_fit.log_posterior, 2),
            "parts": {part: round(size, 4) for part, size in whole_fit.scales.items()},
            "friction": round(whole_fit.friction, 4),
        },
        "splits": json.loads(errors(predicted, ["split", "method"]).to_json(orient="records")),
        "plates": json.loads(
            errors(predicted, ["split", "projectile", "material", "method"]).to_json(orient="records")
        ),
    }
    SUMMARY.write_text(json.dumps(summary, indent=1, allow_nan=False) + "\n", encoding="utf-8")
    draw(predicted[predicted["method"] == LAW])


def draw(predicted: pd.DataFrame) -> None:
    """Store the figure: left every row predicted without a fifth of the rows, which is its own; right the tests."""
    figure = Figure(figsize=(12.0, 6.2), layout="constrained")
    panels = figure.subplots(1, 2, sharex=True, sharey=True)
    shown = {
        "every row, from a fit without its fifth of the rows": ["a fifth out"],
        "angles from 0°, larger and carbide cores from .30 rows alone": [
            "angle: from 0°",
            "scale: .50 and B32 from .30",
            CARBIDE,
        ],
    }
    for axes, (title, splits) in zip(panels, shown.items(), strict=True):
        some = predicted[predicted["split"].isin(splits)]
        for name in PROJECTILES:
            own = some[some["projectile"] == name]
            if len(own):
                style = {"ms": 4.5, "mew": 0.9, "mfc": "none", "ls": "none", "alpha": 0.8}
                label = f"{name} ({len(own)})"
                axes.plot(own["published"], own["predicted"], _MARKS[name], color=_COLOURS[name], label=label, **style)
        axes.plot(_ENDS, _ENDS, color="0.3", lw=1.0)
        axes.fill_between(_ENDS, 0.95 * _ENDS, 1.05 * _ENDS, color="0.88", zorder=0, label="within 5 %")
        axes.set(xlim=_ENDS, ylim=_ENDS, aspect="equal", xlabel="published limit velocity [m/s]", title=title)
        axes.legend(loc="upper left", frameon=False)
    panels[0].set_ylabel("predicted limit velocity [m/s]")
    figure.savefig(FIGURE, dpi=110, metadata={"Software": None})


def tables() -> dict[str, Table]:
    """The tables of the page by name, from the stored summary."""
    summary = json.loads(SUMMARY.read_text(encoding="utf-8"))
    return {"splits": _splits(summary), "plates": _plates(summary), "parts": _parts(summary)}


def _splits(summary: dict[str, Any]) -> Table:
    by = {(one["split"], one["method"]): one for one in summary["splits"]}
    rows = []
    for split in dict.fromkeys(one["split"] for one in summary["splits"]):
        own = by[split, LAW]
        cells = [_percents(own), f"{100 * own['bias']:+.1f}", f"{100 * own['inside']:.0f} %"]
        cells += [_percents(by[split, name]) for name in RIVALS]
        rows.append((split, str(own["rows"]), *cells))
    return ("question", "rows", "model", "bias", "inside 90 %", *RIVALS), rows


def _plates(summary: dict[str, Any]) -> Table:
    own = [one for one in summary["plates"] if one["split"] == "one row out"]
    by = {(one["projectile"], one["material"], one["method"]): one for one in own}
    rows = []
    for projectile, material, method in by:
        one = by[projectile, material, method]
        if method == LAW and one["rows"] >= LEAST_ROWS:
            rivals = (_percents(by[projectile, material, name]) for name in RIVALS)
            inside = f"{100 * one['inside']:.0f} %"
            rows.append((projectile, material, str(one["rows"]), _percents(one), inside, *rivals))
    return ("projectile", "material", "rows", "model", "inside 90 %", *RIVALS), rows


def _parts(summary: dict[str, Any]) -> Table:
    parts = summary["fit"]["parts"]
    names = dict.fromkeys(name.rpartition(", ")[0] for name in parts)
    rows = []
    for name in names:
        cells = (f"{50 * parts[of]:.1f}" if (of := f"{name}, {metal}") in parts else "-" for metal in METALS)
        rows.append((name, *cells))
    return ("part of ln Y", "steel", "aluminium"), rows


def _percents(one: dict[str, Any]) -> str:
    return f"{100 * one['median']:.1f} / {100 * one['p90']:.1f}"


def main() -> None:
    rows = published()
    whole_fit = fit(rows)
    write(whole_fit, every_prediction(rows, whole_fit))


if __name__ == "__main__":
    main()
