"""How cores leave the layers in front of those that the fast law alone computes, by the fast law, as features.

Features count when the centre of mass is half the core's length behind the rear face, which all models can be flown to.
Cores that stop have the features of a march through weaker layers: what a core loses is proportional to the resistance,
to first order, so their energy is the loss at the strongest layers that let it pass, divided by their share of Y.
"""

from __future__ import annotations

import json
from functools import cache
from importlib.resources import files
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.status import Status
from warpimpact.records.outcomes import Outcomes
from warpimpact.records.variables import failures, has_passed
from warpimpact.scene import Scene, Shots, Target
from warpimpact.scene.exit_state import FEATURES, ExitStates, features, flown
from warpimpact.scene.model import Array
from warpimpact.scene.quantities import BY_LAYER
from warpimpact.scene.rigid import line_of_flight
from warpimpact.solver.device import Worker
from warpimpact.solver.method import Method
from warpimpact.statistics.law_error import LawErrors

LAW_ERROR = "law_error.json"
"""Errors of the fast laws behind stored plates, made by `make benchmark` (tests/benchmarks/law_error.py)."""
SHARES_OF_RESISTANCE = (0.9, 0.75, 0.5, 0.25, 0.1)
"""Shares of Y at which a core that stops is marched again, until it passes."""


class FrontExits(NamedTuple):
    """Cores as they leave the front layers by the fast law.

    Attributes:
        features: shape [hits, 7] (scene/exit_state.py); NaN where the computation failed.
        position: centre of mass [m] from the hit point, shape [hits, 3].
        untouched: whether a core touches no layer, shape [hits].
        status: codes of `Status`, shape [hits].
    """

    features: Array
    position: Array
    untouched: NDArray[np.bool_]
    status: NDArray[np.int8]


def front_scene(scene: Scene, layers: int) -> Scene:
    """The scene with its first layers alone, without records behind them."""
    record = scene.record.model_copy(update={"standoffs": (), "bending": False})
    front = Target(layers=scene.target.layers[:layers])
    core = scene.core.model_copy(update={"strength": None})
    return scene.model_copy(update={"target": front, "record": record, "core": core})


def front_shots(shots: Shots, layers: int) -> Shots:
    """The shots at the first layers."""
    columns = {name: of[:, :layers] if name in BY_LAYER else of for name, of in shots.columns.items()}
    return Shots(**{name: of for name, of in columns.items() if name != "strength"})


def lines_of_fire(shots: Shots) -> Array:
    """Unit vectors along the lines of fire, shape [hits, 3]."""
    return line_of_flight(shots.obliquity, shots.azimuth)


def front_exits(
    scene: Scene, shots: Shots, method: Method, worker: Worker, outcomes: Outcomes | None = None
) -> FrontExits:
    """Cores as they leave a scene by the fast law.

    Args:
        scene: the front layers (`front_scene`).
        method: the fast law at a resolution.
        outcomes: how they leave it, if that is known.
    """
    outcomes = outcomes or method.prepare(scene, shots, worker).compute()
    untouched = np.asarray(outcomes.status == Status.UNTOUCHED)
    exits = FrontExits(_features(scene, shots, outcomes), outcomes.exit_position.copy(), untouched, outcomes.status)
    stopped = np.flatnonzero(~has_passed(outcomes.status) & ~failures(outcomes.status))
    for share in SHARES_OF_RESISTANCE if len(stopped) else ():
        some = _weaker(scene, shots[stopped], share)
        weaker = method.prepare(scene, some, worker).compute()
        passed = has_passed(weaker.status)
        own, which = _features(scene, some, weaker), stopped[passed]
        exits.features[which] = own[passed]
        exits.features[which, 0] = 1.0 - (1.0 - own[passed, 0]) / share
        exits.position[which] = weaker.exit_position[passed]
        stopped = stopped[~passed]
        if not len(stopped):
            break
    exits.features[stopped] = 0.0
    exits.features[stopped, 0] = 1.0 - 1.0 / SHARES_OF_RESISTANCE[-1]
    return exits


def _features(scene: Scene, shots: Shots, outcomes: Outcomes) -> Array:
    """Features of cores that pass, shape [hits, 7]; NaN of others."""
    passed = has_passed(outcomes.status)
    states = ExitStates(outcomes.exit_velocity, outcomes.exit_axis, outcomes.angular_velocity)
    return features_behind(scene, shots, states, outcomes.exit_position[:, 0], passed)


def features_behind(scene: Scene, shots: Shots, states: ExitStates, place: Array, passed: NDArray[np.bool_]) -> Array:
    """Features of cores behind the front layers, shape [hits, 7]; NaN of those that do not pass.

    Args:
        scene: the front layers.
        place: of the centre of mass along the plate's normal, in these states [m], shape [hits].
    """
    numbers, some = np.full((len(shots), FEATURES), np.nan), ExitStates(*(one[passed] for one in states))
    there = flown(some, plane_behind(scene) - place[passed])
    fire, speed = lines_of_fire(shots)[passed], shots.velocity[passed]
    numbers[passed] = features(*there, fire, speed, scene.core.length)
    return numbers


def plane_behind(scene: Scene) -> float:
    """Where the centre of mass is when features count, along the plate's normal [m]."""
    return scene.target.depth + 0.5 * scene.core.length


def stopped_energies(scene: Scene, position: Array, axis: Array) -> Array:
    """The most energy that cores at rest may have had behind a plate, 0 or less, as a share of that on impact.

    A core that has opened a share of the section that it needs has done at most this share of the work: what it pushes
    aside costs energy, and friction comes later. In solid plates elements do 0.84 to 0.94 of it. Behind several layers
    nothing is known but that it is not above 0.

    Args:
        scene: the front layers.
        position, axis: of the cores at rest, shape [hits, 3].
    """
    if len(scene.target.layers) > 1 or not len(axis):
        return np.zeros(len(axis))
    core, planes = scene.core, scene.target.depth * (np.arange(64) + 0.5) / 64
    stations = np.linspace(0.0, core.length, 257)
    opened = np.maximum.accumulate(core.radius(stations)) ** 2
    nose = position[:, :1] + core.mass_properties.centre_of_mass * axis[:, :1]
    along = (nose - planes) / np.maximum(axis[:, :1], 0.5)
    share = np.interp(along, stations, opened, left=0.0).mean(axis=1) / opened[-1]
    return np.asarray(1.0 - 1.0 / np.clip(share, 0.05, 1.0))


def _weaker(scene: Scene, shots: Shots, share: float) -> Shots:
    """The shots at layers with a share of their resistance."""
    for layer in range(len(scene.target.layers)):
        resistance = np.broadcast_to(share * shots.layer_value(scene.target, "resistance", layer), len(shots))
        shots = shots.assign({"resistance": resistance}, layer)
    return shots


@cache
def law_errors(of_catalogue: bool, as_fired: bool) -> LawErrors:
    """The error of the campaign's law and of the second one, and of the first alone.

    Args:
        of_catalogue: whether the resistance of the perforated plates is that of the catalogue, which meets limits of
            solid plates. Behind holes such a law takes more energy than finite elements do.
        as_fired: whether finite elements compute whole bullets whose cores deform, else rigid bare cores.
    """
    tables = json.loads(files(__package__).joinpath(LAW_ERROR).read_text(encoding="utf-8"))
    return LawErrors.from_numbers(tables["as fired" if as_fired else "bare"]["catalogue" if of_catalogue else "given"])
