"""warpimpact beside a Numba peer on three scenes, and beside a NumPy peer of the paper's literal scheme on one of them.

    pip install -e '.[bench]'
    python tests/benchmarks/peers.py            # writes results/peers.json

Costs are processor time of one core per hit. All contenders of a scene run in turn, round after round, and the median
round counts, so the ratios mean something on a busy machine, too. Errors are those of 90 % of the hits against the
converged answer of the law with its onset. The peer's cost at an accuracy is interpolated between its settings.

The exit code is 1 if standard is not as accurate as it states, if the finest setting of the Numba peer has more than
half of these errors, so that it solves another law, or if the two programs of the literal scheme disagree.
"""

from __future__ import annotations

import itertools
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import asdict, dataclass, field
from typing import Any, NamedTuple

import numba
import numba_peer
import numpy as np
import numpy_peer
import page
from bench import SCENES, campaign_of, copied, machine, scene_of, shots_of, store
from floor import measured_peak, work_of
from random_scenes import FINE, Answer, extrapolated, off, p90, stepped

from warpimpact import Campaign, Numerics, Shots
from warpimpact.solver.accuracy import pilot_size
from warpimpact.solver.resolution import Level
from warpimpact.solver.simulate import pilot_of, simulate
from warpimpact.solver.worker import Worker

LEVELS, STANDARD = 6, 2
"""Levels of LADDER, from the coarsest on, and the first one at which standard is looked for."""
STATED = (1.0, 1.0)
"""90 % errors that standard promises: m/s, and degrees of tilt at the last stand-off."""
SLACK = 1.15
"""Factor of STATED within which the plain standard has to be; a campaign's pilot would take a finer level instead."""
SAME = (0.01, 0.01)
"""Allowed 90 % difference between the literal schemes of warpimpact in double precision and of NumPy: m/s and
degrees."""
COARSEST = {"patches_axial": 8, "patches_around": 12, "travel": 1.0}
"""The setting, with 0.7 cells per degradation length, to compare with programs of the literal scheme. It is still far
more accurate than they are."""
HITS, LITERAL_HITS, FLOOR_HITS = 256, 128, 8
"""Sobol hits over the unit cell; those of the literal scheme, and those whose operations are counted."""
TIMED = 0.15
"""Processor time of one timed run [s]."""
ROUNDS = 7
"""Runs of each contender, in turn with the others."""

Errors = tuple[float, float]


@dataclass
class Contender:
    """A program at one setting. `march` computes shots on one core; `costs` are those of every round [s per hit]."""

    program: str
    setting: str
    march: Callable[[Shots], Answer]
    error: Errors = (np.nan, np.nan)
    costs: list[float] = field(default_factory=list)

    @property
    def cost(self) -> float:
        """Processor time of one core per hit [s]."""
        return float(np.median(self.costs))

    def summary(self) -> dict[str, Any]:
        """As it goes into the JSON file."""
        return {
            "program": self.program,
            "setting": self.setting,
            "residual_velocity_error": self.error[0],
            "tilt_error": self.error[1],
            "microseconds_per_hit": 1e6 * self.cost,
        }


class Bout(NamedTuple):
    """A scene with everybody's results. `taken` is the level of LADDER that a pilot takes for standard."""

    name: str
    contenders: list[Contender]
    taken: int
    uncertainty: Errors
    floor: dict[str, Any]

    @property
    def finest_peer(self) -> Contender:
        """The Numba peer at its finest setting, which comes as near to the answer as finer levels do."""
        return [one for one in self.contenders if one.program == "Numba"][-1]

    def ours(self, level: int) -> Contender:
        """warpimpact at a level of LADDER."""
        return next(one for one in self.contenders if one.setting == _name(level))


def main() -> int:
    """Measure, print, store; returns 1 if something disagrees."""
    peak = measured_peak()
    bouts = [fight(name, file, peak) for name, file in SCENES.items()]
    apart = literal_difference(campaign_of(SCENES["slotted plate"]))
    print(f"literal scheme, warpimpact against NumPy: {apart[0]:.2g} m/s and {apart[1]:.2g}° apart (90 %)")
    values = {
        "machine": machine() | {"numba": numba.__version__, "numpy": np.__version__},
        "hits": HITS,
        "peak_operations_per_second": peak,
        "scenes": {bout.name: summary(bout) for bout in bouts},
        "literal_difference": apart,
    }
    for row in page.rows({"peers": values}):
        print(*row, sep=" | ")
    store("peers", values)
    wrong = [bout.name for bout in bouts if excess(bout.ours(STANDARD).error, STATED) > SLACK]
    wrong += [f"Numba on {bout.name}" for bout in bouts if excess(bout.finest_peer.error, STATED) > 0.5]
    if any(np.array(apart) > SAME):
        wrong.append("the literal scheme")
    if wrong:
        print(f"disagree beyond what they state: {'; '.join(wrong)}", file=sys.stderr)
    return 1 if wrong else 0


def fight(name: str, file: str, peak: float) -> Bout:
    """All contenders on one scene: errors, costs, and warpimpact's distance from the floor."""
    campaign = campaign_of(file)
    shots = shots_of(campaign, HITS)
    coarse, truth = (_converged(campaign, shots, level) for level in FINE)
    contenders = [*_warpimpact(campaign), *_numba(campaign)]
    for one in contenders:
        one.error = _error(one.march(shots), truth)
    if name == next(iter(SCENES)):
        contenders += _literal(campaign, shots, truth)
    measure(contenders, shots)
    pilot = shots_of(campaign, pilot_size(Numerics().asked))
    taken = pilot_of(scene_of(campaign), pilot, Numerics(), Worker("cpu")).numerics.level
    assert taken is not None
    bout = Bout(name, contenders, taken, _error(coarse, truth), {})
    work = work_of(campaign.scene, shots[:FLOOR_HITS], Numerics(level=STANDARD))
    above = bout.ours(STANDARD).cost * peak / work.operations
    return bout._replace(floor=asdict(work) | {"above_floor": above})


def _march(campaign: Campaign, numerics: Numerics) -> Callable[[Shots], Answer]:
    scene = scene_of(campaign)

    def march(shots: Shots) -> Answer:
        found = simulate(scene, shots, numerics=numerics, device="cpu", threads=1)
        return Answer(found.status, found.residual_velocity, found.tilt[:, 0])

    return march


def _converged(campaign: Campaign, shots: Shots, level: Level) -> Answer:
    """A fine level, without its step's error of second order."""
    return extrapolated(
        *(_march(campaign, stepped(level, k * level.travel, campaign.plate))(shots) for k in (2.0, 1.0))
    )


def _error(answer: Answer, truth: Answer) -> Errors:
    """90 % errors [m/s], [°]; infinite where the status differs."""
    velocity, tilt = off(answer, truth)
    return p90(velocity), p90(tilt)


def _name(level: int) -> str:
    return f"level {level}, standard" if level == STANDARD else f"level {level}"


def _warpimpact(campaign: Campaign) -> list[Contender]:
    return [Contender("warpimpact", _name(k), _march(campaign, Numerics(level=k))) for k in range(LEVELS)]


def _numba(campaign: Campaign) -> list[Contender]:
    standoff = campaign.output.standoffs[-1]

    def one(setting: numba_peer.Setting) -> Contender:
        peer = numba_peer.Peer(campaign.core, campaign.plate, campaign.interaction, setting)
        return Contender("Numba", str(setting), lambda shots: Answer(*peer(shots, standoff, 1)))

    return [one(setting) for setting in numba_peer.SETTINGS]


def _literal(campaign: Campaign, shots: Shots, truth: Answer) -> list[Contender]:
    """The paper's literal scheme in NumPy, and warpimpact's coarsest setting beside it."""
    standoff, some = campaign.output.standoffs[-1], min(LITERAL_HITS, len(shots))

    def one(setting: str, batch: int) -> Contender:
        peer = numpy_peer.Peer(campaign.core, campaign.plate, batch=batch)

        def march(shots: Shots) -> Answer:
            velocity, tilt = peer(shots, standoff)
            return Answer(np.zeros(len(shots), np.int8), velocity, tilt)

        return Contender("NumPy", setting, march)

    coarsest = Numerics(**COARSEST, grid_spacing=campaign.plate.degradation_length / 0.7)
    found = [
        Contender("warpimpact", "coarsest", _march(campaign, coarsest)),
        one("literal, points at once", 1),
        one("literal, points and hits at once", numpy_peer.BATCH),
    ]
    for contender in found:
        answer = contender.march(shots[:some])
        same = answer._replace(status=truth.status[:some]) if contender.program == "NumPy" else answer
        contender.error = _error(same, Answer(*(values[:some] for values in truth)))
    return found


def literal_difference(campaign: Campaign) -> Errors:
    """Difference between two independent programs of the literal scheme, 90 % [m/s], [°]."""
    shots = shots_of(campaign, LITERAL_HITS)
    ours = _march(campaign, Numerics(scheme="nodal", precision="double"))(shots)
    peer = numpy_peer.Peer(campaign.core, campaign.plate, restrained=True)
    velocity, tilt = peer(shots, campaign.output.standoffs[-1])
    return _error(Answer(ours.status, velocity, tilt), ours)


def measure(contenders: Sequence[Contender], shots: Shots) -> None:
    """Costs of each contender. They run in turn, so that a disturbance affects all of them."""

    def seconds(one: Contender, some: Shots) -> float:
        begin = time.process_time()
        one.march(some)
        return time.process_time() - begin

    runs = []
    for one in contenders:
        one.march(shots[:64])  # builds what is to be built
        hits = max(64, int(64 * TIMED / seconds(one, shots[:64])))
        runs.append((one, copied(shots, -(-hits // len(shots)))[:hits]))
    for _ in range(ROUNDS):
        for one, some in runs:
            one.costs.append(seconds(one, some) / len(some))


def excess(error: Errors, accuracy: Errors) -> float:
    """How many times larger the error is than the accuracy, in the worse of velocity and tilt."""
    return max(e / a for e, a in zip(error, accuracy, strict=True))


def cost_at(contenders: Sequence[Contender], accuracy: Errors) -> tuple[float, bool]:
    """Cost of an accuracy [s per hit], interpolated between the settings that no other one beats, on logarithmic
    scales; and whether they enclose it. If not, the cost is that of the nearest."""
    points = sorted((one.cost, excess(one.error, accuracy)) for one in contenders)
    front = [point for k, point in enumerate(points) if all(point[1] < other[1] for other in points[:k])]
    for (cheap, above), (dear, below) in itertools.pairwise(front):
        if above > 1.0 >= below:
            share = np.log(above) / np.log(above / below)
            return float(cheap * (dear / cheap) ** share), True
    return front[0 if front[0][1] <= 1.0 else -1][0], False


def ratios(bout: Bout) -> list[dict[str, Any]]:
    """Cost of the Numba peer over that of standard, at the accuracy that standard reaches and at the one it promises;
    plain, and at the level that a pilot takes."""
    peers = [one for one in bout.contenders if one.program == "Numba"]
    found = []
    for what, level in (("standard", STANDARD), ("standard by its pilot", bout.taken)):
        ours = bout.ours(level)
        for accuracy, errors in (("reached", ours.error), ("promised", STATED)):
            cost, enclosed = cost_at(peers, errors)
            found.append(
                {
                    "warpimpact": f"{what} ({_name(level)})",
                    "accuracy": accuracy,
                    "residual_velocity_error": errors[0],
                    "tilt_error": errors[1],
                    "peer_microseconds": 1e6 * cost,
                    "enclosed": enclosed,
                    "ratio": cost / ours.cost,
                }
            )
    return found


def summary(bout: Bout) -> dict[str, Any]:
    """As it goes into the JSON file."""
    return {
        "converged_answer_uncertain_by": bout.uncertainty,
        "contenders": [one.summary() for one in bout.contenders],
        "ratios": ratios(bout),
        "floor": bout.floor,
    }


if __name__ == "__main__":
    sys.exit(main())
