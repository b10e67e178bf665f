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

from .limit_model import Fit, fit
from .limit_rows import PUBLISHED, STORED, Rows, joined, published
from .limit_splits import LAW, Split, left_out, predictions, questions

PREDICTIONS = STORED / "limit_predictions.csv"
SUMMARY = STORED / "limit_summary.json"


def stored_fit() -> Fit:
    """The fit of the stored rows."""
    stored = json.loads(SUMMARY.read_text(encoding="utf-8"))["fit"]
    return Fit(np.array(stored["values"]), stored["log_posterior"])


def every_prediction(rows: Rows, whole_fit: Fit) -> pd.DataFrame:
    """Of all splits of some rows."""
    splits = [*left_out(rows), *questions(rows)]
    return pd.concat([predictions(rows, one, whole_fit) for one in splits if one.groups])


def of_a_file(rows: Rows, stored: Rows, whole_fit: Fit) -> pd.DataFrame:
    """Predictions of the rows of a file: from the stored rows that are not in it, and from its other rows, too.

    The sizes of the parts of ln Y are those of the stored rows.
    """
    there = _keys(rows)
    rest = stored[~np.isin(_keys(stored), there)]
    both, tested = joined(rest, rows), np.arange(len(rest), len(rest) + len(rows))
    parts = []
    if len(rest):
        known = np.arange(len(both)) < len(rest)
        parts.append(predictions(both, Split("from the stored rows", [tested], [known]), whole_fit))
    parts += [predictions(rows, one, whole_fit) for one in [*left_out(rows), *questions(rows)] if one.groups]
    return pd.concat(parts)


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


def printed(predicted: pd.DataFrame) -> str:
    """A table per split: by projectile and material, fitted on, predicted, errors in % beside the rivals."""
    lines = list[str]()
    for split, own in predicted.groupby("split", sort=False):
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
    whole_fit = fit(rows)
    predicted = every_prediction(rows, whole_fit)
    write(whole_fit, predicted)
    print(printed(predicted))


if __name__ == "__main__":
    main()
