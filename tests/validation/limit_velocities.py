"""Published limit velocities of solid plates beside those that the model and simple rivals predict from other rows.

`python -m tests.validation.limit_velocities` fits the stored rows, writes predictions, summary, figure and the tables
of docs/validation.md. With a file of rows of the same columns it prints, per projectile and material, what was fitted
and predicted, from the stored rows and from the other rows of the file.
"""

import json
import sys
from pathlib import Path

import numpy as np
import pandas as pd

from .limit_model import CHOSEN, LAWS, Fit, Law, Model, fit
from .limit_rows import PUBLISHED, STORED, Rows, joined, published
from .limit_splits import LAW, Split, left_out, predictions, questions

PREDICTIONS = STORED / "limit_predictions.csv"
SUMMARY = STORED / "limit_summary.json"


def stored_fit(law: Law = CHOSEN) -> Fit:
    """The fit of the stored rows."""
    stored = json.loads(SUMMARY.read_text(encoding="utf-8"))["fits"][law.name]
    return Fit(law, np.array(stored["values"]), stored["log_posterior"])


def every_prediction(rows: Rows, found: Fit) -> pd.DataFrame:
    """Of all splits of some rows."""
    splits = [*left_out(rows), *questions(rows)]
    return pd.concat([predictions(rows, one, found) for one in splits if one.groups])


def of_a_file(rows: Rows, stored: Rows, found: Fit) -> pd.DataFrame:
    """Predictions of the rows of a file: from the stored rows that are not in it, and from its other rows, too.

    The sizes of the parts of ln Y are those of the stored rows.
    """
    there = _keys(rows)
    rest = stored[~np.isin(_keys(stored), there)]
    both, tested = joined(rest, rows), np.arange(len(rest), len(rest) + len(rows))
    parts = []
    if len(rest):
        known = np.arange(len(both)) < len(rest)
        parts.append(predictions(both, Split("from the stored rows", [tested], [known]), found))
    parts += [predictions(rows, one, found) for one in [*left_out(rows), *questions(rows)] if one.groups]
    return pd.concat(parts)


def compare_laws(rows: Rows, fits: dict[str, Fit]) -> pd.DataFrame:
    """Of each law and split: median error, coverage, logarithm of the predictive density (elpd) and mean CRPS [m/s]."""
    lines = []
    for law in LAWS:
        values = fits[law.name].values
        model = Model(rows, law).weighed(values)
        residual = model.residual(values)
        for split in left_out(rows):
            mean, variance = model.left_out(values, split.groups)
            place = np.concatenate(split.groups)
            middle, low, high = (one[place] for one in model.velocity(values, mean, variance))
            true, off = rows.velocity[place], (residual - mean)[place] / np.sqrt(variance[place])
            density = -0.5 * off**2 - 0.5 * np.log(2.0 * np.pi * 0.25 * variance[place]) - np.log(true)
            spread = 0.5 * np.sqrt(variance[place]) * middle
            lines.append({
                "law": law.name,
                "split": split.name,
                "rows": len(place),
                "median": round(float(np.median(np.abs(middle / true - 1.0))), 4),
                "inside": round(float(((low <= true) & (true <= high)).mean()), 3),
                "elpd": round(float(density.sum()), 1),
                "crps": round(float(_crps((true - middle) / spread, spread).mean()), 2),
            })  # fmt: skip
    return pd.DataFrame(lines)


def _crps(z: np.ndarray, spread: np.ndarray) -> np.ndarray:
    """Continuous ranked probability score of normal predictions (Gneiting and Raftery 2007)."""
    from scipy.stats import norm

    return np.asarray(spread * (z * (2.0 * norm.cdf(z) - 1.0) + 2.0 * norm.pdf(z) - 1.0 / np.sqrt(np.pi)))


def errors(found: pd.DataFrame, by: list[str]) -> pd.DataFrame:
    """Median and 90th percentile of the relative error, its median with its sign, share inside the intervals."""
    error = found["predicted"] / found["published"] - 1.0
    inside = found["published"].between(found["low"], found["high"]).where(found["low"].notna())
    table = found.assign(error=error.abs(), bias=error, inside=inside)
    groups = table.groupby(by, sort=False)
    return pd.DataFrame({
        "fitted": groups["fitted"].median().astype(int),
        "rows": groups["error"].size(),
        "median": groups["error"].median().round(4),
        "p90": groups["error"].quantile(0.9).round(4),
        "bias": groups["bias"].median().round(4),
        "inside": groups["inside"].mean().astype(float).round(3),
    }).reset_index()  # fmt: skip


def printed(found: pd.DataFrame) -> str:
    """A table per split: by projectile and material, fitted on, predicted, errors in % beside the rivals."""
    lines = list[str]()
    for split, own in found.groupby("split", sort=False):
        lines.append(f"\n{split}: fitted on, predicted, median and 90 % error, bias, inside 90 % | rivals: median")
        every = [(("all", "all"), own), *own.groupby(["projectile", "material"], sort=False)]
        for (projectile, material), some in every:
            table = errors(some, ["method"]).set_index("method")
            one = table.loc[LAW]
            rivals = ", ".join(f"{name} {table.loc[name, 'median']:.1%}" for name in table.index if name != LAW)
            numbers = f"{one['median']:.1%} {one['p90']:.1%} {one['bias']:+.1%} {one['inside']:.0%}"
            lines.append(f"{projectile:<13}{material:<18}{one['fitted']:>5}{one['rows']:>5}  {numbers} | {rivals}")
    return "\n".join(lines)


def _keys(rows: Rows) -> np.ndarray:
    columns = (rows.projectile, rows.bare, rows.material, rows.thickness, rows.obliquity.round(6), rows.velocity)
    return np.array(["|".join(map(str, one)) for one in zip(*columns, strict=True)])


def main() -> None:
    if len(sys.argv) > 1:
        try:
            rows = published(Path(sys.argv[1]))
        except ValueError as error:
            sys.exit(str(error))
        print(printed(of_a_file(rows, published(), stored_fit())))
        return
    from .limit_report import write

    rows = published(PUBLISHED)
    fits = {law.name: fit(rows, law) for law in LAWS}
    found = every_prediction(rows, fits[LAW])
    write(rows, fits, found, compare_laws(rows, fits))
    print(printed(found))


if __name__ == "__main__":
    main()
