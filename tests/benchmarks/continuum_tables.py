"""Tables and the figure of the page on the continuum (docs/continuum.md), from results/continuum_*.csv.

    python tests/benchmarks/continuum_tables.py            # prints the tables, and draws the figure

The tables are made when the pages are built.
"""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import numpy as np
import pandas as pd
from continuum_cases import CASES, FRESH, MEASURES, PLATES, PUBLISHED, measured, written

from warpimpact.catalogue.catalogue import flow_entries
from warpimpact.kernels.status import Status

Row = tuple[str, ...]
Table = tuple[Row, list[Row]]

RESULTS = Path(__file__).resolve().parent / "results"
FIGURE = RESULTS / "continuum_maps.png"
WHOLE = 0.999
"""Share of its mass that a whole core has at least."""
DRAWN = "slotted"
"""The plate of the figure."""
FEWEST = 3
"""Hits of a class, or of both meshes, for a row."""
BREAKING_COUNTS = (5, 12)
"""Hits given at plates with whole bullets whose cores break, as far as the table shows them."""
FRESH_COUNTS = (0, 12)
"""Hits given at fresh plates, as far as the table shows them."""
FEWEST_RANKED = 6
"""Hits for a rank correlation or a percentile."""
HEAD = tuple(f"{name.replace('_', ' at ')}{' mm' * ('_' in name)}, {unit}" for name, unit in MEASURES.items())
"""Columns of the measures."""
MESHES = {"draft": "trade", "standard": "standard", "reference": "reference"}
"""Files of the hits by their mesh, from coarse to fine."""
SHOTS = {
    "through a hole": {"experiment": (714.0, 24.3, 83.2), "LS-DYNA": (714.0, 15.0, 61.0)},
    "between holes": {"experiment": (753.0, 16.0, 32.2), "LS-DYNA": (790.0, 16.0, 35.0)},
}
"""The paper's two shots: residual velocity [m/s], spatial tilt at 50 and 130 mm [°]."""
NUMERICS = [5.0, 5.0, 10.0]
"""What the continuum's numerics leave open of each measure, about."""


def rows_of(name: str, **columns: str) -> pd.DataFrame:
    """The rows of a file that have these values."""
    rows = written(RESULTS / f"continuum_{name}.csv")
    return (
        rows[np.logical_and.reduce([rows[column] == value for column, value in columns.items()])] if columns else rows
    )


def both(plate: str, fitted: pd.DataFrame | None = None) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Measures by the fast law and by the continuum of the hits that perforate by both, by their numbers.

    Args:
        fitted: rows of the fast law, in place of those at the parameters that the plate is given.
    """
    rows = rows_of("trade")
    fast = measured(rows, plate, "fast") if fitted is None else fitted.set_index("hit")[list(MEASURES)]
    return fast.dropna().align(measured(rows, plate, "continuum"), join="inner", axis=0)


def errors() -> Table:
    """Bias, root mean square and rank correlation of the fast law, by plate and measure."""
    rows = []
    for plate, case in CASES.items():
        parts = dict(iter(rows_of("fitted", plate=plate).groupby("part")))
        sets = {"given" if case.velocities else "paper's": None}
        sets |= {fit_words(fitted.iloc[0], part): fitted for part, fitted in parts.items()}
        for words, chosen in sets.items():
            fast, truth = both(plate, chosen)
            if len(fast) >= FEWEST:
                ranks = fast.corrwith(truth, method="spearman").map("{:.2f}".format)
                ranked = ranks.tolist() if len(fast) >= FEWEST_RANKED else ["–"] * len(MEASURES)
                rows.append((plate, str(len(fast)), words, *cells(fast - truth, ranked)))
    return ("plate", "hits", "fast law", *HEAD), rows


def coverage() -> Table:
    """How often the 95 % intervals of answers from n hits hold, in the mean over all plates, and their width over that
    by these hits alone; last, over fresh plates. No plate has a share in the table by which it is judged."""
    rows = pd.read_csv(RESULTS / "coverage.csv")
    every, fresh = coverage_cells(rows), coverage_cells(rows[rows["plate"].isin(FRESH)])
    return side_by_side(every, fresh[[*FRESH_COUNTS]].add_prefix("fresh, "))


def whole_coverage() -> Table:
    """The same of whole bullets, and of those whose cores break."""
    rigid, breaking = (coverage_cells(pd.read_csv(RESULTS / f"{of}_coverage.csv")) for of in ("whole", "breaking"))
    return side_by_side(rigid, breaking[[*BREAKING_COUNTS]].add_prefix("breaking, "))


def coverage_cells(rows: pd.DataFrame) -> pd.DataFrame:
    """Words by measure and hits: how often intervals hold, and their width over that by the hits alone."""
    narrower = rows["width"] / rows["alone"].where(rows["alone"] > 0.0)
    grouped = rows.assign(narrower=narrower).groupby(["measure", "elements"], sort=False)
    words = grouped[["holds", "narrower"]].mean().apply(coverage_words, axis=1)
    return words.unstack("elements").fillna("–")


def coverage_words(cell: pd.Series) -> str:
    """A cell in words; without hits there is no width to compare with."""
    return f"{cell['holds']:.0%}" + ("" if np.isnan(cell["narrower"]) else f", {cell['narrower']:.2g}")


def side_by_side(first: pd.DataFrame, *others: pd.DataFrame) -> Table:
    """Tables of the same measures as one."""
    whole = pd.concat([first, *others], axis=1).fillna("–")
    heads = [f"{column} hits" if isinstance(column, int) else str(column) for column in whole.columns]
    return ("measure", *heads), [(str(name), *row) for name, row in zip(whole.index, whole.to_numpy(), strict=True)]


def comparisons() -> Table:
    """Differences of two answers of n hits each: how many are significant, and how many of these have the sign that 200
    hits by elements of each plate say."""
    rows = pd.read_csv(RESULTS / "comparisons.csv")
    by = rows.set_index(["measure", "elements"])
    counts, names = sorted(rows["elements"].unique()), list(dict.fromkeys(rows["measure"]))

    def cell(name: str, count: int) -> str:
        some = by.loc[(name, count)]
        if not some["significant"] > 0:
            return "none"
        return f"{some['significant'] / some['differences']:.0%}, {some['right_sign']:.1%}"

    return ("measure", *(f"{n} hits" for n in counts)), [(name, *(cell(name, n) for n in counts)) for name in names]


def bullet() -> Table:
    """Hits of whole bullets less those of an independent program: bias, root mean square and largest difference."""
    rows, cells_of = pd.read_csv(RESULTS / "whole_bullet.csv"), []
    for name, unit in MEASURES.items():
        off = rows[name] - rows[f"{name}_theirs"]
        words = (f"{off.mean():+.1f}", f"{np.sqrt(np.mean(off**2)):.1f}", f"{off.abs().max():.0f}")
        cells_of.append((f"{name.replace('_', ' at ')}{' mm' * ('_' in name)}, {unit}", *words))
    for words, column in {"rigid": "seconds", "breaking": "seconds_breaking"}.items():
        ratios = rows[column] / rows["seconds_bare"]
        ends = (f"{ratios.min():.1f}", f"{ratios.median():.1f}", f"{ratios.max():.1f}")
        cells_of.append((f"{words} core, time over that of the bare one: least, median, most", *ends))
    return ("at 12 hits", "bias", "rms", "largest"), cells_of


def deformation() -> Table:
    """Hits of cores that deform: residual velocity, tilts at 50 and at 130 mm."""
    rows = pd.read_csv(RESULTS / "deformable_core.csv").query("fidelity == 'draft'")
    rows["core"] = np.where(rows["whole"], "bullet, ", "") + rows["core"]
    theirs = rows.dropna(subset="velocity_theirs").assign(core="elastic, theirs")
    for name in MEASURES:
        theirs[name] = theirs[f"{name}_theirs"]
    rows = in_words(pd.concat([rows, theirs]))
    cores = ("rigid", "stiff", "elastic", "elastic, theirs", "yielding", "breaking")
    cores += tuple(f"bullet, {of}" for of in ("rigid", "yielding", "breaking"))
    table = rows.pivot(index="hit", columns="core", values="text").loc[rows["hit"].unique(), [*cores]].fillna("")
    return ("hit, mm", *cores), list(table.itertuples(name=None))


def in_words(rows: pd.DataFrame) -> pd.DataFrame:
    """Rows with the place of the hit and how it ended in words, columns hit and text."""
    texts = [f"{row.velocity:.0f} {row.tilt_50:.0f}/{row.tilt_130:.0f}" for row in rows.itertuples()]
    texts = np.where(rows["status"].fillna(0) == 0, texts, "failed") + np.where(rows["broken"] == 1.0, ", broken", "")
    return rows.assign(text=texts, hit=[f"{row.hit_y:g}, {row.hit_z:g}" for row in rows.itertuples()])


def choices() -> Table:
    """Breaking cores in bullets of other lead, walls and friction: residual velocity, tilts at 50 and 130 mm."""
    rows = in_words(pd.read_csv(RESULTS / "bullet_choices.csv"))
    hits, names = rows["hit"].unique(), rows["choice"].unique()
    table = rows.pivot(index="choice", columns="hit", values="text").loc[names, hits]
    return ("bullet", *(f"at {hit} mm" for hit in hits)), list(table.itertuples(name=None))


def solids() -> Table:
    """Residual velocity behind solid plates, of bare and of whole bullets."""
    rows = pd.read_csv(RESULTS / "bullet_solid.csv")
    rows["text"] = np.where(rows["status"] == 0, rows["velocity"].map("{:.0f}".format), "stopped")
    rows["text"] = np.where(rows["status"] > 1, "failed", rows["text"]) + np.where(
        rows["broken"] == 1.0, ", broken", ""
    )
    plates, bodies = rows["plate"].unique(), rows["body"].unique()
    table = rows.pivot(index="plate", columns="body", values="text").loc[plates, bodies]
    impact = rows.groupby("plate")["impact"].first()
    return ("plate", "at", *bodies), [(name, f"{impact[name]:.0f} m/s", *row) for name, *row in table.itertuples()]


def breaking() -> Table:
    """Hits over the paper's cell by place: how many cores stay whole, lose their tip, break; how they leave."""
    table, rows = pd.read_csv(RESULTS / "breaking_core.csv"), []
    for (is_whole, place), hits in table.groupby(["whole", "place"]):
        sound, broken = hits[hits["status"] == 0], hits["broken"] == 1.0
        kept = (hits["fragment_mass"] >= WHOLE * hits["fragment_mass"].max()) & ~broken
        counts = (len(hits), kept.sum(), len(sound) - kept.sum() - broken.sum(), broken.sum(), len(hits) - len(sound))
        body = "bullet" if is_whole else "bare core"
        means = (f"{sound[name].mean():.0f}" for name in ("velocity", "tilt_50", "tilt_130"))
        rows.append((f"{body}, {place}", *map(str, counts), *means))
    head = ("hits", "whole", "tip lost", "broken", "failed", "m/s", "° at 50 mm", "° at 130 mm")
    return ("where", *head), rows


def fit_words(row: pd.Series, part: str) -> str:
    """The parameters of a fit, and on which hits they are judged."""
    where = "in the fit" if part == "in" else "out of it"
    return f"Y × {row['share']:.2g}, η {row['shear_coefficient']}, β {row['degradation']}, {where}"


def cells(difference: pd.DataFrame, last: list[str] | None = None) -> list[str]:
    """Bias and root mean square of what the measures differ by, and another figure: else the 90th percentile, which
    few hits do not have."""
    if last is None:
        enough = len(difference) >= FEWEST_RANKED
        last = [f"{most:.2g}" if enough else "–" for most in difference.abs().quantile(0.9)]
    bias, size = difference.mean(), np.sqrt((difference**2).mean())
    return [f"{b:+.2g}, {s:.2g}, {other}" for b, s, other in zip(bias, size, last, strict=True)]


def cost() -> Table:
    """Time of a hit by either, and hits of the continuum that failed."""
    rows = []
    for plate, case in CASES.items():
        draft, standard = (rows_of(name, plate=plate, model="continuum") for name in ("trade", "standard"))
        if len(draft):
            times = rows_of("fitted", plate=plate)["fast_ms"].iloc[:1].mean(), draft["seconds"].median()
            ratio = "" if np.isnan(times[0]) else f"{1e3 * times[1] / times[0]:,.0f}"
            shown = ("" if np.isnan(value) else f"{value:.3g}" for value in (*times, standard["seconds"].median()))
            rows.append((plate, case.title, str(len(draft)), str(failures(draft["status"])), *shown, ratio))
    head = ("plate", "what it is", "hits", "failed", "fast law, ms", "draft, s", "standard, s", "draft over fast law")
    return head, rows


def failures(status: pd.Series) -> int:
    return sum(Status(code).failed for code in status)


def refinement() -> Table:
    """What the hits of one mesh differ by from those of the next finer one, by plate and of all."""
    rows = []
    for coarse, fine in pairwise(MESHES):
        of, than = (rows_of(MESHES[mesh], model="continuum") for mesh in (coarse, fine))
        parts = {plate: differences(of, than, plate) for plate in CASES}
        parts["all"] = pd.concat(parts.values())
        same = pd.merge(of, than, on=["plate", "hit"])
        for plate, difference in parts.items():
            if len(difference):
                hits = same[same["plate"].isin(CASES if plate == "all" else [plate])]
                failed = f"{failures(hits['status_x'])}, {failures(hits['status_y'])}"
                rows.append((plate, f"{coarse} less {fine}", str(len(difference)), *cells(difference), failed))
    return ("plate", "meshes", "hits", *HEAD, "failed of the same hits"), rows


def differences(of: pd.DataFrame, than: pd.DataFrame, plate: str) -> pd.DataFrame:
    """Measures of the hits of a plate by the continuum, less those of the same hits elsewhere."""
    one, other = measured(of, plate, "continuum").align(measured(than, plate, "continuum"), join="inner", axis=0)
    return one - other


def friction() -> Table:
    """What a friction of 0.03 does."""
    every = {plate: differences(rows_of("trade_friction"), rows_of("trade"), plate) for plate in CASES}
    rows = [(plate, str(len(one)), *cells(one)) for plate, one in every.items() if len(one)]
    return ("plate", "hits", *HEAD), rows


def limits() -> Table:
    """Limit velocities by search beside the published ones: the fastest core that was held and the slowest one that
    passed; and what the energy of that one asks for."""
    rows = []
    for plate, published in PUBLISHED.items():
        shown = []
        for mu in ("0", "0.03"):
            here = rows_of("limits", plate=plate, friction=mu)
            passed = here[here["status"] == Status.PERFORATED].sort_values("velocity")
            held = here["velocity"][here["status"].isin([Status.ARRESTED, Status.RICOCHETED])].max()
            if not len(passed):
                shown.append("")
                continue
            slowest, left = passed[["velocity", "residual"]].iloc[0]
            bracket = f"below {slowest:.0f}" if np.isnan(held) else f"{held:.0f} to {slowest:.0f}"
            shown.append(f"{bracket}, {np.sqrt(slowest**2 - left**2):.0f}")
        if any(shown):
            words = f"{published.velocity:.0f} ({published.projectile}, {published.material})"
            rows.append((PLATES[plate].title, *shown, words))
    return ("plate", "without friction, m/s", "friction 0.03, m/s", "published, m/s"), rows


def strength() -> Table:
    """Factors on the strength of materials, the published plates that they meet, and the factor that each asks for."""
    rows = []
    for name, entry in flow_entries().items():
        if entry.strength_error is not None:
            plates = (
                f"{plate} ({words.partition(';')[0].rpartition(' ')[2]})" for plate, words in entry.limits.items()
            )
            whole = "" if entry.whole_factor is None else f"{entry.whole_factor:.2f} ± {entry.whole_error or 0.0:.0%}"
            factor = f"{entry.strength_factor:.2f} ± {entry.strength_error:.0%}"
            rows.append((name, factor, whole, "; ".join(plates)))
    return ("material", "rigid core ×", "whole bullet ×", "published limits, and the factor of a rigid core"), rows


def shots() -> Table:
    """The paper's two shots beside the hits of the slotted plate that come nearest."""
    sources = {
        ("trade", "continuum"): "continuum, without friction",
        ("trade", "fast"): "fast law, paper's",
        ("trade_friction", "continuum"): "continuum, friction 0.03",
    }
    rows = []
    for shot, known in SHOTS.items():
        for model, values in known.items():
            rows.append((shot, model, "", *(f"{value:.0f}" for value in values)))
        for (file, model), words in sources.items():
            hits = measured(rows_of(file), DRAWN, model)
            best = (((hits - known["experiment"]) / NUMERICS) ** 2).sum(axis=1).idxmin()
            place = rows_of(file, plate=DRAWN).set_index("hit").loc[[best]].iloc[0]
            at = f"({1e3 * place['hit_y']:.2f}, {1e3 * place['hit_z']:.2f})"
            name = words if model == "fast" else f"{words}, of {len(hits)} hits"
            rows.append((shot, name, at, *hits.loc[best].map("{:.0f}".format)))
    return ("shot", "by", "hit, mm", "m/s", "° at 50 mm", "° at 130 mm"), rows


TABLES: dict[str, Callable[[], Table]] = {
    table.__name__: table
    for table in (
        bullet,
        comparisons,
        coverage,
        choices,
        solids,
        deformation,
        breaking,
        whole_coverage,
        errors,
        cost,
        refinement,
        friction,
        limits,
        shots,
        strength,
    )
}


def draw_maps(plate: str) -> None:
    """The hits of one plate by both models side by side, and their differences."""
    from matplotlib.figure import Figure

    (fast, truth), case = both(plate), CASES[plate]
    places = case.shots(fast.index.max() + 1)[fast.index.to_numpy()]
    y, z = (1e3 * along for along in (places.hit_y, places.hit_z))
    grid_y, grid_z = np.meshgrid(np.linspace(y.min() - 1, y.max() + 1, 200), np.linspace(z.min() - 1, z.max() + 1, 200))
    edges = case.layers[0].edge_distance(1e-3 * grid_y, 1e-3 * grid_z)
    figure = Figure(figsize=(11.0, 6.4), layout="compressed")
    panels = figure.subplots(2, 3, sharex=True, sharey=True)
    figure.suptitle(f"{case.title}: {len(fast)} hits")
    columns = {"residual velocity, m/s": "velocity", "tilt at 130 mm, °": "tilt_130"}
    for row, (words, column) in zip(panels, columns.items(), strict=True):
        one, other = fast[column], truth[column]
        low, high, most = min(*one, *other), max(*one, *other), (one - other).abs().max()
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
