"""From shots of a campaign to a Dataset; every run, local or distributed, goes through here.

Long because everything that a Dataset tells of its campaign is gathered here.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Mapping, Sequence
from dataclasses import asdict, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.posterior import Posterior
from warpimpact.records.outcomes import Outcomes
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import solid_coordinates, to_table
from warpimpact.results.table import Table
from warpimpact.scene import Burst, Numerics, Scene, Shots, Symmetry
from warpimpact.scene.quantities import BY_LAYER, QUANTITIES
from warpimpact.solver.device import find_device
from warpimpact.solver.marching import Progress
from warpimpact.solver.promise import PROMISES, Promise, keep
from warpimpact.solver.resolution import Fidelity, resolve
from warpimpact.solver.simulate import build, simulate

if TYPE_CHECKING:
    from warpimpact.results.table import Result

_FEWEST_BURSTS = 8
"""Of a pilot, however many shots they have."""


def compute(
    campaign: Campaign,
    shots: Shots,
    *,
    promise: Promise | None = None,
    solid: Shots | None = None,
    device: str = "auto",
    threads: int | None = None,
    progress: Progress | None = None,
) -> Table:
    """Compute some shots of a campaign. If it uses symmetry, only the first shot of each group of images is computed.

    Args:
        shots: whole groups of images, as the campaign's sampler gives them.
        promise: the finding of a pilot (`promise_of`); None to compute with the numerics as they are given.
        solid: shots at the solid plate of equal areal density; None for no such shots.
        device, threads, progress: as in `simulate`.

    Returns:
        The columns of results/dataset.py, one entry per shot; they are a complete result.

    Raises:
        DeviceError: the device is absent.
    """
    scene, group = campaign.scene, campaign.symmetries
    computed = shots[:: len(group)]
    follow = progress and (lambda done, total: progress(done * len(group), total * len(group)))
    numerics = campaign.numerics if promise is None else promise.fidelity
    _build(scene, computed, numerics, device)
    begin = time.perf_counter()
    outcomes = _outcomes(scene, computed, numerics, device, threads, follow, campaign.drawn)
    elapsed = time.perf_counter() - begin
    table = described(
        campaign,
        shots,
        outcomes,
        numerics=numerics,
        device=device,
        elapsed=elapsed,
        attributes={} if promise is None else _promised(promise),
    )
    if solid is None:
        return table
    solid, reference = at_solid(campaign, solid), scene.model_copy(update={"target": campaign.target.solid})
    follow = progress and (lambda done, total: progress(len(shots), len(shots)))  # nothing new, but a place to stop
    outcomes = _outcomes(reference, solid, numerics, device, threads, follow, drawn=campaign.drawn)
    return table.assign_coords(solid_coordinates(outcomes, double=is_double(campaign)))


def described(
    campaign: Campaign,
    shots: Shots,
    outcomes: Outcomes,
    *,
    numerics: Numerics | Fidelity,
    device: str,
    elapsed: float,
    attributes: Mapping[str, Any],
) -> Table:
    """The columns of some shots of a campaign.

    Args:
        shots: whole groups of images.
        outcomes: of the first shot of every group.
        numerics: with which they were computed.
        elapsed: time that this took [s].
        attributes: global attributes beside those of any campaign.
    """
    scene, group, chosen = campaign.scene, campaign.symmetries, find_device(device)
    computed, ligament = len(shots) // len(group), campaign.plate.ligament
    table = to_table(
        scene,
        shots,
        outcomes.unfolded(group),
        period=campaign.hits.covered(campaign.plate),
        attributes={
            attr.TITLE: campaign.title,
            attr.HISTORY: f"{datetime.now(UTC):%Y-%m-%dT%H:%M:%SZ} warpimpact run",
            attr.CAMPAIGN: campaign.text,
            **attr.versions(),
            **attr.machine(),
            attr.DEVICE: f"{chosen.alias} ({chosen.name})",
            attr.SAMPLING: campaign.hits.sampling,
            attr.SEED: campaign.hits.seed,
            attr.REPLICATES: campaign.replicates,
            attr.STANDOFF_POINT: campaign.output.standoff_point,
            attr.OPEN_AREA: campaign.plate.open_area,
            attr.AREAL_DENSITY: campaign.target.areal_density,
            attr.CORE: campaign.core.model_dump_json(),
            attr.PLATE: _plate(campaign),
            attr.IMPACT: _impact(campaign),
            attr.MATERIAL: _material(campaign),
            attr.NUMERICS: _numerics(campaign, numerics, shots),
            **_numbers_of(campaign, numerics, shots),
            attr.NUMERICS_GIVEN: json.dumps(dict(campaign.numerics)),
            attr.FAILED_SHARE: campaign.output.failed_share,
            attr.COMPUTE_TIME: elapsed,
            attr.HITS_PER_SECOND: computed / elapsed,
        }
        | ({} if campaign.hits.count is None else {attr.COUNT: campaign.hits.count})
        | ({attr.LAYERS: _layers(campaign)} if campaign.layer else {})
        | ({attr.LIGAMENT: ligament} if math.isfinite(ligament) else {})
        | (_symmetry(group, computed) if campaign.hits.irreducible else {})
        | ({} if campaign.burst is None else _burst(campaign.burst))
        | ({} if campaign.drawn is None else {attr.DISCREPANCY: json.dumps(campaign.drawn.discrepancy)})
        | dict(attributes),
        double=is_double(campaign),
    )
    return table if campaign.output.exit_state else table.drop_vars(v.EXIT_VARIABLES)


class HitMap:
    """What a run computes of every hit of a campaign: how it ends. Another kind of run derives from it.

    Attributes:
        most_solid: shots at most at the solid plate of equal areal density.
    """

    most_solid = 2**12

    @property
    def content(self) -> Mapping[str, str]:
        """What decides the bits of a result, beside the campaign, the versions and the device."""
        return {}

    @property
    def measures(self) -> Sequence[str]:
        """Whose running estimates are told; those of a hit map where there are none."""
        return ()

    def compute(self, campaign: Campaign, shots: Shots, **how: Any) -> Table:
        """Compute some shots; the arguments are those of `compute`."""
        return compute(campaign, shots, **how)

    def promise_of(self, campaign: Campaign, device: str = "auto", progress: Progress | None = None) -> Any:
        """What a pilot of the campaign finds; None if the campaign fixes the resolution itself."""
        return promise_of(campaign, device, progress)

    def promise_in(self, dataset: Result) -> Any:
        """What was found by the pilot of a result."""
        return promise_in(dataset)


def is_double(campaign: Campaign) -> bool:
    """Whether it is computed, and stored, in double precision."""
    return campaign.numerics.precision == "double"


def at_solid(campaign: Campaign, shots: Shots) -> Shots:
    """Shots at the solid plate of equal areal density: it is as heavy as the target of each shot."""
    target, plate = campaign.target, campaign.plate
    own: dict[str, Any] = {name: shots.columns[name][:, :1] if shots.differs(name, 0) else None for name in BY_LAYER}
    if shots.thickness is not None:
        thickness = shots.own_of(target, "thickness", 0) * (plate.solid.thickness / plate.thickness)
        for k, layer in enumerate(target.layers[1:], start=1):
            share = layer.areal_density / layer.thickness / plate.density
            thickness = thickness + share * shots.own_of(target, "thickness", k)
        own["thickness"] = np.broadcast_to(thickness, len(shots)).copy()
    return replace(shots, **own)


def promise_of(campaign: Campaign, device: str = "auto", progress: Progress | None = None) -> Promise | None:
    """The promise that a pilot of the campaign's own hits finds; None if the campaign fixes the resolution itself.

    The pilot takes the first hits of a Sobol or random sampling. It takes hits at even distances from a grid or a list.
    So it depends on the campaign alone. It takes whole bursts, as a later hit meets what the earlier ones left.

    Args:
        device, progress: as in `simulate`.

    Raises:
        DeviceError: the device is absent.
    """
    if campaign.numerics.explicit is not None:
        return None
    pilot = pilot_of(campaign, PROMISES[campaign.numerics.fidelity].pilot)
    return keep(campaign.scene, campaign.numerics, pilot, device=device, progress=progress)


def pilot_of(campaign: Campaign, most: int) -> Shots:
    """Some of the hits of a campaign, no two of them images of each other; of bursts, whole ones."""
    sampler, images, at_a_plate = campaign.sampler(), len(campaign.symmetries), campaign.at_a_plate
    group = images * at_a_plate
    groups = len(sampler) // group
    count = min(most if at_a_plate == 1 else max(-(-most // at_a_plate), _FEWEST_BURSTS), groups)
    if campaign.hits.sampling in ("sobol", "random"):
        return sampler.shots(0, count * group)[::images]
    places = np.linspace(0, groups, count, endpoint=False).astype(int)
    return Shots.joined([sampler.shots(int(place) * group, group)[::images] for place in places])


def _promised(promise: Promise) -> dict[str, Any]:
    """What is told of a promise."""
    return {
        attr.RESOLUTION: json.dumps(asdict(promise.fidelity)),
        attr.PROMISE_KEPT: int(promise.kept),
        attr.RESIDUAL_VELOCITY_ERROR_P90: promise.residual_velocity_error,
        attr.TILT_ERROR_P90: math.degrees(promise.tilt_error),
        **({} if math.isnan(promise.depth_error) else {attr.DEPTH_ERROR_P90: promise.depth_error}),
    }


def promise_in(dataset: Result) -> Promise | None:
    """The promise that a result was computed with; None if its campaign fixed the resolution."""
    told = dataset.attrs
    if attr.RESOLUTION not in told:
        return None
    return Promise(
        fidelity=Fidelity(**json.loads(told[attr.RESOLUTION])),
        kept=bool(told[attr.PROMISE_KEPT]),
        residual_velocity_error=float(told[attr.RESIDUAL_VELOCITY_ERROR_P90]),
        tilt_error=math.radians(float(told[attr.TILT_ERROR_P90])),
        depth_error=float(told.get(attr.DEPTH_ERROR_P90, math.nan)),
    )


def _build(scene: Scene, shots: Shots, numerics: Numerics | Fidelity, device: str) -> None:
    """Build the kernels first, so that the measured time is that of computing alone."""
    build(scene, shots, numerics=numerics, device=device)


def _outcomes(
    scene: Scene,
    shots: Shots,
    numerics: Numerics | Fidelity,
    device: str,
    threads: int | None,
    progress: Progress | None = None,
    drawn: Posterior | None = None,
) -> Outcomes:
    if drawn is not None and drawn.of_scene:
        return _outcomes_of_scenes(scene, shots, (numerics, device, threads, progress), drawn)
    return simulate(scene, shots, numerics=numerics, device=device, threads=threads, progress=progress)


def _outcomes_of_scenes(scene: Scene, shots: Shots, how: tuple[Any, ...], drawn: Posterior) -> Outcomes:
    """Outcomes of shots whose draws of the posterior need scenes of their own."""
    numerics, device, threads, progress = how
    places: list[Any] = []
    parts: list[Outcomes] = []
    for which, own in drawn.scenes(scene, shots):
        before = sum(map(len, places))
        follow = progress and (lambda done, _, before=before: progress(before + done, len(shots)))
        parts.append(_outcomes(own, shots[which], numerics, device, threads, follow))
        places.append(which)
    order = np.argsort(np.concatenate(places), kind="stable")
    return Outcomes.joined(parts)[order]


def _impact(campaign: Campaign) -> str:
    """Impact quantities as JSON, each with its value or its distribution, and the distribution of the core's mass."""
    scatter = campaign.scatter.given.items()
    given = {name: one.model_dump() for (name, _), one in scatter if not QUANTITIES[name].by_layer}
    return json.dumps(dict(campaign.impact) | given)


def _material(campaign: Campaign) -> str:
    """What the plate resists with, as JSON: of its material, and of the law of its stress."""
    of_plate = campaign.plate.model_dump(exclude={"thickness", "size", "margin", "pattern"})
    return json.dumps(of_plate | campaign.interaction.model_dump())


def _plate(campaign: Campaign) -> str:
    """The plate as JSON; of a mask, the name of its file."""
    told = campaign.plate.model_dump(mode="json")
    if isinstance(file := told["pattern"].get("file"), str):
        told["pattern"]["file"] = Path(file).name
    return json.dumps(told)


def _layers(campaign: Campaign) -> str:
    """What stands behind the plate, as JSON: each layer by its number, with what scatters in it."""
    layers = {str(k + 1): json.loads(layer.model_dump_json()) for k, layer in enumerate(campaign.layer)}
    for (name, k), given in campaign.scatter.given.items():
        if k:
            layers[str(k)][name] = given.model_dump()
    return json.dumps(layers)


def _symmetry(group: Sequence[Symmetry], computed: int) -> dict[str, Any]:
    """Symmetries by which hits were unfolded, and the number of computed hits."""
    return {attr.SYMMETRIES: ", ".join(map(str, group)), attr.IMAGES: len(group), attr.COMPUTED_HITS: computed}


def _burst(burst: Burst) -> dict[str, Any]:
    """How many shots hit a plate, and how they lie."""
    return {attr.BURST: burst.model_dump_json(exclude_none=True), attr.SHOTS_AT_A_PLATE: burst.count}


def made_by(device: str) -> dict[str, str]:
    """Versions and kind of device: with the campaign, they determine the bits of a result."""
    chosen = find_device(device)
    return {
        **attr.versions(),
        attr.DEVICE: "cpu" if chosen.is_cpu else chosen.name,
    }


def _numerics(campaign: Campaign, numerics: Numerics | Fidelity, shots: Shots) -> str:
    """The numerics in force, every choice made, as one line."""
    resolution = resolve(numerics, campaign.scene, shots)
    impact = campaign.impact
    return (
        f"{campaign.numerics.fidelity} fidelity, {campaign.numerics.scheme} scheme, "
        f"time_step {resolution.step_in(impact, campaign.target):.4g} s, "
        f"patches_axial {resolution.patches_axial}, patches_around {resolution.patches_around}, "
        f"grid_spacing {resolution.grid_spacing:.4g} m, precision {'double' if resolution.double else 'single'}"
    )


def _numbers_of(campaign: Campaign, numerics: Numerics | Fidelity, shots: Shots) -> dict[str, Any]:
    """The numerics in force as numbers, by the names of attributes."""
    resolution = resolve(numerics, campaign.scene, shots)
    return {
        attr.PRECISION: "double" if is_double(campaign) else "single",
        attr.PATCHES_AXIAL: resolution.patches_axial,
        attr.PATCHES_AROUND: resolution.patches_around,
        attr.GRID_SPACING: resolution.grid_spacing,
        attr.TIME_STEP: resolution.step_of(campaign.impact, campaign.plate),
    }
