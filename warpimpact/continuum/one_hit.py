"""One hit: its meshes and its core in arrays of a device, its march on the CPU, and how it ended."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.continuum.fragments import CoreElements, Fragments
from warpimpact.continuum.meshing import WIDER, BodyMesh, Encounter, Part, runs_of, volumes_of
from warpimpact.kernels.continuum import choices, fields, march_one
from warpimpact.kernels.continuum.fields import (
    CELLS_ALONG,
    CORE,
    FACES_IN_CELL,
    FACES_OF_NODE,
    PART_OF_BULLET,
    PARTS,
    rigid,
)
from warpimpact.kernels.status import RUNNING, WAITING, Status
from warpimpact.kernels.variant import Variant
from warpimpact.scene import Core, MassProperties, Scene, Shots
from warpimpact.scene.bullet import Bullet
from warpimpact.scene.flow import Flow
from warpimpact.scene.model import Array
from warpimpact.scene.rigid import axis_of, axis_on_impact, energies, line_of_flight
from warpimpact.scene.target import BULGE
from warpimpact.solver.device import NEVER, PARSING, Cancel, find_device, load
from warpimpact.solver.memory import built
from warpimpact.solver.resolution import UNBREAKABLE
from warpimpact.solver.rings import sections_at
from warpimpact.solver.structs import filled

STATIONS = 2049
"""At which the radius of the core is tabulated."""
SLICES = 64
"""Of a core, whose loads bend it."""
STEPS = 100
"""Of a launch: between two of them a computation can be broken off."""
COMPONENTS = {
    **{"position": 3, "velocity": 3, "inverse_mass": 1, "impedance": 3, "radiated": 1, "contact": 3, "contact_work": 1},
    **{"near": 1, "volume": 1, "length": 1, "alive": 1, "leading": 1, "stress": 6, "strain": 1, "damage": 1, "heat": 1},
    **{"work": 1, "hourglass_work": 1, "crossing": 1, "force": 24},
}
"""Of the arrays of nodes and of elements of a mesh (kernels/continuum/fields.py)."""
NODE_NUMBERS = sum(COMPONENTS.values())
"""Of a march for each node, with its element."""
CONTACT_NODE_BYTES, CONTACT_BYTES = 4 * (FACES_OF_NODE + 39) + 32 + 88, 4 * CELLS_ALONG**3 * (FACES_IN_CELL + 1)
"""Of the contact between bodies, for each node: bounds of its faces, faces near it, normal and depth, push; and for
each body: cells."""
NEVER_FOLDS = 1.0e30
"""Plastic strain beyond any, for materials whose folded elements stay."""
PENALTY = 0.5
"""Share of the stiffness of an element that the contact has."""
MARGIN, FASTEST = 0.3, 1.5
"""How far a node may come nearer to a face before the faces enter the grid of the contact anew, in fine elements, and
how fast at most, in impact velocities."""
LARGEST_IMBALANCE, LARGEST_HOURGLASS_SHARE = 0.02, 0.12
"""Of the energy that the core lost: a hit beyond is a failure of the computation."""


class Start(NamedTuple):
    """How the core of a hit begins: position from the hit [m], attitude, velocity [m/s], angular momentum [N m s]; its
    mass and moments of inertia; the friction of its surface; and its strength [Pa], None if its bending is not
    recorded."""

    position: Array
    attitude: Array
    velocity: Array
    angular_momentum: Array
    body: MassProperties
    friction: float
    strength: float | None = None

    @property
    def arriving(self) -> tuple[Array, Array, Array]:
        """Position, velocity and axis."""
        return self.position, self.velocity, axis_of(self.attitude)


class Energies(NamedTuple):
    """Where the kinetic energy that core and bullet lost has gone [J].

    Attributes:
        lost: by the core.
        given: to the nodes, by the contact; with a core of elements, what of its loss the contact did not take.
        kinetic, work, hourglass: of the layers' nodes; of the stresses; of the resistance against hourglasses.
        radiated: through the outer edge.
        taken: kinetic energy that jacket and filler lost.
    """

    lost: float
    given: float
    kinetic: float
    work: float
    hourglass: float
    radiated: float = 0.0
    taken: float = 0.0

    @property
    def imbalance(self) -> float:
        """What is missing or too much, as a share of what was lost. A contact that gives energy counts, too."""
        spent = self.lost + self.taken
        if spent <= 0.0:
            return 0.0 if self.given == 0.0 else float("inf")
        missing = abs(self.given + self.taken - self.kinetic - self.work - self.hourglass - self.radiated)
        return (missing + max(0.0, self.given - self.lost)) / spent

    @property
    def hourglass_share(self) -> float:
        """Of what was lost."""
        spent = self.lost + self.taken
        return self.hourglass / spent if spent > 0.0 else 0.0


class FlyingBody(NamedTuple):
    """A body of the bullet: jacket and filler, or a core of elements.

    Attributes:
        mesh: where it is at the start.
        flows: its materials, by the numbers that the mesh has.
        kind: PART_OF_BULLET or CORE.
        ahead: how far it reaches beyond the tip of the core [m].
    """

    mesh: BodyMesh
    flows: Sequence[Flow]
    kind: int
    ahead: float = 0.0


class HitResult(NamedTuple):
    """What became of one hit.

    Attributes:
        status: code of `Status`.
        flight: state and clock of the core, a row of the kernels' Flight.
        touched: whether the core touched each layer.
        left: state with which it left each layer, shape [layers, 7]: velocity, axis, time.
        energies: where the energy has gone.
        eroded: elements of the layers that failed.
        fragments: of a core of elements; None of a rigid one.
    """

    status: Status
    flight: Any
    touched: NDArray[np.bool_]
    left: Array
    energies: Energies
    eroded: int
    fragments: Fragments | None = None


class OneHit:
    """A hit in memory. A layer has its mesh when the core is in front of it, where the core will cross it.

    Args:
        meshes: of the first layers, or of all.
        flows: materials of all layers.
        encounters: the layers behind, which have no mesh yet.
        hourglass: resistance against hourglasses, as HOURGLASS.
        contact_friction: between bodies but the core; by default, that of the core.
        bullet: its bodies; without a core among them, the core is rigid.

    Attributes:
        device: that its arrays are on; `advance` marches it on the CPU only.
        left: state with which the core left each layer, shape [layers, 7].
    """

    def __init__(
        self,
        core: Core,
        start: Start,
        meshes: Sequence[BodyMesh],
        flows: Sequence[Flow],
        double: bool = False,
        device: str = "cpu",
        encounters: Sequence[Encounter] = (),
        hourglass: float = choices.HOURGLASS.value,
        contact_friction: float | None = None,
        bullet: Sequence[FlyingBody] = (),
    ) -> None:
        self.device, self.variant, self.start = find_device(device), Variant(double=double), start
        self.kernel, self.struct = built(march_one, self.variant), built(fields, self.variant)
        if self.device.is_cpu:
            load(self.kernel, self.device)
        self.real, self.dtype = self.variant.real, np.dtype("f8" if double else "f4")
        deforms = CORE in [one.kind for one in bullet]
        self.flows, self.encounters = flows, list(encounters)
        self.hourglass = hourglass * (choices.DEFORMING_HOURGLASS.value if deforms else 1.0)
        self.meshes, self.firsts = list[BodyMesh](), list[int]()
        self._blocks, self._bodies = list[Any](), list[Any]()
        self._crowded = wp.zeros(1, dtype=wp.int32, device=self.device)
        self.mesh = self.struct.Mesh()
        self.inverse_mass, shortest = np.empty(0), math.inf
        self.bullet, self.ahead = bullet, max((one.ahead for one in bullet), default=0.0)
        self._faces = [mesh.ends for mesh in meshes] + [(layer.front, layer.rear) for layer in encounters]
        self.contact_friction = start.friction if contact_friction is None else contact_friction
        for one in bullet:
            shortest = min(shortest, self._append(one.mesh, one.flows, True, one.kind))
        for mesh in meshes:
            awake = self._group(self._layers)[0] < choices.FREE_WAY.value
            least = self._append(mesh, [flows[self._layers]], awake)
            shortest = min(shortest, least) if awake else shortest
        put = self._put
        kinds = [one.kind for one in bullet]
        radii = np.asarray(core.radius(np.linspace(0.0, core.length, STATIONS)))
        body = {name: value for name, value in start.body._asdict().items() if name != "centre_of_mass"}
        sizes = {"length": core.length, "centre_of_mass": core.mass_properties.centre_of_mass, "largest": radii.max()}
        sizes |= {"radii": put(radii, wp.float64), "friction": start.friction, "deforms": int(CORE in kinds)}
        slices = 0 if start.strength is None else SLICES
        sections = vars(sections_at(core, core.length * np.arange(1, slices + 1) / max(slices, 1)))
        parts = 1 if self.device.is_cpu else PARTS
        sizes |= {
            "sections": filled(rigid.Sections, **{name: put(column, wp.float64) for name, column in sections.items()}),
            "impulses": wp.zeros((parts, 6 * slices), dtype=wp.float64, device=self.device),
        }
        self.core = filled(fields.Core, body=filled(rigid.Body, **body), **sizes)
        self.left = put(np.full((len(meshes) + len(encounters), 7), np.nan), wp.float64)
        types = {"position": wp.vec3d, "attitude": wp.quatd, "velocity": wp.vec3d, "angular_momentum": wp.vec3d}
        state = filled(rigid.State, **{name: kind(*getattr(start, name)) for name, kind in types.items()})
        clock = dict.fromkeys(("step", "before"), 0.5 * choices.COURANT.value * shortest)
        clock |= {"first_touch": -1.0, "last_touch": -1.0, "sorted": -1.0}
        clock |= {"bending": filled(rigid.Bending, strength=UNBREAKABLE if slices == 0 else start.strength)}
        flight = filled(fields.Flight, state=state, status=RUNNING, **clock)
        self.flights = wp.array([flight], dtype=fields.Flight, device=self.device)
        rear = encounters[-1].rear if encounters else meshes[-1].ends[1]
        longest = 30.0 * (rear + core.length) / float(np.linalg.norm(start.velocity))
        unmeshed = encounters[0].front - self.ahead if encounters else math.inf
        self.limits = filled(fields.Limits, rear=rear, longest=longest, unmeshed=unmeshed)
        self._core: slice | None = None
        if CORE in kinds:
            self._core_body = kinds.index(CORE)
            own, first = self.meshes[self._core_body], self.firsts[self._core_body]
            self._core, self._parted = slice(first, first + own.nodes), 0
        self.limits.impact_energy = self.core_energy
        self.brought = self._kinetic(slice(0, self._first_of_layers))

    def extend(self) -> OneHit:
        """Give the next layer its mesh, and those that touch it, at rest; all else stays as it is, and the march can
        go on."""
        state, group = self._state, self._group(self._layers)
        while self.encounters and self._group(self._layers) == group:
            self._append(self.encounters.pop(0).mesh(*state), [self.flows[self._layers]], True)
        self.limits.unmeshed = self.encounters[0].front - self.ahead if self.encounters else math.inf
        with PARSING:
            flights = self.flights.numpy()
            flights["status"] = RUNNING
            flights["sorted"] = -1.0
            self.flights.assign(flights)
        return self

    def part(self) -> None:
        """Find the leading fragment of a core of elements, STEPS after the last time and at the end: so it does not
        depend on how many steps a launch has. Its motion is that of the core from then on."""
        flight = self.flight
        if not self._core or (flight["status"] == RUNNING and flight["steps"] - self._parted < STEPS):
            return
        self._parted, core = int(flight["steps"]), self._core_elements
        if (core.mass[~core.alive] > 0.0).any():
            leading = core.labels()[0] == 1
            self.mesh.leading[self._core].assign(leading.ravel().astype(self.dtype))

    @property
    def _core_elements(self) -> CoreElements:
        own, density = self.meshes[self._core_body], self.bullet[self._core_body].flows[0].density
        size, nodes = int(self.mesh.size), self._core
        alive = self.mesh.alive[nodes].numpy().reshape(own.present.shape) > 0.0
        along = self.start.velocity / np.linalg.norm(self.start.velocity)
        forward = np.zeros(own.present.shape)
        for k in range(3):
            of_component = self.mesh.velocity[k * size : (k + 1) * size][nodes].numpy()
            forward += along[k] * of_component.reshape(own.present.shape)
        for axis in range(3):
            forward = 0.5 * (forward + np.roll(forward, -1, axis))
        return CoreElements(np.asarray(alive), density * volumes_of(own)[0].reshape(own.present.shape), forward)

    @property
    def fragments(self) -> Fragments | None:
        """What is left of a core of elements; None of a rigid one."""
        if not self._core:
            return None
        core, own, start = self._core_elements, self.meshes[self._core_body], self.start
        middle = own.position.mean(axis=(2, 3)) - start.position[:, None]
        station = start.body.centre_of_mass - axis_of(start.attitude) @ middle
        energy, led = self._held_energy(core.alive), self._held_energy(core.labels()[0] == 1)
        return Fragments.of(core, station + 0.5 * np.gradient(station), energy, self.limits.impact_energy - led)

    def _held_energy(self, elements: NDArray[np.bool_]) -> float:
        """Kinetic energy of the nodes that some elements of the core hold [J]."""
        assert self._core
        held = self._masses(self.meshes[self._core_body], elements.ravel().astype(float)) > 0.0
        return self._kinetic(np.flatnonzero(held) + self._core.start)

    def _put(self, values: Any, dtype: Any) -> Any:
        return wp.array(np.ascontiguousarray(values), dtype=dtype, device=self.device)

    @property
    def _layers(self) -> int:
        """Number of layers that have a mesh."""
        return len(self.meshes) - len(self.bullet)

    @property
    def _first_of_layers(self) -> int:
        """Number of the first node that is none of the bullet."""
        last = len(self.bullet) - 1
        return self.firsts[last] + self.meshes[last].nodes if self.bullet else 0

    def _append(self, own: BodyMesh, flows: Sequence[Flow], awake: bool, kind: int = 0) -> float:
        """Add a layer at rest, or a body of the bullet as it flies. Returns the shortest time of a wave across an
        element of it [s]."""
        is_layer = kind >= 0
        pad, before = own.plane + own.row + 32, self.mesh
        old, number, present = int(before.size), len(self.meshes), own.present.ravel()
        size, first, near = 2 * pad + own.nodes, old + pad, not is_layer or own.ends[0] < choices.FREE_WAY.value
        volume, length = volumes_of(own)
        of_element = np.broadcast_to(own.material, own.present.shape).ravel()
        mass = self._masses(own, np.array([flow.density for flow in flows])[of_element] * volume)
        columns = {"position": own.position.reshape(3, -1), "alive": present, "near": near, "volume": volume}
        columns["leading"] = present
        columns |= {"inverse_mass": np.divide(1.0, mass, out=np.zeros(own.nodes), where=mass > 0.0)}
        if is_layer:
            upright, along = (
                flows[0].density * flows[0].wave_speed,
                math.sqrt(flows[0].density * flows[0].shear_modulus),
            )
            columns["impedance"] = np.array([[along, along], [upright, along], [along, upright]]) @ own.outer_faces
        else:
            columns["velocity"] = self._flying(own)
        self.mesh = mesh = self.struct.Mesh()
        mesh.size = old + size
        for name, count in COMPONENTS.items():
            values = np.full((count, size), 1.0 if name in ("length", "crossing") else 0.0)
            values[:, pad : pad + own.nodes] = columns.get(name, length if name == "length" else values[0, 0])
            if name == "inverse_mass":
                self.inverse_mass = np.concatenate([self.inverse_mass, values[0]])
            values = values.astype(self.dtype)
            if number:
                values = np.concatenate([getattr(before, name).numpy().reshape(-1, old), values], axis=1)
            setattr(mesh, name, self._put(values.ravel(), self.real))
        runs, node_runs, of_block = list[Any](), list[Any](), np.zeros(size, dtype=np.int32)
        for block, part in enumerate(own.parts, len(self._blocks)):
            runs += [(*run, block) for run in runs_of(present & part.held, first)]
            node_runs += [(*run, block) for run in runs_of((mass > 0.0) & part.held, first)]
            of_block[pad : pad + own.nodes][part.held] = block
            self._blocks.append(self._block(own, part, flows[part.material], number, kind))
        grown: dict[str, tuple[Any, list[Any]]] = {
            "runs": (wp.int32, runs),
            "node_runs": (wp.int32, node_runs),
            "awake": (wp.int32, [awake]),
            "touched": (wp.float64, [-1.0]),
        }
        for name, (dtype, more) in grown.items():
            there = getattr(before, name).numpy() if number else []
            setattr(mesh, name, self._put([*there, *np.ravel(more)], dtype))
        self.meshes.append(own)
        self.firsts.append(first)
        ends = {"layer": kind, "wakes": -math.inf, "sleeps": math.inf}
        if is_layer:
            wakes, sleeps = self._group(self._layers - 1)
            ends = {"layer": self._layers - 1, "rear": own.ends[1], "wakes": wakes - self.ahead, "sleeps": sleeps}
        friction = self.start.friction if kind == CORE else self.contact_friction
        self._bodies.append(filled(fields.Body, friction=friction, **ends))
        mesh.blocks = wp.array(self._blocks, dtype=self.struct.Block, device=self.device)
        mesh.bodies = wp.array(self._bodies, dtype=fields.Body, device=self.device)
        mesh.cylinder, mesh.kick = before.cylinder, before.kick
        mesh.block = self._put(np.concatenate([before.block.numpy() if number else [], of_block]), wp.int32)
        mesh.contacts = self._contacts() if len(self.meshes) > 1 else fields.Contacts()
        speeds = np.array([flow.wave_speed for flow in flows])[of_element[present]]
        return float((length[present].astype(self.dtype) / speeds).min())

    def _flying(self, own: BodyMesh) -> Array:
        """Velocities of a body of the bullet, which moves as its core [m/s], shape [3, nodes]."""
        start, along = self.start, axis_of(self.start.attitude)
        spin = float(start.angular_momentum @ along) / start.body.inertia_axial
        away = own.position.reshape(3, -1) - start.position[:, None]
        return np.asarray(start.velocity[:, None] + spin * np.cross(along, away, axis=0))

    def _block(self, own: BodyMesh, part: Part, flow: Flow, body: int, kind: int) -> Any:
        """A part of a body as the kernels have it."""
        is_soft = kind == PART_OF_BULLET  # brass and lead, in between core and plate
        sizes = {"spacing": own.spacing, "stiffness": PENALTY * flow.wave_modulus * own.spacing}
        sizes |= {"finest": 0.0 if is_soft else own.spacing, "debris": int(is_soft)}
        folds = choices.FOLDED_CORE_STRAIN if kind == CORE else choices.FOLDED_STRAIN
        sizes["folding"] = folds.value if kind < 0 or flow.density < choices.LIGHT.value else NEVER_FOLDS
        strides = {"row": own.row, "plane": part.plane, "plane_before": part.plane_before}
        material = filled(self.struct.Material, **flow.constants)
        sizes["hourglass"] = self.hourglass * (choices.CORE_HOURGLASS.value if kind == CORE else 1.0)
        return filled(self.struct.Block, body=body, material=material, **sizes, **strides)

    def _group(self, layer: int) -> tuple[float, float]:
        """Front and rear face of a layer with those near it, which it touches when it bulges [m]: they have their
        meshes, wake and sleep together."""
        first, last, faces = layer, layer, self._faces
        while first > 0 and faces[first][0] - faces[first - 1][1] < BULGE:
            first -= 1
        while last < len(faces) - 1 and faces[last + 1][0] - faces[last][1] < BULGE:
            last += 1
        return faces[first][0], faces[last][1]

    def _contacts(self) -> Any:
        """The contact between its bodies, before any face is in the grid."""
        spacings, size, empty = (
            [mesh.spacing for mesh in self.meshes],
            int(self.mesh.size),
            partial(wp.zeros, device=self.device),
        )
        margin, deepest = MARGIN * min(spacings), choices.DEEPEST.value * max(spacings)
        numbers = {"exposed": size, "near": size, "faces": FACES_OF_NODE * size, "pushing": PARTS}
        cells = CELLS_ALONG**3 * len(self.meshes)
        numbers |= {"counts": cells, "cells": cells * FACES_IN_CELL}
        return filled(
            fields.Contacts,
            cell=1.4 * max(spacings),
            margin=margin,
            reach=deepest + margin,
            interval=margin / (FASTEST * float(np.linalg.norm(self.start.velocity))),
            boxes=empty(6 * len(self.meshes), dtype=wp.float64),
            normals=empty(3 * size, dtype=wp.float64),
            depths=empty(size, dtype=wp.float64),
            pushes=empty(size + PARTS, dtype=fields.Push),
            crowded=self._crowded,
            bounds=empty(36 * size, dtype=wp.float32),
            **{name: empty(count, dtype=wp.int32) for name, count in numbers.items()},
        )

    @staticmethod
    def _masses(own: BodyMesh, masses: Array) -> Array:
        """Masses of the nodes [kg]: an eighth of each element about them, in the order of the corners."""
        total = np.zeros(own.nodes + own.plane + own.row + 1)
        for corner in (0, 1):
            for offset in (0, own.row, own.plane, own.row + own.plane):
                at = corner + offset
                total[at : at + own.nodes] += 0.125 * masses
        beyond = total[own.nodes :]  # of a ring, the first plane; of others, there is none
        total[: len(beyond)] += beyond
        return total[: own.nodes]

    @property
    def bytes(self) -> int:
        """That its mesh takes with those to come."""
        later = sum(layer.nodes(*self._state) for layer in self.encounters)
        nodes, bodies = int(self.mesh.size) + later, len(self.meshes) + len(self.encounters)
        own = NODE_NUMBERS * self.dtype.itemsize + (bodies > 1) * CONTACT_NODE_BYTES
        return int(own * nodes + (bodies > 1) * bodies * CONTACT_BYTES)

    @property
    def flight(self) -> Any:
        """How far the hit is (kernels/continuum/fields.py), as a row of numpy."""
        with PARSING:
            return self.flights.numpy()[0]

    @property
    def _state(self) -> tuple[Array, Array, Array]:
        """Position, velocity and axis of the core."""
        state = self.flight["state"]
        return state["position"], state["velocity"], axis_of(state["attitude"])

    def advance(self, steps: int = STEPS) -> None:
        """March by some steps."""
        inputs, outputs = [self.core, self.limits, steps, self.mesh], [self.flights, self.left]
        wp.launch(self.kernel, 1, inputs=inputs, outputs=outputs, device=self.device)

    def march(
        self, cancel: Cancel = NEVER, *, every: int = STEPS, follow: Callable[[OneHit], object] = lambda hit: None
    ) -> HitResult:
        """March to the end; `follow` is called at regular numbers of steps."""
        while True:
            edge = np.flatnonzero(self.mesh.impedance.numpy().reshape(3, -1).any(axis=0))
            while self.flight["status"] == RUNNING:
                cancel.check()
                self.advance(every)
                self.part()
                follow(self)
                if self.mesh.near.numpy()[edge].any():
                    return self.result(at_edge=True)
            if self.flight["status"] != WAITING:
                return self.result(at_edge=False)
            self.extend()

    def result(self, at_edge: bool) -> HitResult:
        """What became of the hit, which has ended, or whose core is near the outer edge of a mesh."""
        flight, energies, status = self.flight, self.energies, Status.LEFT_WINDOW
        if not at_edge:
            ended = Status.CROWDED if self._crowded.numpy()[0] else Status(int(flight["status"]))
            status = status_by_energies(ended, energies)
        first = self._first_of_layers
        layers = sum(int(mesh.present.sum()) for mesh in self.meshes[len(self.meshes) - self._layers :])
        eroded = layers - int((self.mesh.alive.numpy()[first:] > 0.0).sum())
        return HitResult(status, flight, self.touched, self.left.numpy(), energies, eroded, self.fragments)

    @property
    def touched(self) -> NDArray[np.bool_]:
        """Whether the core touched each layer."""
        touched = self.mesh.touched.numpy()[len(self.meshes) - self._layers :]
        return np.array([*(touched >= 0.0), *[False] * len(self.encounters)])

    @property
    def core_energy(self) -> float:
        """Kinetic energy of the core, or of its nodes [J]."""
        if self._core:
            return self._kinetic(self._core)
        state, body = self.flight["state"], self.start.body
        axis = axis_of(state["attitude"])
        momentum, velocity = np.array(state["angular_momentum"]), np.array(state["velocity"])
        along = float(momentum @ axis)
        across = float(momentum @ momentum) - along**2
        return float(sum(energies(body, float(velocity @ velocity), along, max(0.0, across))))

    @property
    def energies(self) -> Energies:
        """Where the energy has gone so far."""
        mesh, first = self.mesh, self._first_of_layers
        given, work, hourglass, radiated = (
            float(values.numpy().astype(np.float64).sum())
            for values in (mesh.contact_work, mesh.work, mesh.hourglass_work, mesh.radiated)
        )
        kinetic, taken = self._kinetic(slice(first, None)), self.brought - self._kinetic(slice(0, first))
        lost = self.limits.impact_energy - self.core_energy
        if self._core:
            given, taken = lost + given, taken - lost
        return Energies(lost, given, kinetic, work, hourglass, radiated, taken)

    def _kinetic(self, nodes: slice | NDArray[np.intp]) -> float:
        """Kinetic energy of some nodes [J]."""
        velocity = self.mesh.velocity.numpy().astype(np.float64).reshape(3, -1)[:, nodes]
        inverse = self.inverse_mass[nodes]
        mass = np.divide(1.0, inverse, out=np.zeros(len(inverse)), where=inverse > 0.0)
        return 0.5 * float((mass * (velocity**2).sum(axis=0)).sum())


class Attempt(NamedTuple):
    """How a hit is marched.

    Attributes:
        wider: by how much its meshes are wider, one of WIDER.
        hourglass: resistance against hourglasses, as HOURGLASS.
    """

    wider: float = WIDER[0]
    hourglass: float = choices.HOURGLASS.value

    def after(self, status: Status) -> Attempt | None:
        """The attempt that follows on one that ended so; None where it counts."""
        if status is Status.LEFT_WINDOW and self.wider < WIDER[-1]:
            return self._replace(wider=WIDER[WIDER.index(self.wider) + 1])
        if status is Status.HOURGLASSED and self.hourglass == FIRST.hourglass:
            return self._replace(hourglass=choices.SECOND_HOURGLASS.value * self.hourglass)
        return None


FIRST = Attempt()


def status_by_energies(status: Status, energies: Energies) -> Status:
    """The status of a hit, by its energies, too."""
    if status.failed or status is Status.UNTOUCHED or energies.lost <= 0.0:
        return status
    if not energies.imbalance <= LARGEST_IMBALANCE:
        return Status.UNBALANCED
    return status if energies.hourglass_share <= LARGEST_HOURGLASS_SHARE else Status.HOURGLASSED


def start_of(
    scene: Scene,
    shots: Shots,
    number: int,
    friction: float,
    conditions: dict[str, NDArray[Any]],
    bullet: Bullet | None = None,
) -> Start:
    """How the core of a shot begins: its foremost point, or that of its bullet, at the front face, as
    kernels/target.py has it."""
    core, body = scene.core, scene.core.mass_properties._asdict()

    def own(name: str) -> float:
        return float(np.resize(conditions[name] if name in conditions else getattr(shots, name), len(shots))[number])

    body |= {name: own(name) for name in ("mass", "inertia_axial", "inertia_transverse") if name in conditions}
    obliquity, azimuth, pitch, yaw = (own(name) for name in ("obliquity", "azimuth", "pitch", "yaw"))
    flight = line_of_flight(obliquity, azimuth)
    axis = axis_on_impact(flight, pitch, yaw)
    attitude = np.array([0.0, -axis[2], axis[1], 1.0 + axis[0]])
    stations = np.linspace(0.0, core.length, 1001)
    ahead, radii = core.mass_properties.centre_of_mass - stations, core.radius(stations)
    if bullet:
        stations = np.linspace(0.0, bullet.length(core), 1001)
        ahead = core.mass_properties.centre_of_mass + bullet.core_place - stations
        radii = bullet.outline(stations)
    foremost = float((ahead * axis[0] + radii * math.sqrt(max(0.0, 1.0 - axis[0] ** 2))).max())
    return Start(
        position=-foremost / flight[0] * flight,
        attitude=attitude / np.linalg.norm(attitude),
        velocity=own("velocity") * flight,
        angular_momentum=body["inertia_axial"] * own("spin") * axis,
        body=MassProperties(**body),
        friction=friction,
        strength=own("strength") if scene.record.bending and "strength" in conditions else None,
    )
