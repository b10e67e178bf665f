"""The posterior of the hierarchical fit as a file that ArviZ opens.

python -m tests.validation.limit_posterior FILE.nc
"""

import sys
from pathlib import Path

import numpy as np
import xarray

from warpimpact.statistics.importance import Weights, resampled

from .limit_model import CHOSEN, Fit, Model, fit, names
from .limit_rows import Array, Rows, published

PROPOSED, DRAWS, FREEDOM = 2000, 500, 5.0
_STEP = 0.05


def posterior(
    rows: Rows, found: Fit, *, proposed: int = PROPOSED, draws: int = DRAWS, seed: int = 0
) -> xarray.DataTree:
    """Draws of sizes and coefficients, with the limit velocity of every row as the model predicts it.

    Points come from Student's t at the mode, with the curvature there; weights are Pareto-smoothed. The attributes have
    the effective sample size and Pareto k, which must be below 0.7.
    """
    rng = np.random.default_rng(0)
    model = Model(rows, found.law).weighed(found.values)
    root = np.linalg.cholesky(np.linalg.inv(_curvature(model, found.values)))
    count = len(found.values)
    normal, length = rng.standard_normal((proposed, count)), np.sqrt(rng.chisquare(FREEDOM, proposed) / FREEDOM)
    off = normal / length[:, None]
    points = found.values + off @ root.T
    density = -0.5 * (FREEDOM + count) * np.log1p((off**2).sum(axis=1) / FREEDOM)
    weights = Weights.of(np.array([model.log_posterior(point) for point in points]) - density)
    chosen = points[resampled(weights.values, draws, rng)]
    predicted = np.stack([_replicated(model, point, rng) for point in chosen])
    columns = {f"sd of {name}": np.exp(chosen[:, k]) for k, name in enumerate(names(found.law))}
    columns |= {name: chosen[:, len(names(found.law)) + k] for k, name in enumerate(found.law.free)}
    groups = {
        "posterior": xarray.Dataset({name: (("chain", "draw"), one[None]) for name, one in columns.items()}),
        "posterior_predictive": xarray.Dataset({"limit_velocity": (("chain", "draw", "row"), predicted[None])}),
        "observed_data": xarray.Dataset({"limit_velocity": ("row", rows.velocity)}),
    }
    told = {"effective_sample_size": weights.effective(), "pareto_k": weights.pareto_k, "law": found.law.name}
    return xarray.DataTree.from_dict({name: data.assign_attrs(told) for name, data in groups.items()})


def _curvature(model: Model, at: Array) -> Array:
    """Second derivatives of the negative logarithm of the posterior, by central differences; made positive."""
    count = len(at)
    steps = _STEP * np.eye(count)
    found = np.empty((count, count))
    for i in range(count):
        for j in range(i + 1):
            corners = [(1, 1), (1, -1), (-1, 1), (-1, -1)]
            values = [a * b * model.log_posterior(at + a * steps[i] + b * steps[j]) for a, b in corners]
            found[i, j] = found[j, i] = -sum(values) / (4.0 * _STEP**2)
    sizes, vectors = np.linalg.eigh(found)
    return np.asarray((vectors * np.maximum(sizes, 0.5)) @ vectors.T)


def _replicated(model: Model, values: Array, rng: np.random.Generator) -> Array:
    """Limit velocities that new tests of the same plates would give [m/s], shape [rows]."""
    signal, noise = model.signal(values), model.noise(values)
    gain = np.linalg.solve(signal + np.diag(noise / model.weights), signal).T
    residual = model.residual(values)
    deviation = np.sqrt(np.maximum(np.diag(signal - gain @ signal), 0.0) + noise)
    drawn = gain @ residual + deviation * rng.standard_normal(len(noise))
    return np.asarray(model.rows.velocity * np.exp(0.5 * (drawn - residual)))


def main() -> None:
    rows = published()
    tree = posterior(rows, fit(rows, CHOSEN))
    told = tree["posterior"].attrs
    print(f"effective sample size {told['effective_sample_size']:.0f}, Pareto k {told['pareto_k']:.2f}")
    tree.to_netcdf(Path(sys.argv[1]))


if __name__ == "__main__":
    main()
