"""The table and the figure of the benchmark page (docs/benchmarks.md), from results/*.json.

    make benchmark                                  # measures everything: some 13 minutes on two quiet cores
    python tests/benchmarks/page.py                 # draws the figure from the results that are there

The table is made from the results when the pages are built. A result that is missing leaves its rows out.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from statistics import median
from typing import Any, NamedTuple

HERE = Path(__file__).resolve().parent
RESULTS = HERE / "results"
RUNS: Mapping[str, Sequence[str]] = {
    "peers": ("peers.py",),
    "throughput": ("throughput.py",),
    "roads": ("roads.py",),
    "drawn": ("roads.py", "--seed", "1", "--scenes", "4", "--hits", "64"),
    "overheads": ("overheads.py",),
    "continuum_speed": ("continuum_speed.py",),
    "design_page": ("design_page.py",),
}
"""The benchmarks behind the page, by the name of their result."""
KNOWN = {**RUNS, "gpu": ("gpu.py",)}
"""The same and those that a machine measures only where it can."""
FIDELITIES = ("draft", "standard", "reference")
COLOURS = {"warpimpact": "#0072B2", "Numba": "#D55E00"}


class Row(NamedTuple):
    """One figure: of what, on which scene, how much, beside what, from which sample."""

    what: str
    scene: str
    figure: str
    reference: str
    sample: str


def results(folder: Path = RESULTS) -> dict[str, Any]:
    """The results that are there, by name."""
    return {
        name: json.loads(path.read_text(encoding="utf-8"))
        for name in KNOWN
        if (path := folder / f"{name}.json").exists()
    }


def rows(found: Mapping[str, Any]) -> Iterator[Row]:
    """Every row of the table."""
    parts = (_throughput, _peers, _roads, _drawn, _overheads, _continuum_speed, _design_page)
    for part in (*parts, _gpu):
        if (name := part.__name__.removeprefix("_")) in found:
            yield from part(found[name])


def machines(found: Mapping[str, Any]) -> Iterator[str]:
    """Where and when each result was measured, a sentence each."""
    for name, values in found.items():
        told = values.get("machine", {})
        if isinstance(told, dict):
            where = f"{told['processor']}, {told['cores']} cores, Python {told['python']}"
            yield f"`{KNOWN[name][0]}`: {where}, {told['date']}."


def _throughput(values: Mapping[str, Any]) -> Iterator[Row]:
    sample = f"median of {values['rounds']} rounds, {values['hits']} Sobol hits"
    for scene, fidelities in values["scenes"].items():
        for name, rate in fidelities.items():
            yield Row(
                f"{name}, hits per second",
                scene,
                f"{_rounded(rate['one_core'])} on one core, {_rounded(rate['all_cores'])} on all",
                "processor time of one core; wall time on all",
                sample,
            )


def _peers(values: Mapping[str, Any]) -> Iterator[Row]:
    sample = f"errors: 90th percentile of {values['hits']} Sobol hits; costs: median round"
    for scene, bout in values.get("scenes", {}).items():
        for one in bout["ratios"]:
            outside = "" if one["enclosed"] else ", its nearest setting"
            yield Row(
                f"{one['warpimpact']}, times as fast as Numba",
                scene,
                f"{one['ratio']:.1f}",
                f"Numba peer at {one['residual_velocity_error']:.2f} m/s and {one['tilt_error']:.2f}° "
                f"({one['accuracy']}{outside})",
                sample,
            )
        velocity, tilt = bout["converged_answer_uncertain_by"]
        for one in bout["contenders"]:
            if one["program"] == "NumPy" or any(name in one["setting"] for name in FIDELITIES):
                other = " of this law, not of the literal one" if one["program"] == "NumPy" else ""
                yield Row(
                    f"{one['program']}, {one['setting']}",
                    scene,
                    f"{one['residual_velocity_error']:.2f} m/s, {one['tilt_error']:.2f}°, "
                    f"{one['microseconds_per_hit']:.3g} µs per hit",
                    f"converged answer{other}, uncertain by {velocity:.2g} m/s and {tilt:.2g}°; one core",
                    sample,
                )
        yield Row(
            "standard, times the arithmetic floor",
            scene,
            f"{bout['floor']['above_floor']:.1f}",
            "measured peak of one core",
            "operations counted over 8 hits",
        )


def _roads(values: Mapping[str, Any]) -> Iterator[Row]:
    for name, one in values["roads"].items():
        yield Row(
            "standard, times the cost of the slotted plate",
            name,
            f"{one['ratio']:.1f}; level {one['level']}, {one['microseconds_per_hit']:.3g} µs per hit, "
            f"{one['above_floor']:.0f} times the floor, pilot {one['pilot_share']:.0%}"
            + ("" if one["kept"] else "; promise not kept"),
            f"processor time of a run of {values['run']} hits with its pilot",
            f"least of {values['rounds']} rounds, {values['hits']} hits",
        )


def _drawn(values: Mapping[str, Any]) -> Iterator[Row]:
    kinds = {"plate": "single plates", "layers": "targets of layers"}
    for kind, scene in kinds.items():
        some = [one for name, one in values["roads"].items() if name.startswith(kind)]
        costs, shares = (sorted(one[name] for one in some) for name in ("ratio", "pilot_share"))
        yield Row(
            "standard, times the cost of the slotted plate",
            f"{len(some)} {scene}, drawn from seed {values['seed']}",
            f"{median(costs):.1f} (median), {costs[0]:.1f} to {costs[-1]:.1f}; pilot {median(shares):.0%} (median), at "
            f"most {shares[-1]:.0%}; promise kept on {sum(one['kept'] for one in some)}",
            f"processor time of a run of {values['run']} hits with its pilot",
            f"least of {values['rounds']} rounds, {values['hits']} hits",
        )


def _overheads(values: Mapping[str, Any]) -> Iterator[Row]:
    names = {
        "help_seconds": "`warpimpact --help`",
        "warm_run_seconds": "run of 100 hits, kernels compiled before",
        "compilation_seconds": "compilation of the kernels, once",
    }
    for key, what in names.items():
        if key in values:
            yield Row(what, "slotted plate", f"{values[key]:.2f} s", "wall time of the command", "least of some runs")
    for one in values.get("hits", ())[-1:]:
        yield Row(
            f"run of {one['count']} hits, wall time",
            "slotted plate",
            f"{one['seconds']:.1f} s, of it {one['compute_seconds']:.1f} s computing; "
            f"{one['peak_memory'] / 2**20:.0f} MiB",
            "wall time of the command",
            "one run",
        )


def _continuum_speed(values: Mapping[str, Any]) -> Iterator[Row]:
    scene, sample = "slotted plate, elements of 0.5 mm", f"median of {values['rounds']} hits at the same place"
    yield Row(
        "a hit by finite elements",
        scene,
        f"{values['seconds']:.2g} s, {values['nanoseconds']:.3g} ns per element and step",
        f"{values['elements']:,} elements, {values['steps']:,} steps, single precision; processor time of one core",
        sample,
    )
    yield Row(
        "a hit by finite elements, times one of the fast law",
        scene,
        f"{_rounded(values['ratio'])}",
        f"{1e3 * values['fast']:.2g} ms at level {values['level']}; processor time of one core",
        sample,
    )
    yield Row(
        "hits by finite elements on all cores",
        scene,
        f"{values['scaling']:.0%} of {values['cores']} times the rate of one",
        "wall time; it means something on a quiet machine only",
        f"{values['together']} hits",
    )


def _design_page(values: Mapping[str, Any]) -> Iterator[Row]:
    ahead = ", scheduled ahead of it" if values["ahead_of_other_work"] else ""
    before = {"rested": "the map before complete", "refining": "the map before being refined"}
    for key, seconds in values["seconds"].items():
        yield Row(
            f"`warpimpact design`, from a change to the first map, {before[key]}",
            "slotted plate",
            f"{seconds['median']:.2f} s (median), {seconds['p95']:.2f} s (95 %)",
            f"until a headless Chromium has drawn it, {seconds['processor']:.2f} s of a core; at most 0.3 s is wanted",
            f"{values['changes']} changes; other load {values['load_before']:.1f}{ahead}",
        )


def _gpu(values: Mapping[str, Any]) -> Iterator[Row]:
    device, level = values["device"], values["level"]
    for scene, ways in values["rates"].items():
        for way, rates in ways.items():
            count = max(rates, key=lambda one: rates[one])
            yield Row(
                f"level {level} on a GPU, hits per second",
                f"{scene}; {way}",
                _rounded(rates[count]),
                f"wall time of the march on {device}",
                f"least of two runs of {int(count):,} hits",
            )
    for name, one in values["agreement"].items():
        yield Row(
            f"level {level} on a GPU, difference from the CPU",
            name,
            ", ".join(f"{key} {one[key][0]:.2g} m/s and {one[key][1]:.2g}°" for key in ("90 %", "max")),
            f"the same hits on the CPU; {one['end_otherwise']} end otherwise",
            f"{one['hits']} Sobol hits",
        )
    if "continuum" in values:
        one = values["continuum"]
        yield Row(
            "hits by finite elements on a GPU, hits per second",
            f"slotted plate; {one['elements']:,.0f} elements",
            f"{one['hits_per_second']:.3g}",
            f"wall time of the march; {one['nanoseconds']:.3g} ns per element and step",
            f"one run of {one['hits']} hits",
        )
    if "file" in values:
        one = values["file"]
        yield Row(
            f"run of {one['hits']:,} hits into a file, on a GPU",
            f"slotted plate; {one['layout']}",
            f"{one['seconds']:.3g} s, {one['bytes'] / 2**20:,.0f} MiB",
            "wall time",
            "one run",
        )


def _rounded(rate: float) -> str:
    return f"{float(f'{rate:.3g}'):,.0f}"


def draw(found: Mapping[str, Any]) -> Any:
    """Error against cost beside the peer, and hits per second of the fidelities."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(12, 7.6), layout="constrained")
    upper, lower = figure.subfigures(2, 1)
    bouts = found.get("peers", {}).get("scenes", {})
    for axes, (scene, bout) in zip(
        upper.subplots(1, max(1, len(bouts)), squeeze=False)[0], bouts.items(), strict=False
    ):
        _draw_peers(axes, scene, bout)
    if "throughput" in found:
        _draw_rates(lower.subplots(), found["throughput"]["scenes"])
    told = found.get("throughput", found.get("peers", {})).get("machine", {})
    figure.suptitle(f"{told.get('processor')}, {told.get('cores')} cores, {told.get('date')}")
    return figure


def _draw_peers(axes: Any, scene: str, bout: Mapping[str, Any]) -> None:
    for program, colour in COLOURS.items():
        some = [one for one in bout["contenders"] if one["program"] == program and one["setting"] != "coarsest"]
        some.sort(key=lambda one: one["microseconds_per_hit"])
        points = [(one["microseconds_per_hit"], one["tilt_error"]) for one in some]
        best = [one for place, one in enumerate(points) if all(one[1] < other[1] for other in points[:place])]
        axes.plot(*zip(*points, strict=True), "o", color=colour, markersize=4)
        axes.plot(*zip(*best, strict=True), "-", color=colour, label=program)
        for one in some:
            for name in FIDELITIES:
                if name in one["setting"]:
                    place = (one["microseconds_per_hit"], one["tilt_error"])
                    axes.annotate(
                        name, place, xytext=(-5, -9), textcoords="offset points", fontsize="small", ha="right"
                    )
    axes.set(xscale="log", yscale="log", title=scene, xlabel="µs of one core per hit", ylabel="90 % error of tilt [°]")
    axes.margins(x=0.15)
    axes.yaxis.set_minor_formatter("{x:.1g}")
    axes.tick_params(axis="y", which="both", labelsize="small")
    axes.grid(which="major", color="0.9")
    axes.legend(frameon=False, fontsize="small")


def _draw_rates(axes: Any, scenes: Mapping[str, Any]) -> None:
    for place, (scene, fidelities) in enumerate(scenes.items()):
        for index, name in enumerate(fidelities):
            at = index + 0.27 * (place - 1)
            colour = ("#0072B2", "#56B4E9", "#009E73")[place % 3]
            axes.bar(at, fidelities[name]["one_core"], 0.25, color=colour, label=scene if index == 0 else None)
        axes.set_xticks(range(len(fidelities)), list(fidelities))
    axes.set(yscale="log", ylabel="hits per second of one core")
    axes.grid(axis="y", which="major", color="0.9")
    axes.set_axisbelow(True)
    axes.legend(frameon=False, fontsize="small")


def main(argv: Sequence[str] | None = None) -> int:
    """Draw the figure; with "all", measure first. Returns 1 if a benchmark failed."""
    parser = argparse.ArgumentParser(
        description="draw the figure of the benchmark page from the results that are there"
    )
    parser.add_argument("measure", nargs="?", choices=("all",), help="measure everything first")
    failed = []
    for name, (script, *arguments) in RUNS.items() if parser.parse_args(argv).measure else ():
        begin = time.monotonic()
        done = subprocess.run([sys.executable, script, *arguments], cwd=HERE, check=False)
        print(f"{name}: {time.monotonic() - begin:.0f} s", flush=True)
        failed += [name] if done.returncode else []
    path = RESULTS / "benchmarks.png"
    draw(results()).savefig(path, dpi=110)
    print(path)
    if failed:
        print(f"failed, or disagree: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
