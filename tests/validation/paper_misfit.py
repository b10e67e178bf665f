"""How close can the model come to the paper's two measured shots, hit points free? LS-DYNA has a misfit of 51.

The misfit is the sum of squares over 8 m/s, 3° at 50 mm and 5° at 130 mm. From the best sets of a posterior a random
search goes on in shrinking steps, with more hits per set. A small misfit with free hit points is weak evidence: the
posterior says what the shots determine. It takes a minute of one core:
python tests/validation/paper_misfit.py paper_fit.nc
"""

import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.special import ndtri

from warpimpact.identification.fit import Fit
from warpimpact.identification.fit_file import fit_from
from warpimpact.identification.scoring import evaluate
from warpimpact.results import posterior_file
from warpimpact.results.files import read_tree
from warpimpact.scene.distributions import EDGE
from warpimpact.solver.worker import Worker

ROUNDS, SETS, HITS, KEPT = 10, 24, 2048, 6


def refined(fit: Fit, points: np.ndarray, misfit: np.ndarray, seed: int = 0) -> None:
    """Print the best set that a search from the best of some sets finds.

    Args:
        points: standard normal numbers, shape [sets, parameters].
        misfit: of each set.
    """
    rng = np.random.default_rng(seed)
    finer = replace(fit, sampling=fit.sampling.model_copy(update={"hits": HITS}))
    chosen = np.argsort(misfit)[:KEPT]
    best = points[chosen]
    scores = evaluate(finer, best, Worker(), seed=0)
    values = np.sum([one.misfit for one in scores], axis=0)
    for place in range(ROUNDS):
        step = 0.5 * 0.75**place
        new = best[rng.integers(len(best), size=SETS)] + step * rng.standard_normal((SETS, best.shape[1]))
        found = np.sum([one.misfit for one in evaluate(finer, new, Worker(), seed=0)], axis=0)
        every, all_values = np.concatenate([best, new]), np.concatenate([values, found])
        chosen = np.argsort(all_values)[:KEPT]
        best, values = every[chosen], all_values[chosen]
        print(f"round {place + 1}: {values.round(2)}", flush=True)
    for level in (0, 2, 6):
        settings = replace(finer, numerics=fit.numerics.model_copy(update={"level": level}))
        scores = evaluate(settings, best[:1], Worker(), seed=0)
        print(f"level {level}: misfit {sum(float(one.misfit[0]) for one in scores):.2f}")
        for shot, one in zip(fit.shots, scores, strict=True):
            told = [f"{o.label} {o.shown(x):.1f}" for o, x in zip(shot.observations, one.best[0], strict=True)]
            print(f"  {shot.name}: {float(one.misfit[0]):.2f} at {1e3 * one.best_hit[0]} mm: {', '.join(told)}")
    print([f"{one.name} {one.at(best[:1, i])[0]:.4g} {one.unit}" for i, one in enumerate(fit.parameters)])


def main() -> None:
    tree = read_tree(Path(sys.argv[1]))
    fit = fit_from(str(tree.attrs[posterior_file.FIT_TEXT]), sys.argv[1], Path("campaigns"))
    sets = tree["sets"].to_dataset()
    shares, grid = [], np.linspace(EDGE, 1.0 - EDGE, 10_001)
    for one in fit.parameters:
        values = sets[one.name].values
        shares.append(np.interp(np.radians(values) if one.unit == "rad" else values, one.prior.quantile(grid), grid))
    points = ndtri(np.clip(np.stack(shares, axis=-1), 1e-9, 1.0 - 1e-9))
    refined(fit, points, sets["misfit"].values.sum(axis=1))


if __name__ == "__main__":
    main()
