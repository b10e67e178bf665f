"""The table of the fast laws' error, from the states behind every stored plate.

    python tests/benchmarks/law_error.py            # writes warpimpact/continuum/law_error.json

The states of rigid bare cores are in results/continuum_states.csv, those of whole bullets whose cores break in
results/breaking_states.csv. They grow with each plate (continuum_trade.py).
"""

from __future__ import annotations

import json
from pathlib import Path
from typing import NamedTuple

import numpy as np
import pandas as pd
from continuum_cases import FRESH, PLATES, Case

from warpimpact.continuum.front import stopped_energies
from warpimpact.records.variables import failures, has_passed
from warpimpact.scene import Shots
from warpimpact.scene.exit_state import ExitStates, features, flown
from warpimpact.statistics.intervals import Array
from warpimpact.statistics.law_error import LawErrors, PlateStates, learn_errors

STATES = Path(__file__).resolve().parent / "results" / "continuum_states.csv"
AS_FIRED = STATES.with_name("breaking_states.csv")
TABLE = Path(__file__).resolve().parents[2] / "warpimpact" / "continuum" / "law_error.json"
FEWEST = 12
"""Hits of a plate that counts."""
WEAK_LAW = ("hard_700",)
"""Plates whose law has a resistance far below that of their steel, to try answers against; no table is learnt there."""


class StoredPlate(NamedTuple):
    """The hits of a plate that elements did not fail to compute.

    Attributes:
        states: features when the centre of mass is half a length behind the plate.
        fire: lines of fire, [hits, 3].
        velocity: on impact, [hits, m/s].
        length: of the core [m].
        case, shots: what was computed.
    """

    states: PlateStates
    fire: Array
    velocity: Array
    length: float
    case: Case
    shots: Shots


def stored_plates(file: Path = STATES) -> dict[str, StoredPlate]:
    """The plates with enough hits, by name."""
    rows = pd.read_csv(file)
    plates = {str(name): stored_plate(str(name), of_plate) for name, of_plate in rows.groupby("plate", sort=False)}
    return {name: plate for name, plate in plates.items() if len(plate.fire) >= FEWEST}


def stored_plate(name: str, rows: pd.DataFrame) -> StoredPlate:
    """A plate from its rows."""
    by_model = {model: of_model.set_index("hit").sort_index() for model, of_model in rows.groupby("model")}
    counted = by_model.get("continuum", rows[:0])
    hits = counted.index[~failures(counted["status"].to_numpy())]
    laws = (model_features(name, by_model[model].loc[hits]) for model in ("fast", "free_surface"))
    impact = vectors(counted.loc[hits], "impact")
    velocity = np.linalg.norm(impact, axis=1)
    states = PlateStates(*laws, model_features(name, counted.loc[hits]))
    case, numbers = PLATES[name], hits.to_numpy()
    shots = case.shots(int(numbers.max()) + 1)[numbers]
    return StoredPlate(states, impact / velocity[:, None], velocity, case.core.length, case, shots)


def vectors(rows: pd.DataFrame, name: str) -> Array:
    return rows[[f"{name}_{direction}" for direction in "xyz"]].to_numpy(float)


def model_features(name: str, rows: pd.DataFrame) -> Array:
    """Features of the rows of one model. A core that a law stops has those of a march through a weaker plate, but its
    loss of energy over the share of the resistance, as losses are proportional to it to first order."""
    case, impact = PLATES[name], vectors(rows, "impact")
    velocity = np.linalg.norm(impact, axis=1)
    strength, stopped = rows["strength"].to_numpy(), ~has_passed(rows["status"].to_numpy())
    behind = vectors(rows, "exit_position")[:, 0] - case.layers[0].thickness
    exits = ExitStates(*(vectors(rows, one) for one in ("exit_velocity", "exit_axis", "angular_velocity")))
    with np.errstate(invalid="ignore", divide="ignore"):
        exits = flown(exits, 0.5 * case.core.length - behind)
        numbers = features(*exits, impact / velocity[:, None], velocity, case.core.length)
    numbers[:, 0] = 1.0 - (1.0 - numbers[:, 0]) / strength
    at_rest = stopped & (rows["model"] == "continuum").to_numpy()
    numbers[at_rest] = np.nan
    place, axis = (vectors(rows[at_rest], one) for one in ("exit_position", "exit_axis"))
    numbers[at_rest, 0] = stopped_energies(case.scene, place, axis)
    return numbers


def learnt_without(aside: set[str], plates: dict[str, StoredPlate], of_catalogue: bool) -> LawErrors:
    """The error of the laws over the stored plates but some, and those that judge answers."""
    chosen = {name: plate for name, plate in plates.items() if name not in {*aside, *WEAK_LAW, *FRESH}}
    like = [place for place, name in enumerate(chosen) if is_of_catalogue(name) == of_catalogue]
    return learn_errors([plate.states for plate in chosen.values()], like)


def is_of_catalogue(name: str) -> bool:
    """Whether the resistance of a plate is that of the catalogue."""
    return name.startswith("catalogue_")


if __name__ == "__main__":
    tables = dict[str, dict[str, object]]()
    for bodies, plates in (("bare", stored_plates()), ("as fired", stored_plates(AS_FIRED))):
        errors = {name: learnt_without(set(), plates, name == "catalogue") for name in ("given", "catalogue")}
        tables[bodies] = {name: error.numbers for name, error in errors.items()}
    TABLE.write_text(json.dumps(tables) + "\n", encoding="utf-8")
