"""Parameters drawn from a posterior: every shot of a campaign gets one of its draws, all parameters together.

The posterior gives the resistance of the material. Holes, thickness and core are those of the campaign, not those of
the shots behind the posterior.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path as FilePath
from typing import Any

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from warpimpact.results import posterior_file
from warpimpact.results.files import read_tree
from warpimpact.scene import Interaction, Plate, Sampler, Shots
from warpimpact.scene.model import Array
from warpimpact.scene.quantities import QUANTITIES
from warpimpact.solver.columns import Path, columns_of

OF_THE_MATERIAL: tuple[Path, ...] = tuple(
    (quantity.table, name) for name, quantity in QUANTITIES.items() if quantity.drawn
)
"""Quantities that a posterior may give. All others stay those of the campaign."""
MOST_DRAWS = 64
"""Most draws that a run uses. Several hits of each draw separate the scatter of the parameters from that of the
hits."""
_COLUMN = 2**20
"""Column of the random numbers that choose the draws. Scattered quantities have small column numbers."""


@dataclass(frozen=True)
class Posterior:
    """Draws of material parameters, SI, by path, each of shape [draws].

    Attributes:
        found_with: other values of the material in the fit, by table and key. A parameter is only valid with them.
    """

    values: Mapping[Path, Array]
    found_with: Mapping[str, Mapping[str, Any]]

    @property
    def draws(self) -> int:
        """Number of draws that are used."""
        return min(MOST_DRAWS, len(next(iter(self.values.values()))))

    @property
    def discrepancy(self) -> dict[str, float]:
        """Standard deviations of the model's error, by units of a Dataset; empty in a file without them."""
        return {unit: float(size) for unit, size in self.found_with.get("discrepancy", {}).items()}

    def check(self, plate: Plate, interaction: Interaction) -> None:
        """Refuse a material whose fixed values differ from those of the fit.

        Raises:
            ValueError: the message names the first difference.
        """
        given = {"plate": plate.model_dump(), "interaction": interaction.model_dump()}
        there, here = self.found_with["interaction"].get("free_surface"), given["interaction"]["free_surface"]
        if here != there:
            raise ValueError(
                f"the posterior was found with interaction.free_surface = {there}, but the campaign has {here}; its "
                "draws are valid only with that of the fit"
            )
        for table, key in OF_THE_MATERIAL:
            there = self.found_with[str(table)].get(str(key))
            here = given[str(table)][str(key)]
            if (table, key) in self.values:
                if here is None:
                    raise ValueError(f"the posterior gives {table}.{key}, but the plate of the campaign has none")
            elif (table, key) != ("plate", "resistance") and here != there:
                raise ValueError(
                    f"the posterior was found with {table}.{key} = {there}, but the campaign has {here}; its draws are "
                    "valid only with the value of the fit"
                )

    def which(self, seed: int, first: int, count: int) -> NDArray[np.int64]:
        """Numbers of the draws of shots from number `first` on. They depend on the seed and the number of the shot.

        The seed chooses `draws` draws from all of the posterior. Each block of as many consecutive shots has every draw
        once, in an order of its own."""

        def ordered(key: int, size: int) -> NDArray[np.int64]:
            return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(_COLUMN, key))).permutation(size)

        used = ordered(0, len(next(iter(self.values.values()))))[: self.draws]
        blocks = range(first // self.draws, (first + count - 1) // self.draws + 1)
        places = np.concatenate([ordered(block + 1, self.draws) for block in blocks])
        chosen: NDArray[np.int64] = used[places[first - blocks.start * self.draws :][:count]]
        return chosen


class DrawnSampler(Sampler):
    """The shots of a campaign, each with a draw of the posterior; the images of a shot share theirs."""

    def __init__(self, posterior: Posterior, plate: Plate, seed: int, images: int, *sampled: Any) -> None:
        super().__init__(*sampled)
        self._posterior, self._plate, self._seed, self._images = posterior, plate, seed, images

    def shots(self, first: int, count: int) -> Shots:
        shots = super().shots(first, count)
        numbers = np.arange(first, first + len(shots)) // self._images
        chosen = self._posterior.which(self._seed, int(numbers[0]), int(np.ptp(numbers)) + 1)[numbers - numbers[0]]
        drawn = {path: column[chosen] for path, column in self._posterior.values.items()}
        return replace(shots.with_own(columns_of(drawn, self._plate)), posterior_draw=chosen.astype(np.float64))


def read_posterior(path: FilePath) -> Posterior:
    """The material parameters of a posterior file.

    Raises:
        ResultError: the file cannot be read.
        ValueError: the file has no parameter of a material.
    """
    stat = path.stat() if path.is_file() else None
    return _read(path, None if stat is None else (stat.st_mtime_ns, stat.st_size))


@lru_cache(maxsize=4)
def _read(path: FilePath, _changed: tuple[int, int] | None) -> Posterior:
    tree = read_tree(path, posterior_file.DRAWS)
    draws = tree["posterior"].to_dataset()
    values: dict[Path, Array] = {}
    for array in draws.data_vars.values():
        at = tuple(json.loads(str(array.attrs.get(posterior_file.PATH, "[]"))))
        if at in OF_THE_MATERIAL:
            values[at] = array.values.ravel().astype(np.float64)
    if not values:
        known = ", ".join(".".join(map(str, path)) for path in OF_THE_MATERIAL)
        raise ValueError(f"{path.name}: has none of the parameters that a run takes from a posterior: {known}")
    for (table, key), column in values.items():
        for value in (column.min(), column.max()):
            _check_value(str(table), str(key), float(value), path.name)
    return Posterior(values, json.loads(str(tree.attrs[posterior_file.MATERIAL])))


def _check_value(table: str, key: str, value: float, name: str) -> None:
    """Refuse a value that no campaign may have."""
    try:
        if table == "plate":
            Plate(**{"thickness": 1e-3, "resistance": 1e9} | {key: value})
        else:
            Interaction(**{key: value})
    except ValidationError:
        raise ValueError(f"{name}: has {table}.{key} = {value:g}, which is not allowed there") from None
