"""Draws of the bending stress: that of the fast law, times what elements say of it."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import xarray

from warpimpact.measures import draws as of_draws
from warpimpact.measures.hits import hit_numbers, passed
from warpimpact.records import variables as v
from warpimpact.scene.model import Array

FEWEST = 3
"""Fewest hits by elements that say how the stress scatters."""


@dataclass(frozen=True)
class StressRatio:
    """Bending stress by elements over that of the fast law, whose logarithm is normal over the hits.

    Attributes:
        means: of the logarithm in each draw, shape [COUNT]; by Student's distribution, as so few hits know them.
        scatter: standard deviation over the hits.
    """

    means: Array
    scatter: float

    @classmethod
    def of(cls, law: xarray.Dataset, elements: xarray.Dataset) -> StressRatio | None:
        """From the hits that both have, and that are bent by both; None with too few of them."""
        if v.BENDING_STRESS not in law or v.BENDING_STRESS not in elements:
            return None
        own = law.isel(hit=np.searchsorted(hit_numbers(law), hit_numbers(elements)))
        both = np.stack([of[v.BENDING_STRESS].values.astype(float) for of in (elements, own)])
        sound = passed(elements) & passed(own) & (both > 0.0).all(axis=0)
        if (count := int(sound.sum())) < FEWEST:
            return None
        logarithms = np.log(both[0, sound] / both[1, sound])
        scatter = float(logarithms.std(ddof=1))
        normal = np.random.default_rng([of_draws.SEED, 1]).standard_t(count - 1, of_draws.COUNT)
        return cls(float(logarithms.mean()) + scatter / count**0.5 * normal, scatter)

    def drawn(self, draws: xarray.Dataset, law: xarray.Dataset) -> xarray.Dataset:
        """Draws with the bending stress, and whether the core breaks.

        Args:
            law: the hits of the draws by the fast law.
        """
        normal = np.random.default_rng([of_draws.SEED, 2]).standard_normal((of_draws.COUNT, law.sizes[v.HIT]))
        factors = np.exp(self.means[:, None] + self.scatter * normal)
        return draws.assign(self._columns(law, factors, (v.DRAW, v.DRAWN_HIT)))

    def mean(self, law: xarray.Dataset) -> xarray.Dataset:
        """A map by the fast law with the mean stress of all draws."""
        factors = np.full(law.sizes[v.HIT], np.exp(self.means + 0.5 * self.scatter**2).mean())
        return law.assign(self._columns(law, factors, v.HITS))

    @staticmethod
    def _columns(law: xarray.Dataset, factors: Array, dims: tuple[str, ...]) -> dict[str, xarray.Variable]:
        stress = (law[v.BENDING_STRESS].values * factors).astype(np.float32)
        columns = {str(v.BENDING_STRESS): xarray.Variable(dims, stress, law[v.BENDING_STRESS].attrs)}
        if v.BROKEN in law:
            is_known, breaks = np.isfinite(stress), stress > law[v.STRENGTH].values
            broken = np.where(is_known, breaks, np.nan).astype(law[v.BROKEN].dtype)
            columns[str(v.BROKEN)] = xarray.Variable(dims, broken, law[v.BROKEN].attrs)
        return columns
