"""One core and the layers that it meets: where their meshes lie, its march, and what became of it."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.continuum.meshing import Extent, SheetMesh, meshed, nodes_of
from warpimpact.continuum.one_hit import NODE_NUMBERS, STEPS, Energies, OneHit, Start, Unmeshed, axis_of
from warpimpact.kernels.status import RUNNING, WAITING, Status
from warpimpact.scene import Core, Plate, Scene, Shots
from warpimpact.scene.flow import Continuum
from warpimpact.scene.model import Array
from warpimpact.solver.worker import NEVER, Cancel

FINE, PATCH, SWEPT = 2.5, 5.0, 1.0
"""Half of the fine part of a mesh, half of it all, and how far the ends of a turned core may sweep before both grow; in
radii of the core."""
WIDER = 1.0, 1.6, 2.5
"""By how much its meshes are wider, each time that a hit is computed again because its core came near their edge."""
SLOWEST = 0.1
"""Least share of its speed at which a core approaches a layer, for the place where it will cross it."""
STEP, PER_ELEMENT, HOST_BYTES = 0.12, 6.0e-8, 150
"""Usual step, in times of a wave across a fine element at rest; time of a core per element and step [s]; and memory of
a node while its mesh is made, beside the arrays of the march [bytes]. Measured on holes of 5 mm at 0.5 and 0.2 mm."""
LARGEST_IMBALANCE, LARGEST_HOURGLASS_SHARE = 0.02, 0.12
"""Of the energy that the core lost: a hit beyond is a failure of the computation."""


@dataclass(frozen=True)
class HitResult:
    """What became of one hit.

    Attributes:
        status: code of `Status`.
        flight: state and clock of the core, a row of the kernels' Flight.
        touched: whether the core touched each layer.
        left: state with which it left each layer, shape [layers, 7]: velocity, axis, time.
        energies: where the energy has gone.
        eroded: elements that failed.
    """

    status: Status
    flight: Any
    touched: NDArray[np.bool_]
    left: Array
    energies: Energies
    eroded: int


@dataclass(frozen=True)
class Encounter:
    """A layer and a core that it will meet.

    Attributes:
        core: the core.
        plate: the layer, with the thickness that it has for this shot.
        place: where the line of fire crosses the front face of the target, in the frame of the layer's pattern [m].
        front: its front face [m].
        spacing: of its fine elements [m].
        wider: one of WIDER.
    """

    core: Core
    plate: Plate
    place: tuple[float, float]
    front: float
    spacing: float
    wider: float

    def extents(self, position: Array, velocity: Array, axis: Array) -> tuple[Extent, Extent]:
        """What the mesh covers along y and z: where a core of this state will cross the layer, and about it."""
        speed = max(float(velocity[0]), SLOWEST * float(np.linalg.norm(velocity)))
        nose = self.core.mass_properties.centre_of_mass
        arm, radius, thickness = max(nose, self.core.length - nose), self.core.max_radius, self.plate.thickness
        extents = []
        for along in (1, 2):
            drift = float(velocity[along]) / speed
            crossing = float(position[along]) + drift * (self.front - float(position[0]))
            way, swept = 0.5 * abs(drift) * thickness, arm * abs(float(axis[along]) - drift * float(axis[0]))
            more = way + max(0.0, swept - SWEPT * radius)
            fine, half = (self.wider * (share * radius + more) for share in (FINE, PATCH))
            extents.append(Extent(crossing + 0.5 * drift * thickness, fine, half))
        return extents[0], extents[1]

    def nodes(self, position: Array, velocity: Array, axis: Array) -> int:
        """Nodes of that mesh, about as many as elements."""
        return nodes_of(self.plate.thickness, self.spacing, self.extents(position, velocity, axis))

    def mesh(self, position: Array, velocity: Array, axis: Array) -> SheetMesh:
        """The mesh about the place where a core of this state will cross the layer."""
        return meshed(self.plate, self.place, self.front, self.spacing, self.extents(position, velocity, axis))


class March:
    """One hit, ready to march. A layer has its mesh when the core is in front of it, where the core will cross it."""

    def __init__(self, hit: OneHit, encounters: Sequence[Encounter]) -> None:
        self.hit, self._encounters = hit, list(encounters)
        self._edge = self._at_edge()

    def _at_edge(self) -> NDArray[np.intp]:
        """Numbers of the nodes at the outer edges."""
        edges = [np.flatnonzero(sheet.outer_faces.any(axis=0)) for sheet in self.hit.sheets]
        return np.concatenate([at + edge for at, edge in zip(self.hit.firsts, edges, strict=True)])

    def extended(self) -> OneHit:
        """The hit, whose next layer has its mesh now."""
        state = self.hit.flight["state"]
        mesh = self._encounters.pop(0).mesh(state["position"], state["velocity"], axis_of(state["attitude"]))
        self.hit.extend(mesh)
        self._edge = self._at_edge()
        return self.hit

    def ended(
        self, cancel: Cancel = NEVER, *, every: int = STEPS, follow: Callable[[OneHit], object] = lambda hit: None
    ) -> HitResult:
        """March to the end; `follow` is called at regular numbers of steps."""
        while True:
            while self.hit.flight["status"] == RUNNING:
                cancel.check()
                self.hit.advance(every)
                follow(self.hit)
                if self.hit.mesh.near.numpy()[self._edge].any():
                    return self.result(at_edge=True)
            if self.hit.flight["status"] != WAITING:
                return self.result(at_edge=False)
            self.extended()

    def result(self, at_edge: bool) -> HitResult:
        """What became of the hit, which has ended, or whose core is near the outer edge of a mesh."""
        flight, energies = self.hit.flight, self.hit.energies
        status = Status.LEFT_WINDOW if at_edge else status_by_energies(Status(int(flight["status"])), energies)
        alive = self.hit.mesh.alive.numpy()
        eroded = sum(int(sheet.alive.sum()) for sheet in self.hit.sheets) - int((alive > 0.0).sum())
        return HitResult(status, flight, self.hit.touched, self.hit.left.numpy(), energies, eroded)


def status_by_energies(status: Status, energies: Energies) -> Status:
    """The status of a hit, by its energies, too."""
    if status.failed or energies.lost <= 0.0:
        return status
    if not energies.imbalance <= LARGEST_IMBALANCE:
        return Status.UNBALANCED
    return status if energies.hourglass_share <= LARGEST_HOURGLASS_SHARE else Status.HOURGLASSED


def march_of(
    scene: Scene,
    shots: Shots,
    number: int,
    continuum: Continuum,
    conditions: dict[str, NDArray[Any]],
    device: str = "cpu",
    wider: float = 1.0,
) -> March:
    """The march of one of the shots.

    Args:
        conditions: as `prepare` has them.
        device: that has its arrays.
        wider: one of WIDER.
    """
    start = start_of(scene, shots, number, continuum.friction, conditions)
    first, *later = encounters_of(scene, shots, number, continuum, wider)
    arriving = start.position, start.velocity, axis_of(start.attitude)
    unmeshed = [Unmeshed(one.front, one.front + one.plate.thickness, one.nodes(*arriving)) for one in later]
    flows = [continuum.flow(k) for k in range(1 + len(later))]
    hit = OneHit(scene.core, start, [first.mesh(*arriving)], flows, continuum.double, device, unmeshed)
    return March(hit, later)


def encounters_of(scene: Scene, shots: Shots, number: int, continuum: Continuum, wider: float = 1.0) -> list[Encounter]:
    """The layers that the core of one of the shots will meet."""
    core, target = scene.core, scene.target
    own = {
        name: [
            float(np.resize(shots.layer_value(target, name, k), len(shots))[number]) for k in range(len(target.layers))
        ]
        for name in ("thickness", "offset_y", "offset_z")
    }
    fronts = target.fronts([np.array(value) for value in own["thickness"]])
    home = float(shots.hit_y[number]), float(shots.hit_z[number])
    return [
        Encounter(
            core,
            layer.model_copy(update={"thickness": own["thickness"][k]}),
            (home[0] - own["offset_y"][k], home[1] - own["offset_z"][k]),
            float(fronts[k]),
            spacing,
            wider,
        )
        for k, (layer, spacing) in enumerate(zip(target.layers, continuum.spacings(core, target), strict=True))
    ]


class Cost(NamedTuple):
    """What the most expensive of some hits takes: elements, memory [bytes], and time of a core [s]."""

    elements: int
    bytes: int
    seconds: float


def cost_of(scene: Scene, shots: Shots, continuum: Continuum) -> Cost:
    """The cost of the most expensive shot, by a passage that nothing slows down. Nothing is meshed."""
    body = scene.core.mass_properties
    conditions = {name: np.array([value]) for name, value in body._asdict().items()}
    costs = []
    for number in range(len(shots)):
        start = start_of(scene, shots, number, continuum.friction, conditions)
        encounters = encounters_of(scene, shots, number, continuum)
        nodes = sum(one.nodes(start.position, start.velocity, axis_of(start.attitude)) for one in encounters)
        step = min(STEP * one.spacing / continuum.flow(k).wave_speed for k, one in enumerate(encounters))
        way = encounters[-1].front + encounters[-1].plate.thickness + scene.core.length
        steps = way / (step * max(float(start.velocity[0]), 1e-3))
        size = nodes * ((8 if continuum.double else 4) * NODE_NUMBERS + HOST_BYTES)
        costs.append(Cost(nodes, size, PER_ELEMENT * nodes * steps))
    return max(costs, key=lambda cost: cost.bytes)


def line_of_flight(obliquity: float, azimuth: float) -> Array:
    """Unit vector along the line of fire."""
    across = math.sin(obliquity)
    return np.array([math.cos(obliquity), across * math.cos(azimuth), across * math.sin(azimuth)])


def start_of(scene: Scene, shots: Shots, number: int, friction: float, conditions: dict[str, NDArray[Any]]) -> Start:
    """How the core of a shot begins: its foremost point at the front face, as kernels/shots.py has it."""
    core = scene.core
    names = "mass", "inertia_axial", "inertia_transverse", "velocity", "obliquity", "azimuth", "pitch", "yaw", "spin"
    mass, axial, transverse, velocity, obliquity, azimuth, pitch, yaw, spin = (
        float(np.resize(conditions[name] if name in conditions else getattr(shots, name), len(shots))[number])
        for name in names
    )
    flight = line_of_flight(obliquity, azimuth)
    turned = math.atan2(flight[1], flight[0]) + yaw, math.atan2(flight[2], flight[0]) + pitch
    axis = np.array([1.0, math.tan(turned[0]), math.tan(turned[1])])
    axis /= np.linalg.norm(axis)
    attitude = np.array([0.0, -axis[2], axis[1], 1.0 + axis[0]])
    stations = np.linspace(0.0, core.length, 1001)
    ahead = core.mass_properties.centre_of_mass - stations
    foremost = float((ahead * axis[0] + core.radius(stations) * math.sqrt(max(0.0, 1.0 - axis[0] ** 2))).max())
    return Start(
        position=-foremost / flight[0] * flight,
        attitude=attitude / np.linalg.norm(attitude),
        velocity=velocity * flight,
        angular_momentum=axial * spin * axis,
        mass=mass,
        inertia_axial=axial,
        inertia_transverse=transverse,
        friction=friction,
    )
