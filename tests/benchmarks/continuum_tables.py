"""Tables and the figure of the page on the continuum (docs/continuum.md), from results/continuum_*.csv.

    python tests/benchmarks/continuum_tables.py            # prints the tables, and draws the figure

The tables are made when the pages are built.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from itertools import pairwise
from pathlib import Path

import numpy as np
from continuum_cases import CASES, CORE, MEASURES, PLATES, PUBLISHED, measured, written
from numpy.typing import NDArray
from scipy.stats import spearmanr

from warpimpact.kernels.status import Status

Array = NDArray[np.float64]
Row = tuple[str, ...]
Table = tuple[Row, list[Row]]

RESULTS = Path(__file__).resolve().parent / "results"
FIGURE = RESULTS / "continuum_maps.png"
DRAWN = "slotted"
"""The plate of the figure."""
FEWEST = 3
"""Hits of a class, or of both meshes, for a row."""
FEWEST_RANKED = 6
"""Hits for a rank correlation or a percentile."""
HEAD = tuple(f"{name.replace('_', ' at ')}, {unit}" for name, unit in MEASURES.items())
"""Columns of the measures."""
MESHES = {"draft": "trade", "standard": "standard", "reference": "reference"}
"""Files of the hits by their mesh, from coarse to fine."""
STEEP = 30.0
"""Tilt beyond which a core counts as turned [°]."""
SHOTS = {
    "through a hole": {"experiment": (714.0, 24.3, 83.2), "LS-DYNA": (714.0, 15.0, 61.0)},
    "between holes": {"experiment": (753.0, 16.0, 32.2), "LS-DYNA": (790.0, 16.0, 35.0)},
}
"""The paper's two shots: residual velocity [m/s], spatial tilt at 50 and 130 mm [°]."""
NUMERICS = np.array([5.0, 5.0, 10.0])
"""What the continuum's numerics leave open of each measure, about."""


def rows_of(name: str) -> list[dict[str, str]]:
    return written(RESULTS / f"continuum_{name}.csv")


def both(plate: str, fitted: list[dict[str, str]] | None = None) -> tuple[list[int], Array, Array]:
    """Numbers of the hits that perforate by both models, and their measures by the fast law and by the continuum.

    Args:
        fitted: rows of the fast law, in place of those at the parameters that the plate is given.
    """
    rows = rows_of("trade")
    truth, fast = measured(rows, plate, "continuum"), measured(rows, plate, "fast")
    if fitted is not None:
        fast = {int(row["hit"]): np.array([float(row[name]) for name in MEASURES]) for row in fitted}
    hits = [hit for hit in sorted({*truth} & {*fast}) if not np.isnan(fast[hit]).any()]
    shape = len(hits), len(MEASURES)
    return hits, *(np.array([model[hit] for hit in hits]).reshape(shape) for model in (fast, truth))


def errors() -> Table:
    """Bias, root mean square and rank correlation of the fast law, by plate and measure."""
    rows = []
    for plate in CASES:
        fitted = [row for row in rows_of("fitted") if row["plate"] == plate]
        given = "given" if CASES[plate].velocities else "paper's"
        sets: list[tuple[str, list[dict[str, str]] | None]] = [(given, None)]
        sets += [(fit_words(fitted, part), [row for row in fitted if row["part"] == part]) for part in ("in", "out")]
        for words, chosen in sets:
            hits, fast, truth = both(plate, chosen)
            if len(hits) >= FEWEST:
                rows.append((plate, str(len(hits)), words, *error_cells(fast, truth)))
    return ("plate", "hits", "fast law", *HEAD), rows


def fit_words(fitted: list[dict[str, str]], part: str) -> str:
    """The parameters of a fit, and on which hits they are judged."""
    if not fitted:
        return ""
    row = fitted[0]
    where = "in the fit" if part == "in" else "out of it"
    return f"Y × {row['share']}, η {row['shear_coefficient']}, β {row['degradation']}, {where}"


def error_cells(fast: Array, truth: Array) -> Iterator[str]:
    """Bias, root mean square and rank correlation of each measure."""
    for one, other in zip(fast.T, truth.T, strict=True):
        difference = one - other
        rank = f"{float(spearmanr(one, other).statistic):.2f}" if len(one) >= FEWEST_RANKED else "–"
        yield f"{difference.mean():+.2g}, {np.sqrt((difference**2).mean()):.2g}, {rank}"


def cost() -> Table:
    """Time of a hit by either, and hits of the continuum that failed."""
    rows = []
    for plate, case in CASES.items():
        by_mesh = [
            [row for row in rows_of(name) if row["plate"] == plate and row["model"] == "continuum"]
            for name in ("trade", "standard")
        ]
        if not by_mesh[0]:
            continue
        draft, standard = (float(np.median([float(row["seconds"]) for row in of] or [np.nan])) for of in by_mesh)
        fast = next((float(row["fast_ms"]) for row in rows_of("fitted") if row["plate"] == plate), np.nan)
        failed = sum(Status(int(row["status"])).failed for row in by_mesh[0])
        ratio = "" if np.isnan(fast) else f"{1e3 * draft / fast:,.0f}"
        cells = ("" if np.isnan(value) else f"{value:.3g}" for value in (fast, draft, standard))
        rows.append((plate, case.title, str(len(by_mesh[0])), str(failed), *cells, ratio))
    head = ("plate", "what it is", "hits", "failed", "fast law, ms", "draft, s", "standard, s", "draft over fast law")
    return head, rows


def ranking() -> Table:
    """Which plate ranks first by either model, of those that the paper's core hits."""
    plates = [name for name, case in CASES.items() if case.core is CORE and len(both(name)[0]) >= FEWEST_RANKED]
    numbers: dict[str, Callable[[Array], float]] = {
        "mean residual velocity, m/s": lambda values: -float(values[:, 0].mean()),
        "mean tilt at 130 mm, °": lambda values: float(values[:, 2].mean()),
        f"share of tilts at 130 mm beyond {STEEP:g}°": lambda values: float((values[:, 2] > STEEP).mean()),
    }
    rows = []
    for words, number in numbers.items():
        models = {
            "fast law, paper's": [both(plate)[1] for plate in plates],
            "fast law, fitted": [
                both(plate, [r for r in rows_of("fitted") if r["plate"] == plate])[1] for plate in plates
            ],
            "continuum": [both(plate)[2] for plate in plates],
        }
        truth = [number(values) for values in models["continuum"]]
        for model, samples in models.items():
            values = [number(sample) for sample in samples]
            ordered = sorted(range(len(plates)), key=lambda k, values=values: -values[k])  # type: ignore[misc]
            order = ", ".join(f"{plates[k]} {abs(values[k]):.3g}" for k in ordered)
            rank = "" if model == "continuum" else f"{spearmanr(values, truth).statistic:.2f}"
            rows.append((words, model, order, rank))
    return ("measure", "by", "plates, the best first", "rank correlation with the continuum"), rows


def refinement() -> Table:
    """What the hits of one mesh differ by from those of the next finer one, by plate and of all."""
    rows = []
    for coarse, fine in pairwise(MESHES):
        of, than, every, failures = rows_of(MESHES[coarse]), rows_of(MESHES[fine]), [], np.zeros(2, dtype=int)
        meshes = f"{coarse} less {fine}"
        for plate in CASES:
            difference = differences(of, than, plate)
            failed = np.array([failures_of(mesh, plate, tried(than, plate)) for mesh in (of, than)])
            if len(difference):
                rows.append(
                    (plate, meshes, str(len(difference)), *difference_cells(difference), "{}, {}".format(*failed))
                )
            every.append(difference)
            failures += failed
        difference = np.concatenate(every)
        if len(difference):
            rows.append(
                ("all", meshes, str(len(difference)), *difference_cells(difference), "{}, {}".format(*failures))
            )
    return ("plate", "meshes", "hits", *HEAD, "failed of the same hits"), rows


def differences(of: list[dict[str, str]], than: list[dict[str, str]], plate: str) -> Array:
    """Measures of the hits of a plate by the continuum, less those of the same hits elsewhere, shape [hits, 3]."""
    one, other = measured(of, plate, "continuum"), measured(than, plate, "continuum")
    return np.array([one[hit] - other[hit] for hit in sorted({*one} & {*other})]).reshape(-1, len(MEASURES))


def difference_cells(difference: Array) -> Iterator[str]:
    """Bias, root mean square and 90th percentile of what the measures differ by; no percentile of few hits."""
    for column in difference.T:
        most = f"{np.percentile(np.abs(column), 90):.2g}" if len(difference) >= FEWEST_RANKED else "–"
        yield f"{column.mean():+.2g}, {np.sqrt((column**2).mean()):.2g}, {most}"


def failures_of(rows: list[dict[str, str]], plate: str, hits: set[int]) -> int:
    """How many of these hits of a plate failed by the continuum."""
    chosen = (row for row in rows if row["plate"] == plate and row["model"] == "continuum")
    return sum(Status(int(row["status"])).failed for row in chosen if int(row["hit"]) in hits)


def tried(rows: list[dict[str, str]], plate: str) -> set[int]:
    """Hits of a plate that the continuum computed, whatever became of them."""
    return {int(row["hit"]) for row in rows if row["plate"] == plate and row["model"] == "continuum"}


def friction() -> Table:
    """What a friction of 0.03 does."""
    rows = []
    for plate in CASES:
        difference = differences(rows_of("trade_friction"), rows_of("trade"), plate)
        if len(difference):
            rows.append((plate, str(len(difference)), *difference_cells(difference)))
    return ("plate", "hits", *HEAD), rows


def limits() -> Table:
    """Limit velocities by search beside the published ones: the fastest core that was held and the slowest one that
    passed; and what the energy of that one asks for."""
    rows, shots = [], rows_of("limits")
    for plate, published in PUBLISHED.items():
        cells = []
        for mu in ("0", "0.03"):
            here = [row for row in shots if row["plate"] == plate and row["friction"] == mu]
            passed = [(float(row["velocity"]), float(row["residual"])) for row in here if row["status"] == "0"]
            held = [float(row["velocity"]) for row in here if row["status"] in ("1", "2")]
            if not passed:
                cells.append("")
                continue
            slowest, left = min(passed)
            bracket = f"{max(held):.0f} to {slowest:.0f}" if held else f"below {slowest:.0f}"
            cells.append(f"{bracket}, {np.sqrt(slowest**2 - left**2):.0f}")
        if any(cells):
            words = f"{published.velocity:.0f} ({published.projectile}, {published.material})"
            rows.append((PLATES[plate].title, *cells, words))
    return ("plate", "without friction, m/s", "friction 0.03, m/s", "published, m/s"), rows


def shots() -> Table:
    """The paper's two shots beside the hits of the slotted plate that come nearest."""
    rows, sources = [], {"without friction": rows_of("trade"), "friction 0.03": rows_of("trade_friction")}
    for shot, known in SHOTS.items():
        aim = np.array(known["experiment"])
        for model, values in known.items():
            rows.append((shot, model, "", *(f"{value:.0f}" for value in values)))
        for words, of in sources.items():
            for model in ("continuum", "fast"):
                hits_of_model = measured(of, "slotted", model)
                if not hits_of_model or (model == "fast" and words != "without friction"):
                    continue
                best = min(hits_of_model, key=lambda hit: float((((hits_of_model[hit] - aim) / NUMERICS) ** 2).sum()))
                place = next(row for row in of if row["plate"] == "slotted" and row["hit"] == str(best))
                at = f"({1e3 * float(place['hit_y']):.2f}, {1e3 * float(place['hit_z']):.2f})"
                name = "fast law, paper's" if model == "fast" else f"continuum, {words}, of {len(hits_of_model)} hits"
                rows.append((shot, name, at, *(f"{value:.0f}" for value in hits_of_model[best])))
    return ("shot", "by", "hit, mm", "m/s", "° at 50 mm", "° at 130 mm"), rows


TABLES: dict[str, Callable[[], Table]] = {
    table.__name__: table for table in (errors, cost, ranking, refinement, friction, limits, shots)
}


def draw_maps(plate: str) -> None:
    """The hits of one plate by both models side by side, and their differences."""
    from matplotlib.figure import Figure

    hits, fast, truth = both(plate)
    case = CASES[plate]
    places = case.shots(max(hits) + 1)[np.array(hits)]
    y, z = (1e3 * along for along in (places.hit_y, places.hit_z))
    grid_y, grid_z = np.meshgrid(np.linspace(y.min() - 1, y.max() + 1, 200), np.linspace(z.min() - 1, z.max() + 1, 200))
    edges = case.layers[0].edge_distance(1e-3 * grid_y, 1e-3 * grid_z)
    figure = Figure(figsize=(11.0, 6.4), layout="compressed")
    panels = figure.subplots(2, 3, sharex=True, sharey=True)
    figure.suptitle(f"{case.title}: {len(hits)} hits")
    for row, (words, column) in zip(panels, {"residual velocity, m/s": 0, "tilt at 130 mm, °": 2}.items(), strict=True):
        one, other = fast[:, column], truth[:, column]
        low, high, most = min(*one, *other), max(*one, *other), float(np.abs(one - other).max())
        for axes, title, values, scale in (
            (row[0], "fast law", one, ("viridis", low, high)),
            (row[1], "continuum", other, ("viridis", low, high)),
            (row[2], "difference", one - other, ("RdBu_r", -most, most)),
        ):
            axes.contour(grid_y, grid_z, edges, [0.0], colors="0.5", linewidths=0.8)
            drawn = axes.scatter(y, z, c=values, cmap=scale[0], vmin=scale[1], vmax=scale[2], edgecolors="0.3", s=45)
            axes.set(title=title, aspect="equal", xlabel="y, mm", ylabel="z, mm")
            figure.colorbar(drawn, ax=axes, shrink=0.8, label=words)
    figure.savefig(FIGURE, dpi=90, bbox_inches="tight")


if __name__ == "__main__":
    for name, make in TABLES.items():
        head, rows = make()
        print(f"\n{name}\n\n" + "\n".join(" | ".join(row) for row in [head, *rows]))
    draw_maps(DRAWN)
