"""The posterior of the hierarchical fit as a file that ArviZ opens.

python -m tests.validation.limit_posterior FILE.nc
"""

import sys
from pathlib import Path

import emcee
import numpy as np
import xarray

from .limit_model import CHOSEN, Fit, Model, fit, names
from .limit_rows import Array, Rows, published

ENSEMBLES, WALKERS, STEPS, BURNT, DRAWS = 2, 48, 700, 200, 250
"""Ensembles that know nothing of each other; their walkers and steps; steps that are left out; draws that are kept of
each ensemble."""
_STEP = 0.05


def posterior(
    rows: Rows, found: Fit, *, walkers: int = WALKERS, steps: int = STEPS, burnt: int = BURNT, draws: int = DRAWS
) -> xarray.DataTree:
    """Draws of sizes and coefficients, with the limit velocity of every row as the model predicts it.

    Walkers of emcee start about the mode, by the curvature there. A chain is an ensemble. The attributes have the
    effective sample size, by emcee's autocorrelation time, and R-hat of the ensembles: of the worst size or
    coefficient.
    """
    rng = np.random.default_rng(0)
    model = Model(rows, found.law).weighed(found.values)
    root = np.linalg.cholesky(np.linalg.inv(_curvature(model, found.values)))
    starts = found.values + 0.5 * rng.standard_normal((ENSEMBLES, walkers, len(found.values))) @ root.T
    walks = np.stack([_walked(model, steps, seed, start) for seed, start in enumerate(starts)])[:, burnt:]
    times = np.array([emcee.autocorr.integrated_time(walk, quiet=True, tol=0) for walk in walks])
    chains = walks.reshape(ENSEMBLES, -1, len(found.values))
    told = {
        "effective_sample_size": float((chains.shape[1] / times).sum(axis=0).min()),
        "r_hat": float(_r_hat(chains).max()),
        "law": found.law.name,
    }
    chosen = chains[:, np.linspace(0, chains.shape[1], draws, endpoint=False).astype(int)]
    predicted = np.stack([[_replicated(model, point, rng) for point in chain] for chain in chosen])
    columns = {f"sd of {name}": np.exp(chosen[..., k]) for k, name in enumerate(names(found.law))}
    columns |= {name: chosen[..., len(names(found.law)) + k] for k, name in enumerate(found.law.free)}
    groups = {
        "posterior": xarray.Dataset({name: (("chain", "draw"), one) for name, one in columns.items()}),
        "posterior_predictive": xarray.Dataset({"limit_velocity": (("chain", "draw", "row"), predicted)}),
        "observed_data": xarray.Dataset({"limit_velocity": ("row", rows.velocity)}),
    }
    return xarray.DataTree.from_dict({name: data.assign_attrs(told) for name, data in groups.items()})


def _walked(model: Model, steps: int, seed: int, start: Array) -> Array:
    """Places of the walkers after each step, shape [steps, walkers, values]."""
    sampler = emcee.EnsembleSampler(*start.shape, model.log_posterior)
    sampler.random_state = np.random.RandomState(seed).get_state()
    sampler.run_mcmc(start, steps)
    return np.asarray(sampler.get_chain())


def _r_hat(chains: Array) -> Array:
    """Gelman and Rubin's R-hat of every value, for chains of shape [chains, draws, values]."""
    within, count = chains.var(axis=1, ddof=1).mean(axis=0), chains.shape[1]
    return np.asarray(np.sqrt((count - 1) / count + chains.mean(axis=1).var(axis=0, ddof=1) / within))


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
    print(f"effective sample size {told['effective_sample_size']:.0f}, R-hat {told['r_hat']:.3f}")
    tree.to_netcdf(Path(sys.argv[1]))


if __name__ == "__main__":
    main()
