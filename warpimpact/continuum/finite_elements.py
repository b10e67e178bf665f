"""Finite elements as a method: layers deform and fail, a core is rigid or deforms (docs/continuum.md)."""

from __future__ import annotations

import math
from collections import defaultdict
from dataclasses import dataclass, replace
from functools import cached_property, partial
from threading import Lock
from typing import Annotated, Any, ClassVar, Literal

from numpy.typing import NDArray
from pydantic import Field

from warpimpact.continuum.bullet_mesh import bullet_mesh, bullet_nodes, core_mesh, core_nodes, with_its_mass
from warpimpact.continuum.cost import MeshCost, estimate_cost
from warpimpact.continuum.handover import check_handover, memory_of, outcomes_of
from warpimpact.continuum.many_hits import together
from warpimpact.continuum.meshing import encounters_of, volumes_of
from warpimpact.continuum.one_hit import FIRST, Attempt, FlyingBody, HitResult, OneHit, Start, start_of
from warpimpact.continuum.pictures import Frames, Picture, picture_columns
from warpimpact.kernels.continuum import march_many, march_one
from warpimpact.kernels.continuum.fields import CORE, PART_OF_BULLET
from warpimpact.kernels.variant import Variant
from warpimpact.records.outcomes import Outcomes
from warpimpact.records.variables import (
    ENERGY_IMBALANCE,
    ERODED_ELEMENTS,
    FRAGMENT_VARIABLES,
    HOURGLASS_SHARE,
    PICTURE_VARIABLES,
    Variable,
)
from warpimpact.scene import Core, Scene, Shots, Target
from warpimpact.scene.bullet import Bullet
from warpimpact.scene.flow import Flow
from warpimpact.scene.model import Model
from warpimpact.scene.target import BULGE
from warpimpact.scene.units import Number, PositiveLength, Whole
from warpimpact.solver.device import Worker, cores, find_device, load
from warpimpact.solver.marching import Progress
from warpimpact.solver.memory import Memory, built
from warpimpact.solver.simulate import in_threads

FINENESS = {"draft": 1.0, "standard": 2.0 / 3.0, "reference": 0.5}
"""Size of an element over that of a draft, by fidelity."""
OF_RADIUS, OF_THICKNESS, OF_LIGAMENT = 1.0 / 6.0, 1.0 / 4.0, 1.0 / 3.0
"""Largest size of an element of a draft, over the core's largest radius, the layer's thickness and its ligament."""


class FiniteElementSettings(Model):
    """What finite elements need beside materials.

    Attributes:
        friction: Coulomb's coefficient between core and target, not measured at these speeds.
        layer_friction: the same between layers that touch, and between bullet and target; by default, that of the core.
        fidelity: size of the elements: "draft" (half a millimetre for a core of 6 mm), "standard" or "reference".
        spacing: size of the elements [m], in place of a fidelity.
        layers: number of layers of elements, front to back; cores go on through the others by the fast law.
    """

    friction: Annotated[Number, Field(ge=0, le=1)] | None = None
    layer_friction: Annotated[Number, Field(ge=0, le=1)] | None = None
    fidelity: Literal["draft", "standard", "reference"] = "draft"
    spacing: PositiveLength | None = None
    layers: Annotated[Whole, Field(ge=1)] | None = None


class FiniteElements(FiniteElementSettings):
    """Finite elements (docs/continuum.md): layers deform and fail.

    Attributes:
        flows: constants of the layers, the plate first; one set serves all.
        core: constants of a core that deforms; None is a rigid one.
        bullet: what is about the core, with constants of jacket and filler; None is a bare core.
        double: double precision in place of single.
    """

    flows: Annotated[tuple[Flow, ...], Field(min_length=1)]
    friction: Annotated[Number, Field(ge=0, le=1)] = 0.0
    core: Flow | None = None
    bullet: Bullet | None = None
    double: Annotated[bool, Field(strict=True)] = False

    def layer_flows(self, target: Target) -> list[Flow]:
        """Constants of each layer of elements."""
        return [self.flows[min(k, len(self.flows) - 1)] for k in range(self.layers or len(target.layers))]

    def spacings(self, core: Core, target: Target) -> list[float]:
        """Size of the elements of each layer of elements [m]."""
        layers = target.layers[: self.layers]
        if self.spacing is not None:
            return [self.spacing] * len(layers)
        share, radius = FINENESS[self.fidelity], OF_RADIUS * core.max_radius
        ligaments = (layer.ligament if layer.ligament > 0.0 else math.inf for layer in layers)
        return [
            share * min(radius, OF_THICKNESS * layer.thickness, OF_LIGAMENT * ligament)
            for layer, ligament in zip(layers, ligaments, strict=True)
        ]

    def check(self, scene: Scene) -> None:
        """Refuse what finite elements do not compute, by a ValueError that names it."""
        if len(self.flows) > len(scene.target.layers):
            raise ValueError(f"got materials: {len(self.flows)}, layers of the target: {len(scene.target.layers)}")
        check_handover(scene.core, scene.target, self.layers)
        if self.bullet:
            self.bullet.closed(scene.core)
        if self.core and scene.record.bending:
            raise ValueError('output.bending needs a rigid core; give continuum.core = "rigid", or leave bending out')

    def estimate_cost(self, scene: Scene, shots: Shots) -> MeshCost:
        """What some hits will take. Nothing is meshed."""
        spacings, flows = self.spacings(scene.core, scene.target), self.layer_flows(scene.target)
        fineness = FINENESS[self.fidelity]
        flying = {PART_OF_BULLET: bullet_nodes(self.bullet, scene.core, fineness)} if self.bullet else {}
        flying |= {CORE: core_nodes(scene.core, fineness)} if self.core else {}
        return estimate_cost(scene, shots, spacings, flows, self.double, self.bullet, flying)

    def prepare(self, scene: Scene, shots: Shots, worker: Worker) -> FiniteElementComputation:
        """Check that the shots can be computed; on a CPU that they take neither too long nor too much memory.

        Raises:
            ValueError: as in `check`.
            TooLong, MemoryError: as in `MeshCost.check`.
            DeviceError: the device is absent.
        """
        self.check(scene)
        computation = FiniteElementComputation(self, scene, shots, worker)
        if find_device(worker.device).is_cpu:
            computation.cost.check(computation.threads)
        return computation

    def prepare_hit(
        self,
        scene: Scene,
        shots: Shots,
        number: int,
        conditions: dict[str, NDArray[Any]],
        device: str = "cpu",
        attempt: Attempt = FIRST,
    ) -> OneHit:
        """One of the shots, ready to march.

        Args:
            conditions: as solver/prepare.py has them.
            device: that has its arrays.
        """
        start = start_of(scene, shots, number, self.friction, conditions, self.bullet)
        first, *later = encounters_of(scene, shots, number, self.spacings(scene.core, scene.target), attempt.wider)
        flows = self.layer_flows(scene.target)
        meshes = [first.mesh(*start.arriving)]
        while later and later[0].front - meshes[-1].ends[1] < BULGE:
            meshes.append(later.pop(0).mesh(*start.arriving))
        return OneHit(
            scene.core,
            start,
            meshes,
            flows,
            self.double,
            device,
            later,
            attempt.hourglass,
            self.layer_friction,
            self._flying(scene.core, start, shots[number : number + 1]),
        )

    def _flying(self, core: Core, start: Start, shot: Shots) -> list[FlyingBody]:
        """The bodies of the bullet of a shot at the start."""
        fineness, bodies = FINENESS[self.fidelity], list[FlyingBody]()
        if self.bullet:
            bullet = self.bullet.closed(core)
            mesh = bullet_mesh(bullet, core, start.position, start.attitude, fineness)
            bullet = with_its_mass(bullet, core, mesh, volumes_of(mesh)[0])
            bodies.append(FlyingBody(mesh, bullet.flows, PART_OF_BULLET, bullet.core_place))
        if self.core:
            mesh = core_mesh(core, start.position, start.attitude, fineness)
            density = start.body.mass / float(volumes_of(mesh)[0].sum())
            given = shot.columns.get("strength", [core.strength])[0]
            strength = self.core.fracture_stress if given is None else float(given)
            flow = self.core.model_copy(update={"density": density, "fracture_stress": strength})
            bodies.append(FlyingBody(mesh, [flow], CORE))
        return bodies


@dataclass(frozen=True)
class FiniteElementComputation:
    """Shots that finite elements will compute; it is a `Computation` (solver/method.py)."""

    method: FiniteElements
    scene: Scene
    shots: Shots
    worker: Worker
    is_double: ClassVar[bool] = True  # as the free flight behind the target

    @property
    def variables(self) -> tuple[Variable, ...]:
        """Those of the method, and those of cores that deform."""
        own = ENERGY_IMBALANCE, HOURGLASS_SHARE, ERODED_ELEMENTS, *PICTURE_VARIABLES
        return (*own, *FRAGMENT_VARIABLES) if self.method.core else own

    @cached_property
    def cost(self) -> MeshCost:
        """What the shots will take."""
        return self.method.estimate_cost(self.scene, self.shots)

    @property
    def threads(self) -> int:
        """Number of hits at a time on a CPU."""
        return min(self.worker.threads or cores(), len(self.shots))

    def build(self) -> None:
        """Compile and load the kernels."""
        device, variant = find_device(self.worker.device), Variant(double=self.method.double)
        many = () if device.is_cpu else built(march_many, variant).values()
        for kernel in many or [built(march_one, variant)]:
            load(kernel, device)
        load(self._memory.flight.kernel, self._memory.device)

    @cached_property
    def _memory(self) -> Memory:
        return memory_of(self.scene, self.shots, self.worker)

    def compute(self, progress: Progress | None = None) -> Outcomes:
        """Compute every shot with its pictures, on a GPU together, on a CPU one in each thread.

        A shot whose core leaves its mesh is computed again in a wider one, and a shot whose hourglasses take too much
        energy with less resistance against them.
        """
        hits, pictures, count, lock = dict[int, HitResult](), dict[int, Picture](), len(self.shots), Lock()
        device, conditions = find_device(self.worker.device), self._memory.prepared.conditions
        prepared = partial(self.method.prepare_hit, self.scene, self.shots, conditions=conditions, device=device.alias)

        def take(number: int, hit: HitResult, frames: Frames) -> None:
            picture = frames.picture(self.scene.core)
            with lock:
                hits[number], pictures[number] = hit, picture
                if progress:
                    progress(len(hits), count)

        def march(number: int, share: Worker) -> None:
            attempt: Attempt | None = FIRST
            while attempt:
                ready, frames = prepared(number, attempt=attempt), Frames()
                frames.take(ready)
                hit = ready.march(share.cancel, follow=frames.take)
                attempt = attempt.after(hit.status)
            take(number, hit, frames)

        if device.is_cpu:
            for _ in in_threads(march, count, replace(self.worker, threads=self.threads)):
                pass
        attempts, running = dict.fromkeys(set(range(count)) - hits.keys(), FIRST), defaultdict[int, Frames](Frames)
        while attempts:
            following, numbers = dict[int, Attempt](), list(attempts)
            ready = (prepared(number, attempt=attempt) for number, attempt in attempts.items())
            for place, hit in together(ready, self.worker.cancel, lambda place, hit: running[place].take(hit)):
                frames = running.pop(place)
                if again := attempts[numbers[place]].after(hit.status):
                    following[numbers[place]] = again
                else:
                    take(numbers[place], hit, frames)
            attempts = following
        columns = picture_columns([pictures[number] for number in range(count)])
        return outcomes_of(self._memory, [hits[number] for number in range(count)], self.worker).assign(**columns)
