"""warpimpact beside a Numba and a NumPy peer on the same hits: error, hits per second, ratios.

    pip install -e '.[bench]'
    python tests/benchmarks/peers.py            # writes results/peers.json and .png beside it

The exit code is 1 if an error is larger than its setting states, or if the two programs of the literal scheme disagree.
NumPy runs on one core, and its ratio says so.
"""

from __future__ import annotations

import argparse
import sys
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any

import numba
import numba_peer
import numpy as np
import numpy_peer
import xarray
from bench import CAMPAIGN, copied, cores, machine, on_cores, seconds, shots_of, store
from floor import cpu_peak, work_of
from matplotlib.figure import Figure

from warpimpact import Campaign, Numerics, Record, Scene, Shots
from warpimpact.analysis.study import LEVELS, QUOTED, study
from warpimpact.solver.resolution import Fidelity, spelt_out
from warpimpact.solver.simulate import simulate

STATED = {"draft": (2.0, 5.0), "standard": (1.0, 1.0), "reference": (0.1, 0.3)}
"""Stated 90 % errors of warpimpact's fidelities: m/s, and degrees of tilt at the last stand-off."""
SAME = (0.01, 0.01)
"""Allowed 90 % difference between the literal schemes of warpimpact in double precision and of NumPy: m/s and
degrees."""
COARSEST = Fidelity(8, 12, 0.7, 1.0)
"""The fidelity to compare with programs of the literal scheme. It is still far more accurate than they are."""
LITERAL_HITS, FLOOR_HITS = 128, 8
TIMED = 0.5
"""Length of one timed run [s]."""
ROUNDS = 3
"""Runs of each contender, in turn with the others; the best one counts."""
COLOURS = {"warpimpact": "#0072B2", "Numba": "#D55E00", "NumPy": "0.35"}


@dataclass
class Contender:
    """A program at one setting. `march` computes shots on a number of cores."""

    program: str
    setting: str
    march: Callable[[Shots, int], Any]
    error: tuple[float, float]
    stated: tuple[float, float] | None = None
    other_status: int = 0
    rates: dict[int, float] = field(default_factory=dict)

    @property
    def rate(self) -> float:
        """Hits per second on all the cores it can use."""
        return self.rates[max(self.rates)]

    @property
    def fails(self) -> bool:
        """Whether its error is larger than stated."""
        beyond = self.stated is not None and any(np.array(self.error) > self.stated)
        return bool(beyond or self.other_status)

    def summary(self) -> dict[str, Any]:
        """As it goes into the JSON file."""
        return {
            "program": self.program,
            "setting": self.setting,
            "residual_velocity_error": self.error[0],
            "tilt_error": self.error[1],
            "stated": self.stated,
            "hits_per_second": self.rates,
        }


def main(argv: Sequence[str] | None = None) -> int:
    """Measure, print, store; returns 1 if something disagrees."""
    arguments = _parser().parse_args(argv)
    campaign = Campaign.from_toml(CAMPAIGN)
    shots = shots_of(campaign, arguments.hits)
    settings = {name: Numerics(fidelity=name) for name in STATED} | {
        "coarsest": spelt_out(COARSEST, campaign.scene, campaign.impact),
        "nodal": Numerics(scheme="nodal"),
    }
    truth = study(campaign, hits=len(shots), device="cpu", settings=settings, levels=LEVELS[: arguments.levels])
    contenders = [
        *_warpimpact(campaign, truth, settings),
        *_numba(campaign, truth, shots),
        *_numpy(campaign, truth, shots),
    ]
    measure(contenders, shots)
    apart = literal_difference(campaign, shots[:LITERAL_HITS])
    ratios = compare(contenders)
    print(table(contenders, truth))
    for pair in ratios:
        print(f"{pair['warpimpact']} / {pair['peer']}: {pair['ratio']:.3g}")
    floors = floors_of(campaign, contenders, shots[:FLOOR_HITS])
    for one in floors:
        print(
            f"{one['warpimpact']}: {one['operations']:.3g} operations and {one['bytes']:.3g} bytes per hit, "
            f"{one['above_floor']:.3g} times the floor at {one['peak']:.3g} operations/s"
        )
    print(f"literal scheme, warpimpact against NumPy: {apart[0]:.2g} m/s and {apart[1]:.2g}° apart (90 %)")
    values = {
        "machine": machine() | {"numba": numba.__version__, "numpy": np.__version__},
        "hits": len(shots),
        "converged_answer_uncertain_by": _uncertainty(truth),
        "contenders": [one.summary() for one in contenders],
        "ratios": ratios,
        "floors": floors,
        "literal_difference": apart,
    }
    store("peers", values, draw(contenders, truth))
    wrong = [f"{one.program} {one.setting}" for one in contenders if one.fails]
    if any(np.array(apart) > SAME):
        wrong.append("the literal scheme")
    if wrong:
        print(f"disagree beyond what they state: {'; '.join(wrong)}", file=sys.stderr)
    return 1 if wrong else 0


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser(description="warpimpact beside a Numba and a NumPy peer on the same hits")
    parser.add_argument("--hits", type=int, default=512, help="Sobol hits over the unit cell (default: 512)")
    parser.add_argument(
        "--levels",
        type=int,
        choices=range(2, len(LEVELS) + 1),
        default=2,
        help="refinements behind the converged answer (default: 2; 3 takes minutes more and halves its uncertainty)",
    )
    return parser


def _warpimpact(campaign: Campaign, truth: xarray.Dataset, settings: dict[str, Numerics]) -> list[Contender]:
    def one(name: str) -> Contender:
        def march(shots: Shots, count: int) -> None:
            with on_cores(count):
                _simulate(campaign, shots, settings[name])

        found = truth.sel(setting=name, quantile=QUOTED).isel(standoff=-1)
        error = found["residual_velocity_error"].item(), found["tilt_error"].item()
        literal = name == "nodal"
        other = 0 if literal else int(found["other_status"])
        return Contender("warpimpact", "literal" if literal else name, march, error, STATED.get(name), other)

    return [one(name) for name in settings]


def _simulate(campaign: Campaign, shots: Shots, numerics: Numerics) -> Any:
    record = Record(standoffs=campaign.output.standoffs[-1:])
    scene = Scene(core=campaign.core, target=campaign.plate, record=record)
    return simulate(scene, shots, numerics=numerics, device="cpu")


def _numba(campaign: Campaign, truth: xarray.Dataset, shots: Shots) -> list[Contender]:
    standoff = campaign.output.standoffs[-1]

    def one(setting: numba_peer.Setting, stated: tuple[float, float]) -> Contender:
        peer = numba_peer.Peer(campaign.core, campaign.plate, setting)
        status, velocity, tilt = peer(shots, standoff, cores())
        other = int(((status != truth["status"]) & (truth["settled"] == 1)).sum())
        error = _errors(truth, velocity, tilt)
        return Contender("Numba", str(setting), lambda some, n: peer(some, standoff, n), error, stated, other)

    return [one(*item) for item in numba_peer.SETTINGS.items()]


def _numpy(campaign: Campaign, truth: xarray.Dataset, shots: Shots) -> list[Contender]:
    standoff = campaign.output.standoffs[-1]

    def one(setting: str, batch: int) -> Contender:
        peer = numpy_peer.Peer(campaign.core, campaign.plate, batch=batch)
        error = _errors(truth, *peer(shots, standoff))
        return Contender("NumPy", setting, lambda some, _: peer(some, standoff), error)

    return [one("literal, points at once", 1), one("literal, points and hits at once", numpy_peer.BATCH)]


def _errors(truth: xarray.Dataset, velocity: np.ndarray, tilt: np.ndarray) -> tuple[float, float]:
    """90 % errors [m/s], [°] over the settled hits."""
    off = (velocity - truth["residual_velocity"].values, np.degrees(tilt) - truth["tilt"].values[:, -1])
    settled = truth["settled"].values == 1
    return tuple(float(np.quantile(np.abs(values[settled]), QUOTED)) for values in off)


def _uncertainty(truth: xarray.Dataset) -> tuple[float, float]:
    last = truth.isel(level=-1, standoff=-1).sel(quantile=QUOTED)
    return last["residual_velocity_change"].item(), last["tilt_change"].item()


def literal_difference(campaign: Campaign, shots: Shots) -> tuple[float, float]:
    """Difference between two independent programs of the literal scheme, 90 % [m/s], [°]."""
    ours = _simulate(campaign, shots, Numerics(scheme="nodal", precision="double"))
    peer = numpy_peer.Peer(campaign.core, campaign.plate, restrained=True)
    velocity, tilt = peer(shots, campaign.output.standoffs[-1])
    off = velocity - ours.residual_velocity, np.degrees(tilt - ours.tilt[:, -1])
    return tuple(float(np.quantile(np.abs(values), QUOTED)) for values in off)


def measure(contenders: Sequence[Contender], shots: Shots) -> None:
    """Best rate of each contender, on one core and on all. They run in turn, so that a disturbance affects all of
    them."""
    counts = sorted({1, cores()})
    runs = []
    for one in contenders:
        for count in [1] if one.program == "NumPy" else counts:
            one.march(shots[:64], count)  # builds what is to be built
            guess = 64 / seconds(lambda one=one, count=count: one.march(shots[:64], count))
            hits = max(64, int(guess * TIMED))
            runs.append((one, count, copied(shots, -(-hits // len(shots)))[:hits]))
    for _ in range(ROUNDS):
        for one, count, some in runs:
            rate = len(some) / seconds(lambda one=one, count=count, some=some: one.march(some, count))
            one.rates[count] = max(rate, one.rates.get(count, 0.0))


def compare(contenders: Sequence[Contender]) -> list[dict[str, Any]]:
    """The ratios for which the project has targets. Each fidelity is compared with the fastest Numba setting of its
    stated error, on all cores, and with NumPy on its one core. All cores are compared with one core."""
    ours = {one.setting: one for one in contenders if one.program == "warpimpact"}
    pairs = []
    for name in STATED:
        exact = [one for one in contenders if one.program == "Numba" and all(np.array(one.error) <= STATED[name])]
        pairs += [(name, max(exact, key=lambda one: one.rate))] if exact else []
    pairs += [(name, one) for one in contenders if one.program == "NumPy" for name in ours]
    rivals = [
        {"warpimpact": name, "peer": f"{one.program} {one.setting}", "ratio": ours[name].rate / one.rate}
        for name, one in pairs
    ]
    scaling = [
        {"warpimpact": name, "peer": "itself on one core", "ratio": one.rate / one.rates[1]}
        for name, one in ours.items()
    ]
    return rivals + scaling


def floors_of(campaign: Campaign, contenders: Sequence[Contender], shots: Shots) -> list[dict[str, Any]]:
    """How many times longer the fidelities take than their arithmetic would at the machine's peak (floor.py)."""
    peak = cpu_peak(cores())
    found = []
    for one in contenders:
        if one.program == "warpimpact" and one.setting in STATED:
            work = work_of(campaign, shots, Numerics(fidelity=one.setting))
            above = peak / work.operations / one.rate
            found.append({"warpimpact": one.setting, "peak": peak, "above_floor": above} | asdict(work))
    return found


def table(contenders: Sequence[Contender], truth: xarray.Dataset) -> str:
    """Contenders with errors and rates."""
    lines = [f"{'':44}{'m/s':>8}{'°':>8}{'hits/s':>10}{'1 core':>10}    (errors: 90 %)"]
    for one in contenders:
        name = f"{one.program} {one.setting}"
        error = f"{one.error[0]:8.3f}{one.error[1]:8.3f}"
        lines.append(f"{name:44}{error}{one.rate:10.4g}{one.rates[1]:10.4g}{'  *' if one.fails else ''}")
    velocity, tilt = _uncertainty(truth)
    return "\n".join([*lines, f"converged answer: uncertain by {velocity:.2g} m/s and {tilt:.2g}°"])


def draw(contenders: Sequence[Contender], truth: xarray.Dataset) -> Figure:
    """Error against hits per second; hollow on one core."""
    figure = Figure(figsize=(11, 5), layout="constrained")
    panels = figure.subplots(1, 2)
    for index, (axes, name) in enumerate(zip(panels, ("residual velocity [m/s]", "tilt at 130 mm [°]"), strict=True)):
        axes.set(xscale="log", yscale="log", xlabel="hits per second", ylabel=f"90 % error of {name}")
        axes.grid(which="major", color="0.9")
        for program, colour in COLOURS.items():
            some = sorted((one for one in contenders if one.program == program), key=lambda one: one.rate)
            line = [one for one in some if "literal" not in one.setting]
            axes.plot([one.rate for one in line], [one.error[index] for one in line], color=colour, linewidth=1)
            for one in some:
                marker, error = "X" if "literal" in one.setting else "o", one.error[index]
                axes.plot([one.rates[1], one.rate], [error, error], color=colour, linewidth=0.6, linestyle=":")
                axes.plot(one.rates[1], error, marker, markerfacecolor="white", color=colour)
                axes.plot(one.rate, error, marker, color=colour)
                if one.stated and program == "warpimpact":
                    axes.annotate(one.setting, (one.rate, error), xytext=(6, 5), textcoords="offset points")
            axes.plot([], [], "o", color=colour, label=program)
        bottom = 0.5 * min(_uncertainty(truth)[index], *(one.error[index] for one in contenders))
        axes.axhspan(bottom, _uncertainty(truth)[index], color="0.9", label="converged answer uncertain")
        axes.set_ylim(bottom=bottom)
        axes.margins(x=0.12)
    panels[0].plot([], [], "o", color="0.5", markerfacecolor="white", label="one core")
    panels[0].plot([], [], "X", color="0.5", label="the paper's literal scheme")
    figure.legend(*panels[0].get_legend_handles_labels(), loc="outside lower center", ncols=6, frameon=False)
    what = machine()
    figure.suptitle(f"Slotted plate, {truth.sizes['hit']} hits; {what['processor']}, {what['cores']} cores")
    return figure


if __name__ == "__main__":
    sys.exit(main())
