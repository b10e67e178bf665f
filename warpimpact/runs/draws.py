"""Draws of whole maps: how every hit of a campaign may end, by all that is known of it (docs/continuum.md).

In a draw, each core leaves the layers of finite elements in a state that follows from both fast laws, from the hits by
elements and from their errors (statistics/drawing.py), and each material has a strength within its tested error. Cores
go on from there by the fast law, through other layers and to the stand-offs.
"""

from __future__ import annotations

import hashlib
import json
import math
import zlib
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.inputs import ELEMENT_TABLES, inputs_of
from warpimpact.continuum.front import (
    features_behind,
    front_exits,
    front_scene,
    front_shots,
    lines_of_fire,
    plane_behind,
    stopped_energies,
)
from warpimpact.continuum.handover import WHOLE, Exits, march_on
from warpimpact.kernels.status import Status
from warpimpact.measures import draws as of_draws
from warpimpact.records import variables as v
from warpimpact.records.outcomes import Outcomes
from warpimpact.results.dataset import stored_columns
from warpimpact.runs.compute import Report, shots_of
from warpimpact.scene import Core, Scene, Shots, Target
from warpimpact.scene.exit_state import FEATURES, ExitStates, states
from warpimpact.scene.interaction import NEAR_EDGES, Interaction
from warpimpact.scene.model import Array
from warpimpact.scene.rigid import attitudes
from warpimpact.solver.device import Worker
from warpimpact.solver.fast_law import FastLaw
from warpimpact.statistics.drawing import draw_states
from warpimpact.statistics.law_error import LawErrors

STRENGTH_RATIO = 2.8 / 2.6
"""Y of the law with free surfaces over that of the paper's law, at which both were compared with finite elements."""
MESH_ERROR = {"draft": 3.9, "standard": 1.5}
"""Error of the residual velocity by meshes, root mean square against the next finer ones [m/s] (docs/continuum.md)."""
BEHIND = FastLaw(level=1)
"""The fast law behind the front layers, of whose P(base_perforated) the next level moves less than a draw in 100."""
_CODES = (v.STATUS, v.STOPPED_IN, v.LAYER_STATUS)
_STEPS = 32000
"""Steps of 16 bits in which the largest number of a variable is stored."""


@dataclass(frozen=True)
class MapModel:
    """What draws of a map come from.

    Attributes:
        front: number of layers in front of those that the fast law alone computes; 0 is a law with no error but that
            of its strengths.
        numbers: of the hits that are in every draw, shape [hits].
        law, second: their features by both laws, shape [hits, 7].
        elements: features by elements of some of these hits, shape [n, 7]; of cores that stop the energy is the most
            that it may be, 0 or less.
        at: places of these among the hits, shape [n].
        broken, leading: of these hits, whether the core broke, shape [n], and what goes on: the share of its mass, and
            front and rear of its stretch [m], shape [n, 3]. None of rigid cores.
        error: of both laws.
        seed: of the draws of this map alone, so that errors of the laws at two plates are independent.
        strengths: factors of the strength of each layer, shape [draws, layers].
        shifts: of the residual velocity by the mesh [m/s], shape [draws].
    """

    front: int
    numbers: NDArray[np.int64]
    law: Array
    second: Array
    elements: Array
    at: NDArray[np.int64]
    broken: NDArray[np.bool_] | None
    leading: Array | None
    error: LawErrors
    seed: int
    strengths: Array
    shifts: Array

    @property
    def key(self) -> str:
        """A name of all that it is made of."""
        arrays = (self.numbers, self.law, self.second, self.elements, self.at, self.strengths, self.shifts)
        fates, error = () if self.leading is None else (self.broken, self.leading), self.error.alone.mean
        return hashlib.sha256(b"".join(one.tobytes() for one in (*arrays, *fates, error))).hexdigest()[:8]

    def fates(self, core: Core, numbers: NDArray[np.int64], count: int) -> tuple[NDArray[np.bool_], Array]:
        """Whether each core breaks in some draws, shape [count, hits], and what goes on, shape [count, hits, 3].

        Hits by elements are kept as they are. Another core breaks with one probability in each draw, by these hits and
        Jeffreys' prior. What goes on of it is that of a hit by elements that ended so; without one, its front half, or
        all of it.
        """
        assert self.broken is not None
        assert self.leading is not None
        breaking, of_hits = int(self.broken.sum()), np.random.default_rng([self.seed, 2, *numbers[:1]])
        ends = 0.5 + breaking, 0.5 + len(self.broken) - breaking
        odds = np.random.default_rng([self.seed, 1]).beta(*ends, of_draws.COUNT)[:count]
        broken = of_hits.random((count, len(numbers))) < odds[:, None]
        left = np.where(broken[..., None], (0.5, 0.0, core.middle), (1.0, *WHOLE))
        for state in (False, True):
            if (such := self.leading[self.broken == state]).size:
                left = np.where((broken == state)[..., None], of_hits.choice(such, broken.shape), left)
        _, places, own = np.intersect1d(numbers, self.numbers[self.at], return_indices=True)
        broken[:, places], left[:, places] = self.broken[own], self.leading[own]
        return broken, left

    def draw(self) -> Array:
        """Features of the hits in every draw, shape [of_draws.COUNT, hits, 7]; NaN of hits that failed by a law."""
        none = np.empty((0, FEATURES))
        return self._drawn(none, none, np.arange(0), of_draws.COUNT)

    def draw_others(self, law: Array, second: Array, numbers: NDArray[np.int64], count: int) -> Array:
        """Features of other hits in some draws, shape [count, hits, 7], from those by both laws, [hits, 7]."""
        return self._drawn(law, second, numbers, count)

    def _drawn(self, law: Array, second: Array, numbers: NDArray[np.int64], count: int) -> Array:
        """Features of other hits, or without any of those in every draw."""
        law, second = np.concatenate([self.law, law]), np.concatenate([self.second, second])
        numbers, own = np.concatenate([self.numbers, numbers]), len(self.law)
        sound = np.isfinite(np.concatenate([law, second], axis=1)).all(axis=1)
        known, first = sound[self.at], int(sound[:own].sum())
        at = (np.cumsum(sound) - 1)[self.at[known]]
        wanted = sound & (np.arange(len(law)) >= (own if len(law) > own else 0))
        drawn = np.full((count, *law.shape), np.nan)
        if wanted.any() and first:
            laws = law[sound], second[sound] if len(at) else None
            some = slice(first if len(law) > own else 0, None)
            how = {
                "count": count,
                "seed": self.seed,
                "error": self.error,
                "hits": some,
                "numbers": numbers[sound],
            }
            drawn[:, wanted] = draw_states(*laws, self.elements[known], at, **how)
        return drawn[:, own:] if len(law) > own else drawn


def second_law(scene: Scene) -> tuple[Scene, float]:
    """The scene under the law with free surfaces, without friction and weakening, and the ratio of its Y to that of the
    scene; under the plain law, if the scene has free surfaces already."""
    near = scene.interaction.free_surface is None
    law = (NEAR_EDGES if near else Interaction()).model_copy(update={"onset": scene.interaction.onset})
    ratio = STRENGTH_RATIO if near else 1.0 / STRENGTH_RATIO
    changes = {"shear_coefficient": 0.0, "degradation": 1.0}
    layers = tuple(
        one.model_copy(update=changes | {"resistance": ratio * one.resistance}) for one in scene.target.layers
    )
    return scene.model_copy(update={"target": Target(layers=layers), "interaction": law}), ratio


def law_exits(
    campaign: Campaign,
    numbers: NDArray[np.int64],
    method: FastLaw,
    front: int,
    known: xarray.Dataset | None,
    both: bool,
    *,
    worker: Worker,
    report: Report = lambda done: None,
) -> xarray.Dataset:
    """How cores leave the front layers by both laws.

    Args:
        known: how the hits end by the first law (`exit_states`); None where that is not known.
        both: whether the second law is wanted; without it, the first one stands in its place.

    Returns:
        Along "hit": features by the "law" and by the "second" one, "position" [m], whether a core is "untouched" by
        both, and the "status" by the first one.
    """
    scene, shots = front_scene(campaign.scene, front), front_shots(shots_of(campaign, numbers), front)
    outcomes = None if known is None else Outcomes(**{str(name): of.values for name, of in known.data_vars.items()})
    own = second = front_exits(scene, shots, method, worker, outcomes)
    if both:
        other, ratio = second_law(scene)
        resistance = None if shots.resistance is None else ratio * shots.resistance
        of_other = replace(shots, resistance=resistance, shear_coefficient=None, degradation=None)
        second = front_exits(other, of_other, method, worker)
    columns = {
        "law": (("hit", "feature"), own.features),
        "second": (("hit", "feature"), second.features),
        "position": (("hit", "axis"), own.position),
        "untouched": ("hit", own.untouched & second.untouched),
        "status": ("hit", own.status),
    }
    return xarray.Dataset(columns, {"hit": numbers})


def exit_states(hits: xarray.Dataset, front: int) -> xarray.Dataset | None:
    """How some hits of a map end, in SI; None where the map does not say how cores leave the front layers."""
    needed = (v.STATUS, v.EXIT_VELOCITY, v.EXIT_AXIS, v.ANGULAR_VELOCITY, v.EXIT_POSITION)
    if any(name not in hits for name in needed) or hits.sizes.get("layer", 1) != front:
        return None
    place = hits[v.EXIT_POSITION].values.astype(float)
    place[:, 1:] -= np.column_stack([hits[v.HIT_Y], hits[v.HIT_Z]])
    columns = {str(name): (hits[name].dims, hits[name].values.astype(float)) for name in needed[1:4]}
    columns[v.EXIT_POSITION] = hits[v.EXIT_POSITION].dims, place
    return xarray.Dataset({v.STATUS: (v.HITS, hits[v.STATUS].values), **columns})


def element_features(campaign: Campaign, elements: xarray.Dataset, front: int) -> Array:
    """Features of hits by finite elements behind the front layers, shape [hits, 7]; of cores that stop the energy is
    the most that it may be (`stopped_energies`) and all else NaN, of failed hits all is NaN."""
    shots, status = shots_of(campaign, elements[v.HIT].values.astype(np.int64)), elements[v.STATUS].values
    passed, names = v.has_passed(status), (v.EXIT_VELOCITY, v.EXIT_AXIS, v.ANGULAR_VELOCITY, v.EXIT_POSITION)
    if v.HANDOVER_VELOCITY in elements:
        passed, names = np.isfinite(elements[v.HANDOVER_VELOCITY].values[:, 0]), v.HANDOVER_VARIABLES
    *state, position = (elements[name].values.astype(float) for name in names)
    scene = front_scene(campaign.scene, front)
    numbers = features_behind(scene, shots, ExitStates(*state), position[:, 0], passed)
    stopped = ~passed & ~v.failures(status)
    rest = (elements[name].values[stopped].astype(float) for name in (v.EXIT_POSITION, v.EXIT_AXIS))
    numbers[stopped, 0] = np.where(status[stopped] == Status.ARRESTED, stopped_energies(scene, *rest), 0.0)
    return numbers


def seed_of(campaign: Campaign) -> int:
    """A seed that belongs to the inputs of a campaign, whatever its title and what computes it."""
    inputs = {name: value for name, value in inputs_of(campaign).items() if name not in ("title", *ELEMENT_TABLES)}
    return zlib.crc32(json.dumps(inputs, sort_keys=True).encode())


def strength_factors(campaign: Campaign, front: int) -> Array:
    """Factors of the strength of each layer, shape [of_draws.COUNT, layers]: lognormal, within its tested error.

    A material has the same factors in all layers and results. Where its error is not known, they are 1.
    """
    entries = campaign.continuum.entries if front and campaign.continuum.materials else []
    factors = np.ones((of_draws.COUNT, len(campaign.target.layers)))
    for place, plate in enumerate(campaign.target.layers):
        if place < front and entries:
            entry = entries[min(place, len(entries) - 1)]
            name, error = entry.name, entry.strength_error or 0.0
        else:
            known = campaign.catalogue_resistance(plate)
            name, error = str(plate.material), 0.0 if known is None else known.deviation
        factors[:, place] = np.exp(error * of_draws.standard_normals(name))
    return factors


def mesh_shifts(fidelity: str) -> Array:
    """What the mesh of the elements moves the residual velocity by in each draw, shape [of_draws.COUNT, m/s]."""
    return MESH_ERROR.get(fidelity, MESH_ERROR["standard"]) * of_draws.standard_normals(f"mesh {fidelity}")


def march_draws(
    campaign: Campaign,
    numbers: NDArray[np.int64],
    method: FastLaw,
    model: MapModel,
    exits: xarray.Dataset | None,
    drawn: Array,
    *,
    worker: Worker,
    report: Report = lambda done: None,
) -> xarray.Dataset:
    """How some hits end in the first draws, along `v.DRAW` and `v.DRAWN_HIT`.

    Args:
        exits: of these hits, as `law_exits` gives them; None where no layers are in front.
        drawn: features behind the front layers, shape [draws, hits, 7].
    """
    shots, front, count = shots_of(campaign, numbers), model.front, len(drawn)
    every, scene = np.tile(np.arange(len(numbers)), count), _plain(campaign.scene)
    repeated = replace(shots[every], strength=None)
    for layer in range(front, len(scene.target.layers)):
        factors = np.repeat(model.strengths[:count, layer], len(numbers))
        resistance = factors * repeated.layer_value(scene.target, "resistance", layer)
        repeated = repeated.assign({"resistance": resistance}, layer)
    if exits is None:
        return _drawn_dataset(method.prepare(scene, repeated, worker).compute(), numbers, count)
    broken, left = (None, None) if model.leading is None else model.fates(scene.core, numbers, count)
    untouched, features = exits["untouched"].values, drawn.copy()
    strengths = model.strengths[:count, :front].mean(axis=1)[:, None]
    energy = 1.0 - strengths * (1.0 - drawn[..., 0])
    energy += 2.0 * np.sqrt(np.maximum(energy, 0.0)) * model.shifts[:count, None] / shots.velocity
    features[..., 0] = np.where(untouched, drawn[..., 0], np.minimum(energy, 1.0))
    touched = np.repeat(~untouched[:, None], front, axis=1)
    ends = exits_behind(scene, shots, features, exits["position"].values, touched, left)
    failed, codes = np.isnan(features).any(axis=-1).ravel(), exits["status"].values[every]
    codes = np.where(v.failures(codes), codes, Status.UNFINISHED)
    ends = ends._replace(status=np.where(failed, codes, ends.status).astype(np.int8))
    outcomes = march_on(scene, repeated, ends, worker, BEHIND)
    if broken is not None:
        mass = ends.share * repeated.value("mass", scene.core.mass_properties.mass)
        columns = {str(v.BROKEN): np.where(failed, np.nan, broken.ravel()), str(v.FRAGMENT_MASS): mass}
        outcomes = outcomes.assign(**columns)
    return _drawn_dataset(outcomes, numbers, count)


def draw_others(
    campaign: Campaign,
    numbers: NDArray[np.int64],
    method: FastLaw,
    model: MapModel,
    known: xarray.Dataset | None,
    count: int,
    *,
    worker: Worker,
    report: Report = lambda done: None,
) -> xarray.Dataset:
    """Means of draws of hits that are not in every draw (`means_of`); arguments as in `law_exits`."""
    exits, drawn = None, np.empty((count, len(numbers), FEATURES))
    if model.front:
        both = len(model.at) > 0
        exits = law_exits(campaign, numbers, method, model.front, known, both, worker=worker, report=report)
        drawn = model.draw_others(exits["law"].values, exits["second"].values, numbers, count)
    return means_of(march_draws(campaign, numbers, method, model, exits, drawn, worker=worker))


def _plain(scene: Scene) -> Scene:
    """The scene without records of bending."""
    record, core = scene.record.model_copy(update={"bending": False}), scene.core.model_copy(update={"strength": None})
    return scene.model_copy(update={"record": record, "core": core})


def exits_behind(
    scene: Scene, shots: Shots, drawn: Array, position: Array, touched: NDArray[np.bool_], left: Array | None = None
) -> Exits:
    """Cores behind the front layers, one draw after the other; all of their points are behind the last of these layers.

    Args:
        shots: of the hits.
        drawn: features of the cores, shape [draws, hits, 7]; NaN where the computation failed.
        position: of their centres of mass across the plate's normal, shape [hits, 3, m]; x does not count.
        touched: whether a core touches each of these layers, shape [hits, layers].
        left: what goes on of them, as `MapModel.fates` has it; None is all of them.
    """
    failed, count = np.asarray(np.isnan(drawn).any(axis=-1)), len(drawn)
    numbers = np.where(failed[..., None], 0.0, drawn)
    velocity, axis, rate = states(numbers, lines_of_fire(shots), shots.velocity, scene.core.length)
    status = np.where(touched.any(axis=1), Status.PERFORATED, Status.UNTOUCHED)
    stopped = np.where(numbers[..., 0] > 0.0, Status.RICOCHETED, Status.ARRESTED)
    body, layers = scene.core.mass_properties, touched.shape[1]
    heavier = shots.value("mass", body.mass)[:, None] / body.mass
    place = np.broadcast_to(position, velocity.shape).copy()
    place[..., 0] = plane_behind(front_scene(scene, layers))
    if layers < len(scene.target.layers):
        rear = scene.target.faces[layers - 1, 1]
        place[..., 0] = np.maximum(place[..., 0], rear + _reach_back(scene.core, axis))
    place[failed] = 0.0
    left = np.tile((1.0, *WHOLE), (failed.size, 1)) if left is None else left.reshape(-1, 3)
    return Exits(
        status=np.where(velocity[..., 0] > 0.0, status, stopped).ravel().astype(np.int8),
        position=place.reshape(-1, 3),
        velocity=velocity.reshape(-1, 3),
        momentum=(body.inertia_transverse * heavier * rate).reshape(-1, 3),
        attitude=attitudes(axis.reshape(-1, 3)),
        touched=np.tile(touched, (count, 1)),
        time=np.zeros(failed.size),
        share=left[:, 0],
        stretch=left[:, 1:],
    )


def _reach_back(core: Core, axis: Array) -> Array:
    """Largest distance of a core's points in front of its centre of mass, along the plate's normal [m]."""
    stations = np.linspace(0.0, core.length, 65)
    ahead, radius = core.mass_properties.centre_of_mass - stations, core.radius(stations)
    across = np.sqrt(np.maximum(0.0, 1.0 - axis[..., :1] ** 2))
    return np.asarray((radius * across - ahead * axis[..., :1]).max(axis=-1))


def _drawn_dataset(outcomes: Outcomes, numbers: NDArray[np.int64], count: int) -> xarray.Dataset:
    """Outcomes of all draws, one draw after the other, as a Dataset along `v.DRAW` and `v.DRAWN_HIT`."""
    sometimes = (*v.DRAWN_BEHIND, *v.DRAWN_OF_FRAGMENTS, *v.MEANS_ONLY)
    known = [*v.DRAWN, *(name for name in sometimes if name in outcomes)]
    columns = {}
    for name, (dims, values, attributes) in stored_columns(known, vars(outcomes), known).items():
        array = np.asarray(values).reshape(count, len(numbers), *np.shape(values)[1:])
        columns[name] = xarray.Variable((v.DRAW, v.DRAWN_HIT, *dims[1:]), array, attributes)
    return xarray.Dataset(columns, {v.DRAWN_HIT: numbers.astype(np.int32)})


def packed(draws: xarray.Dataset) -> xarray.Dataset:
    """Draws with numbers that 16 bits hold, in which a file stores them."""
    columns = {}
    for name, column in draws.data_vars.items():
        if column.dtype.kind == "f":
            largest = float(np.nanmax(np.abs(column.values), initial=1e-30))
            step = np.float32(10.0 ** math.ceil(math.log10(largest / _STEPS)))
            columns[name] = column.copy(data=np.float32(np.round(column.values / step)) * step)
            columns[name].encoding = {"dtype": "int16", "scale_factor": step, "_FillValue": np.int16(-32768)}
    return draws.assign(columns)


def means_of(draws: xarray.Dataset) -> xarray.Dataset:
    """What draws say of each hit, along "hit": the most frequent status, the share that passes, and means over the
    draws that pass; those of energy loss and depth are over all, those of a layer over draws that pass it."""
    status = draws[v.STATUS].values
    passed = v.has_passed(status)
    columns: dict[str, Any] = {v.STATUS: _most_frequent(status)}
    is_bad = v.failures(columns[v.STATUS])
    columns[v.PERFORATED] = np.where(is_bad, np.nan, passed.mean(axis=0)).astype(np.float32)
    for name in (one for one in draws.data_vars if one not in _CODES):
        counted = np.ones_like(passed) if name in (v.ENERGY_LOSS, v.DEPTH, v.BROKEN, *v.LAYER_NUMBERS) else passed
        values = draws[name].values
        columns[str(name)] = _nan_mean(
            np.where(counted.reshape(counted.shape + (1,) * (values.ndim - 2)), values, np.nan)
        )
    columns[v.RESIDUAL_VELOCITY][~passed.any(axis=0) & ~is_bad] = 0.0  # as by one law
    for name in (one for one in _CODES[1:] if one in draws):
        columns[name] = _most_frequent(draws[name].values)
    dims = {name: (v.HIT, *draws[name].dims[2:]) if name in draws else v.HITS for name in columns}
    of_fragments = {str(name): draws[name].attrs for name in v.DRAWN_OF_FRAGMENTS if name in draws}
    variables = {name: (dims[name], of, of_fragments.get(str(name), {})) for name, of in columns.items()}
    return xarray.Dataset(variables, {v.HIT: draws[v.DRAWN_HIT].values})


def with_means(law: xarray.Dataset, means: xarray.Dataset) -> xarray.Dataset:
    """A map by the fast law with what draws of the same hits say (`means_of`) in its place."""
    columns = dict[str, Any]()
    for name, of in means.data_vars.items():
        is_new = name == v.PERFORATED or name not in law
        dtype = np.float32 if is_new else law[name].dtype
        columns[str(name)] = of.dims, of.values.astype(dtype), of.attrs if is_new else law[name].attrs
    answer = law.assign(columns)
    answer[v.PERFORATED].attrs |= {"units": "1", "long_name": "share of the draws in which the core passes"}
    return answer


def _most_frequent(codes: NDArray[Any]) -> NDArray[np.int8]:
    """The most frequent code of each column, the least of several."""
    every = np.unique(codes)
    most = np.argmax([(codes == code).sum(axis=0) for code in every], axis=0)
    return np.asarray(every[most], dtype=np.int8)


def _nan_mean(values: Array) -> Array:
    """Mean over the first axis of the numbers that there are; NaN without any."""
    there = np.isfinite(values)
    total = np.where(there, values, 0.0).sum(axis=0)
    return np.asarray(np.divide(total, there.sum(axis=0), out=np.full(total.shape, np.nan), where=there.any(axis=0)))
