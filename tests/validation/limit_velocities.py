"""Published limit velocities of solid plates beside those that the model and simple rivals predict from other rows.

Every row of a material is predicted by a fit to rows of the same material that leaves it out: all others ("one left
out"), thinner ones ("thicker"), those at normal incidence ("oblique"). "other materials" predicts a material from its
tensile test alone. `python -m tests.validation.limit_velocities` writes the predictions and their summary to stored/,
the figure, and the tables of docs/validation.md. With a file of rows of the same columns it prints the tables instead.
"""

import json
import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pandas as pd
from numpy.typing import NDArray

from .limit_laws import LAWS, RIVALS, fit, power_law
from .limit_rows import PUBLISHED, STORED, Rows, published

PREDICTIONS = STORED / "limit_predictions.csv"
SUMMARY = STORED / "limit_summary.json"
LEAST_ROWS = 3
"""Rows of a material that is fitted."""
LEAST_SQUARES = "De Marre, fitted"
Mask = NDArray[np.bool_]


def fitted_materials(rows: Rows) -> list[str]:
    """Materials with rows enough for a fit, in the order of the file."""
    names, counts = np.unique(rows.material, return_counts=True)
    enough = set(names[counts >= LEAST_ROWS])
    return [name for name in dict.fromkeys(rows.material.tolist()) if name in enough]


def splits(rows: Rows) -> Iterator[tuple[str, Mask, Mask]]:
    """Of the rows of one material: what is asked, the rows that are fitted and those that are predicted."""
    for row in range(len(rows)):
        tested = np.arange(len(rows)) == row
        yield "one left out", ~tested, tested
    thick, oblique = rows.thickness > np.median(rows.thickness), rows.obliquity > 0.0
    for name, tested in (("thicker", thick), ("oblique", oblique)):
        if tested.any() and (~tested).sum() >= LEAST_ROWS - 1:
            yield name, ~tested, tested


def predictions(rows: Rows) -> pd.DataFrame:
    """All predictions: columns split, row (in the file), material, published, method, predicted, low, high [m/s].

    low and high enclose 90 %; they are missing where a method has no interval.
    """
    found = [one for name in fitted_materials(rows) for one in _of_material(rows, name)]
    found += _of_other_materials(rows)
    columns = ["split", "row", "material", "published", "method", "predicted", "low", "high"]
    return pd.DataFrame(found, columns=columns).round({"predicted": 1, "low": 1, "high": 1})


def _of_material(rows: Rows, material: str) -> Iterator[tuple[object, ...]]:
    places = np.flatnonzero(rows.material == material)
    own = rows[places]
    for split, fitted, tested in splits(own):
        answers = {law.name: fit(law, own[fitted]).predict(own[tested]) for law in (*LAWS, *RIVALS)}
        least = power_law(own[fitted], own[tested])
        answers[LEAST_SQUARES] = (least, *np.full((2, len(least)), np.nan))
        for method, answer in answers.items():
            for place, values in zip(places[tested], np.transpose(answer), strict=True):
                yield split, place, material, rows.velocity[place], method, *values


def _of_other_materials(rows: Rows) -> list[tuple[object, ...]]:
    """Strength over flow stress as the mean of all other materials, each counted once; all else at its prior."""
    found: list[tuple[object, ...]] = []
    names = list(dict.fromkeys(rows.material.tolist()))
    if len(names) == 1:
        return []
    for law in (*LAWS, *RIVALS):
        x, weights = law.shapes(rows)
        known = weights @ x + law.expected(rows)
        excess = np.log(rows.velocity) - known
        means = {name: excess[rows.material == name].mean() for name in names}
        for place, name in enumerate(rows.material.tolist()):
            others = np.array([mean for other, mean in means.items() if other != name])
            predicted = np.exp(known[place] + others.mean())
            found.append(("other materials", place, name, rows.velocity[place], law.name, predicted, np.nan, np.nan))
    return found


def evidence(rows: Rows) -> pd.DataFrame:
    """Logarithm of the marginal likelihood of each material's rows (index) under each law (columns)."""
    table = {
        law.name: {name: fit(law, rows[rows.material == name]).evidence for name in fitted_materials(rows)}
        for law in (*LAWS, *RIVALS)
    }
    return pd.DataFrame(table)


def chosen(evidences: pd.DataFrame) -> str:
    """The law, of those with a core, under which all rows together are the most probable."""
    return str(evidences[[law.name for law in LAWS]].sum().idxmax())


def summary(rows: Rows, found: pd.DataFrame, evidences: pd.DataFrame) -> dict[str, object]:
    """Median and 90th percentile of the relative error, by split, method and material, and the evidence."""
    error = (found["predicted"] / found["published"] - 1.0).abs()
    inside = found["published"].between(found["low"], found["high"])
    table = found.assign(error=error, inside=inside.where(found["low"].notna()))
    together, own = _spread(table.assign(material="all")), _spread(table)
    names = [law.name for law in LAWS]
    others = {name: str(evidences[names].drop(index=name).sum().idxmax()) for name in evidences.index}
    return {
        "law": chosen(evidences),
        "rows nearer than": _nearer(table, chosen(evidences)),
        "law by the evidence of the other materials": others,
        "evidence": evidences.round(2).to_dict(),
        "strength": _strengths(rows, chosen(evidences)),
        "errors": pd.concat([together, own]).to_dict("records"),
    }


def _strengths(rows: Rows, law: str) -> dict[str, dict[str, list[float]]]:
    """Median and ends of the 90 % interval of Y [GPa] of each material, under the static law and the chosen one."""
    laws = [each for each in LAWS if each.name in ("static", law)]
    return {
        name: {
            each.name: [round(y / 1e9, 3) for y in fit(each, rows[rows.material == name]).strength()] for each in laws
        }
        for name in fitted_materials(rows)
    }


def _nearer(table: pd.DataFrame, law: str) -> dict[str, float]:
    """Share of the rows, one left out, that the law predicts more nearly than each rival does."""
    errors = table[table["split"] == "one left out"].pivot(index="row", columns="method", values="error")
    rivals = [rival.name for rival in RIVALS] + [LEAST_SQUARES]
    return {name: round(float((errors[law] < errors[name]).mean()), 3) for name in rivals}


def _spread(table: pd.DataFrame) -> pd.DataFrame:
    groups = table.groupby(["split", "method", "material"], sort=False)
    errors = groups["error"]
    columns = {
        "rows": errors.size(),
        "median": errors.median().round(4),
        "p90": errors.quantile(0.9).round(4),
        "inside": groups["inside"].mean().astype(float).round(3),
    }
    result = pd.DataFrame(columns).reset_index()
    return result.astype({"inside": object}).where(result.notna(), None)


def main() -> None:
    from .limit_report import draw, tables, write_tables

    file = Path(sys.argv[1]) if len(sys.argv) > 1 else PUBLISHED
    rows = published(file)
    if not fitted_materials(rows):
        sys.exit(f"{file}: no material has {LEAST_ROWS} rows or more, which a fit needs")
    found, evidences = predictions(rows), evidence(rows)
    result = summary(rows, found, evidences)
    if file == PUBLISHED:
        found.to_csv(PREDICTIONS, index=False)
        SUMMARY.write_text(json.dumps(result, indent=1) + "\n", encoding="utf-8")
        draw(rows, found, result)
        write_tables(rows, result)
    for table in tables(rows, result).values():
        print(table, end="\n\n")


if __name__ == "__main__":
    main()
