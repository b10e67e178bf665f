"""How often a significant difference between two answers has the sign that elements at all hits say.

    python tests/benchmarks/continuum_trade.py ROWS.csv --hits 200 --plates random_2,random_11,slotted,random_3,oblique
    python tests/benchmarks/comparisons.py ROWS.csv         # writes results/comparisons.csv

The former takes half an hour of a core.

Answers of each plate are drawn with some of its hits by elements, in random splits, and with the law's error of all
other plates. All pairs of plates are compared by each measure.
"""

from __future__ import annotations

import argparse
import zlib
from itertools import combinations
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
from coverage import MEASURES, drawn_maps, numbers_of, quantiles
from law_error import StoredPlate, is_of_catalogue, learnt_without, stored_plate, stored_plates

from warpimpact.statistics.intervals import Array

RESULT = Path(__file__).resolve().parent / "results" / "comparisons.csv"
COUNTS = (5, 8, 12, 24)


def drawn_measures(name: str, plate: StoredPlate, splits: int) -> dict[tuple[int, int], dict[str, Array]]:
    """Draws of each measure of a plate, by its hits by elements and the split."""
    errors = learnt_without({name}, stored_plates(), is_of_catalogue(name))
    by_split = dict[tuple[int, int], dict[str, Array]]()
    for count in COUNTS:
        for split in range(splits):
            numbers = np.random.default_rng([count, split, zlib.crc32(name.encode())])
            at = np.sort(numbers.choice(len(plate.fire), count, replace=False))
            drawn = numbers_of(drawn_maps(plate, at, errors, split), plate)
            by_split[count, split] = {measure: of.of(drawn) for measure, of in MEASURES.items()}
    return by_split


def compared(plates: dict[str, StoredPlate], splits: int) -> pd.DataFrame:
    """For each pair, measure and split: the difference by all hits, and the interval of that of the answers."""
    drawn = {name: drawn_measures(name, plate, splits) for name, plate in plates.items()}
    truth = {name: numbers_of(plate.states.elements[None], plate) for name, plate in plates.items()}
    rows = list[dict[str, Any]]()
    for one, other in combinations(plates, 2):
        for (count, split), of_one in drawn[one].items():
            for name, measure in MEASURES.items():
                right = float(measure.of(truth[one])[0] - measure.of(truth[other])[0])
                value, low, high = quantiles(of_one[name] - drawn[other][count, split][name])
                rows.append({"one": one, "other": other, "elements": count, "measure": name, "right": right,
                             "value": value, "low": low, "high": high})  # fmt: skip
    return pd.DataFrame(rows)


def summary(rows: pd.DataFrame) -> pd.DataFrame:
    """By measure and hits: how many differences are significant, and which share of these has the right sign."""
    differ = rows[rows["right"] != 0.0]
    significant = differ[(differ["low"] > 0.0) | (differ["high"] < 0.0)]
    is_right = np.sign(significant["value"]) == np.sign(significant["right"])
    by = ["measure", "elements"]
    table = significant.assign(right_sign=is_right).groupby(by, sort=False)["right_sign"].agg(["size", "mean"])
    table.columns = ["significant", "right_sign"]
    holds = (differ["low"] <= differ["right"]) & (differ["right"] <= differ["high"])
    every = differ.assign(holds=holds).groupby(by, sort=False)["holds"].agg(["size", "mean"])
    every.columns = ["differences", "holds"]
    return every.join(table).reset_index()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("file", type=Path)
    parser.add_argument("--splits", type=int, default=20)
    arguments = parser.parse_args()
    states = pd.read_csv(arguments.file)
    hits = {str(name): stored_plate(str(name), of) for name, of in states.groupby("plate", sort=False)}
    table = summary(compared(hits, arguments.splits))
    table.round(4).to_csv(RESULT, index=False)
    print(table.round(3).to_string())
