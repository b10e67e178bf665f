"""Simulation-based calibration of `warpimpact identify`: 300 data sets of known parameters, fitted.

Writes ranks, coverage and recovery as JSON and as a figure to tests/validation/results. It takes some minutes of one
core: python tests/validation/calibrate_fit.py
"""

import json
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from warpimpact.identification.calibration import BINS, Calibration, calibrate
from warpimpact.identification.reading import fit_from

HERE = Path(__file__).parent
DATA_SETS, LIBRARY = 300, 2048
FIT = (HERE / "calibration.toml").read_text(encoding="utf-8")


def told(found: Calibration) -> dict[str, object]:
    return {
        "data_sets": len(found.ranks),
        "library": LIBRARY,
        "effective_sample_size": {"median": float(np.median(found.effective)), "least": float(found.effective.min())},
        "pareto_k_above_0.7": int((found.pareto_k > 0.7).sum()),
        "parameters": {
            name: {
                "p_of_uniform_ranks": round(float(p), 4),
                "coverage_of_90_percent": round(float(covered), 4),
                "recovery": round(float(recovered), 3),
                "counts": np.histogram(column, bins=BINS, range=(0.0, 1.0))[0].tolist(),
            }
            for name, p, covered, recovered, column in zip(
                found.names, found.uniformity, found.coverage, found.recovery, found.ranks.T, strict=True
            )
        },
    }


def drawn(found: Calibration) -> Figure:
    figure = Figure(figsize=(3.4 * len(found.names), 6.4), layout="constrained")
    figure.suptitle(f"Calibration on {len(found.ranks)} data sets of known parameters")
    above, below = figure.subplots(2, len(found.names))
    expected = len(found.ranks) / BINS
    band = 1.96 * np.sqrt(expected * (1.0 - 1.0 / BINS))
    for place, name in enumerate(found.names):
        axes = above[place]
        axes.axhspan(expected - band, expected + band, color="0.85", label="95 % of uniform counts")
        axes.hist(found.ranks[:, place], bins=BINS, range=(0.0, 1.0), color="#0072B2", alpha=0.8)
        axes.set(title=f"{name}\nP(as uneven) = {found.uniformity[place]:.2f}", xlabel="posterior below the true value")
        axes.set_ylabel("data sets" if not place else "")
        axes = below[place]
        axes.scatter(found.truth[:, place], found.mean[:, place], s=6, color="#0072B2", alpha=0.6, lw=0)
        axes.axline((0.0, 0.0), slope=1.0, color="0.6", lw=1.0)
        axes.set(xlabel="true value (normal scale)", ylabel="posterior mean" if not place else "")
        axes.set_title(f"90 % intervals cover {found.coverage[place]:.1%}", fontsize="medium")
    return figure


def main() -> None:
    found = calibrate(fit_from(FIT, "calibration.toml", HERE), data_sets=DATA_SETS, library=LIBRARY)
    results = HERE / "results"
    results.mkdir(exist_ok=True)
    (results / "calibration.json").write_text(json.dumps(told(found), indent=1) + "\n", encoding="utf-8")
    drawn(found).savefig(results / "calibration.png", dpi=120)
    print(json.dumps(told(found), indent=1))


if __name__ == "__main__":
    main()
