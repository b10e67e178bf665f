"""The table of the benchmark page (docs/benchmarks.md), from results/*.json.

    make benchmark                                  # measures everything: some 8 minutes on two quiet cores

The table is made from the results when the pages are built. A result that is missing leaves its rows out.
"""

from __future__ import annotations

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


class Row(NamedTuple):
    """One figure: of what, on which scene, how much, beside what, from which sample."""

    what: str
    scene: str
    figure: str
    reference: str
    sample: str


def results() -> dict[str, Any]:
    """The results that are there, by name."""
    paths = {name: RESULTS / f"{name}.json" for name in KNOWN}
    return {name: json.loads(path.read_text(encoding="utf-8")) for name, path in paths.items() if path.exists()}


def rows(stored: Mapping[str, Any]) -> Iterator[Row]:
    """Every row of the table."""
    for part in (_throughput, _roads, _drawn, _overheads, _continuum_speed, _design_page, _gpu):
        if (name := part.__name__.removeprefix("_")) in stored:
            yield from part(stored[name])


def machines(stored: Mapping[str, Any]) -> Iterator[str]:
    """Where and when each result was measured, a sentence each."""
    for name, values in stored.items():
        one = values["machine"]
        where = f"{one['processor']}, {one['cores']} cores, Python {one['python']}"
        yield f"`{KNOWN[name][0]}`: {where}, {one['date']}."


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


def _roads(values: Mapping[str, Any]) -> Iterator[Row]:
    for name, one in values["roads"].items():
        yield Row(
            "standard, times the cost of the slotted plate",
            name,
            f"{one['ratio']:.1f}; level {one['level']}, {one['microseconds_per_hit']:.3g} µs per hit, "
            f"pilot {one['pilot_share']:.0%}" + ("" if one["kept"] else "; promise not kept"),
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
    per_step = f"{values['seconds']:.2g} s, {values['nanoseconds']:.3g} ns per element and step"
    size = f"{values['elements']:,} elements, {values['steps']:,} steps, single precision"
    fast = f"{1e3 * values['fast']:.2g} ms at level {values['level']}"
    share = f"{values['scaling']:.0%} of {values['cores']} times the rate of one"
    of_wall, hits = "wall time; it means something on a quiet machine only", f"{values['together']} hits"
    yield Row("a hit by finite elements", scene, per_step, f"{size}; processor time of one core", sample)
    against = "a hit by finite elements, times one of the fast law"
    yield Row(against, scene, _rounded(values["ratio"]), f"{fast}; processor time of one core", sample)
    yield Row("hits by finite elements on all cores", scene, share, of_wall, hits)


def _design_page(values: Mapping[str, Any]) -> Iterator[Row]:
    ahead = ", scheduled ahead of it" if values["ahead_of_other_work"] else ""
    before = {"rested": "the map before complete", "refining": "the map before being refined"}
    for key, seconds in values["seconds"].items():
        yield Row(
            f"`warpimpact design`, from a change to the first map, {before[key]}",
            "slotted plate",
            f"{seconds['median']:.2f} s (median), {seconds['p95']:.2f} s (95 %)",
            "until a headless Chromium has drawn it; at most 0.3 s is wanted",
            f"{values['changes']} changes; other load {values['load_before']:.1f}{ahead}",
        )


def _gpu(values: Mapping[str, Any]) -> Iterator[Row]:
    of_level = f"level {values['level']} on a GPU"
    for scene, ways in values["rates"].items():
        for way, rates in ways.items():
            count = max(rates, key=lambda one: rates[one])
            march, runs = f"wall time of the march on {values['device']}", f"least of two runs of {int(count):,} hits"
            yield Row(f"{of_level}, hits per second", f"{scene}; {way}", _rounded(rates[count]), march, runs)
    for name, one in values["agreement"].items():
        off = ", ".join(f"{key} {one[key][0]:.2g} m/s and {one[key][1]:.2g}°" for key in ("90 %", "max"))
        same = f"the same hits on the CPU; {one['end_otherwise']} end otherwise"
        yield Row(f"{of_level}, difference from the CPU", name, off, same, f"{one['hits']} Sobol hits")
    one = values["continuum"]
    scene, hits = f"slotted plate; {one['elements']:,.0f} elements", f"one run of {one['hits']} hits"
    march = f"wall time of the march; {one['nanoseconds']:.3g} ns per element and step"
    yield Row("hits by finite elements on a GPU, hits per second", scene, f"{one['hits_per_second']:.3g}", march, hits)
    one = values["file"]
    what, size = f"run of {one['hits']:,} hits into a file, on a GPU", f"{one['bytes'] / 2**20:,.0f} MiB"
    yield Row(what, f"slotted plate; {one['layout']}", f"{one['seconds']:.3g} s, {size}", "wall time", "one run")


def _rounded(rate: float) -> str:
    return f"{float(f'{rate:.3g}'):,.0f}"


def main() -> int:
    """Measure everything; returns 1 if a benchmark failed."""
    failed = []
    for name, (script, *arguments) in RUNS.items():
        begin = time.monotonic()
        done = subprocess.run([sys.executable, script, *arguments], cwd=HERE, check=False)
        print(f"{name}: {time.monotonic() - begin:.0f} s", flush=True)
        failed += [name] if done.returncode else []
    if failed:
        print(f"failed: {', '.join(failed)}", file=sys.stderr)
    return 1 if failed else 0


if __name__ == "__main__":
    sys.exit(main())
