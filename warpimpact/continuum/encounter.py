"""A core and the layers that it meets: how it begins, where their meshes lie, and what its march will take."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.continuum.meshing import Extent, SheetMesh, mesh_layer, nodes_of
from warpimpact.scene import Core, Plate, Scene, Shots
from warpimpact.scene.flow import Continuum
from warpimpact.scene.model import Array

FINE, PATCH, SWEPT = 2.5, 5.0, 1.0
"""Half of the fine part of a mesh, half of it all, and how far the ends of a turned core may sweep before both grow; in
radii of the core."""
WIDER = 1.0, 1.6, 2.5
"""By how much its meshes are wider, each time that a hit is computed again because its core came near their edge."""
SLOWEST = 0.1
"""Least share of its speed at which a core approaches a layer, for the place where it will cross it."""
STEP, PER_ELEMENT, NODE_NUMBERS, HOST_BYTES = 0.12, 6.0e-8, 55, 150
"""Usual step, in times of a wave across a fine element at rest; time of a core per element and step [s]; and memory of
a node: numbers of a march, and bytes while its mesh is made. Measured on holes of 5 mm at 0.5 and 0.2 mm."""


class Start(NamedTuple):
    """How the core of a hit begins: position from the hit [m], attitude, velocity [m/s], angular momentum [N m s]; its
    mass [kg] and moments of inertia [kg m²]; and the friction of its surface."""

    position: Array
    attitude: Array
    velocity: Array
    angular_momentum: Array
    mass: float
    inertia_axial: float
    inertia_transverse: float
    friction: float

    @property
    def arriving(self) -> tuple[Array, Array, Array]:
        """Position, velocity and axis."""
        return self.position, self.velocity, axis_of(self.attitude)


class Encounter(NamedTuple):
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

    @property
    def rear(self) -> float:
        """Its rear face [m]."""
        return self.front + self.plate.thickness

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
        return mesh_layer(self.plate, self.place, self.front, self.spacing, self.extents(position, velocity, axis))


def encounters_of(scene: Scene, shots: Shots, number: int, continuum: Continuum, wider: float = 1.0) -> list[Encounter]:
    """The layers that the core of one of the shots will meet."""
    core, target, shot = scene.core, scene.target, shots[number : number + 1]
    thickness, offset_y, offset_z = (
        [shot.layer_value(target, name, k).item() for k in range(len(target.layers))]
        for name in ("thickness", "offset_y", "offset_z")
    )
    fronts = target.fronts([np.array(value) for value in thickness])
    return [
        Encounter(
            core,
            layer.model_copy(update={"thickness": thickness[k]}),
            (shot.hit_y.item() - offset_y[k], shot.hit_z.item() - offset_z[k]),
            float(fronts[k]),
            spacing,
            wider,
        )
        for k, (layer, spacing) in enumerate(zip(target.layers, continuum.spacings(core, target), strict=True))
    ]


def line_of_flight(obliquity: float, azimuth: float) -> Array:
    """Unit vector along the line of fire."""
    across = math.sin(obliquity)
    return np.array([math.cos(obliquity), across * math.cos(azimuth), across * math.sin(azimuth)])


def axis_of(attitude: Any) -> Array:
    """The axis of a core, from its base to its nose."""
    x, y, z, w = (float(part) for part in attitude)
    return np.array([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)])


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
        nodes = sum(one.nodes(*start.arriving) for one in encounters)
        step = min(STEP * one.spacing / continuum.flow(k).wave_speed for k, one in enumerate(encounters))
        steps = (encounters[-1].rear + scene.core.length) / (step * max(float(start.velocity[0]), 1e-3))
        size = nodes * ((8 if continuum.double else 4) * NODE_NUMBERS + HOST_BYTES)
        costs.append(Cost(nodes, size, PER_ELEMENT * nodes * steps))
    return max(costs, key=lambda cost: cost.bytes)
