"""One hit: its mesh and its core in arrays of a device, its march on the CPU, and what it took from whom."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.continuum.meshing import SheetMesh, runs_of, volumes_of
from warpimpact.kernels.continuum import choices, fields, march_one
from warpimpact.kernels.status import RUNNING
from warpimpact.kernels.variant import Variant
from warpimpact.scene import Core
from warpimpact.scene.flow import Flow
from warpimpact.scene.model import Array
from warpimpact.solver.device import find_device, load
from warpimpact.solver.memory import built

STATIONS = 2049
"""At which the radius of the core is tabulated."""
STEPS = 100
"""Of a launch: between two of them a computation can be broken off."""
NODE_NUMBERS = 55
"""Numbers of a march for each node, with its element."""
PENALTY = 0.5
"""Share of the stiffness of an element that the contact has."""
FROM_ZERO = {
    **{"velocity": 3, "contact": 3, "contact_work": 1, "stress": 6, "strain": 1, "damage": 1, "heat": 1},
    **{"work": 1, "hourglass_work": 1, "radiated": 1, "force": fields.COMPONENTS},
}
"""Components of the arrays of a mesh that are 0 before a march."""


@dataclass(frozen=True)
class Start:
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


class Unmeshed(NamedTuple):
    """A layer that has no mesh yet: its front and rear face [m], and about as many nodes as its mesh will have."""

    front: float
    rear: float
    nodes: int


@dataclass(frozen=True)
class Energies:
    """Where the kinetic energy that the core lost has gone [J].

    Attributes:
        lost: by the core.
        given: to the nodes, by the contact.
        kinetic, work, hourglass: of the nodes; of the stresses; of the resistance against hourglasses.
        radiated: through the outer edge.
    """

    lost: float
    given: float
    kinetic: float
    work: float
    hourglass: float
    radiated: float = 0.0

    @property
    def imbalance(self) -> float:
        """What is missing or too much, as a share of what was lost. A contact that gives energy counts, too."""
        if self.lost <= 0.0:
            return 0.0 if self.given == 0.0 else float("inf")
        missing = abs(self.given - self.kinetic - self.work - self.hourglass - self.radiated)
        return (missing + max(0.0, self.given - self.lost)) / self.lost

    @property
    def hourglass_share(self) -> float:
        """Of what was lost."""
        return self.hourglass / self.lost if self.lost > 0.0 else 0.0


class OneHit:
    """A hit in memory. A layer may have its mesh later, where the core will meet it (`extend`).

    Args:
        sheets: meshes of the first layers, or of all.
        flows: materials of all layers.
        unmeshed: the layers behind them, which have no mesh yet.

    Attributes:
        device: that its arrays are on; `advance` marches it on the CPU only.
        flight: how far it is (kernels/continuum/fields.py).
        left: state with which the core left each layer, shape [layers, 7].
    """

    def __init__(
        self,
        core: Core,
        start: Start,
        sheets: list[SheetMesh],
        flows: list[Flow],
        double: bool = False,
        device: str = "cpu",
        unmeshed: Sequence[Unmeshed] = (),
    ) -> None:
        self.device, self.variant = find_device(device), Variant(double=double)
        self.stage = built(march_one, self.variant)
        self.struct = self.stage.struct
        if self.device.is_cpu:
            load(self.stage.kernel, self.device)
        self.real, self.dtype = self.variant.real, np.dtype("f8" if double else "f4")
        self.sheets, self.flows, self.unmeshed = sheets, flows, list(unmeshed)
        self.speed = float(np.linalg.norm(start.velocity))
        self.mesh = self._mesh()
        self.core = self._core(core, start)
        self.limits, rear = self.struct.Limits(), max([*(layer.rear for layer in unmeshed), float(sheets[-1].x[-1])])
        self.limits.rear, self.limits.longest = rear, 30.0 * (rear + core.length) / self.speed
        self.limits.unmeshed = unmeshed[0].front if unmeshed else math.inf
        self.left = self._put(np.full((len(sheets) + len(unmeshed), 7), np.nan), wp.float64)
        self.flights = self._flights(start)
        self.limits.impact_energy = self.core_energy

    def extend(self, sheet: SheetMesh) -> None:
        """Give the next layer its mesh, at rest; all else stays as it is, and the march can go on."""
        before, self.sheets = self.mesh, [*self.sheets, sheet]
        self.mesh = mesh = self._mesh()
        for name in (*FROM_ZERO, "position", "near", "alive", "crossing"):  # what a march changes
            values = getattr(mesh, name).numpy().reshape(-1, mesh.size)
            values[:, : before.size] = getattr(before, name).numpy().reshape(-1, before.size)
            getattr(mesh, name).assign(values.ravel())
        mesh.awake = self._put([*before.awake.numpy(), 1], wp.int32)
        mesh.touched = self._put([*before.touched.numpy(), -1.0], wp.float64)
        mesh.cylinder, mesh.kick = before.cylinder, before.kick
        del self.unmeshed[0]
        self.limits.unmeshed = self.unmeshed[0].front if self.unmeshed else math.inf
        flights = self.flights.numpy()
        flights["status"] = RUNNING
        self.flights.assign(flights)

    def _put(self, values: Any, dtype: Any) -> Any:
        return wp.array(np.ascontiguousarray(values), dtype=dtype, device=self.device)

    def _mesh(self) -> Any:
        mesh, first, firsts = self.struct.Mesh(), 0, []
        for sheet in self.sheets:
            pad = sheet.plane + sheet.row + 32
            firsts.append(first + pad)
            first += 2 * pad + sheet.nodes
        self.firsts = firsts
        size = mesh.size = first
        position, impedance = np.zeros((2, 3, size))
        inverse_mass, alive, near, volume = (np.zeros(size) for _ in range(4))
        length, runs, node_runs = np.ones(size), [], []
        awake = [sheet.x[0] < choices.BEHIND.value for sheet in self.sheets]
        for k, (sheet, at, flow) in enumerate(zip(self.sheets, firsts, self.flows, strict=False)):
            inside = slice(at, at + sheet.nodes)
            position[:, inside], present = sheet.positions, sheet.alive
            alive[inside], near[inside] = present, awake[k]
            volume[inside], length[inside] = volumes_of(sheet)
            mass = np.zeros(size)
            for corner in (0, 1):
                for offset in (0, sheet.row, sheet.plane, sheet.row + sheet.plane):
                    mass[at + corner + offset : at + corner + offset + sheet.nodes] += (
                        0.125 * flow.density * volume[inside] * present
                    )
            inverse_mass[inside] = np.divide(1.0, mass[inside], out=np.zeros(sheet.nodes), where=mass[inside] > 0.0)
            upright, along = flow.density * flow.wave_speed, math.sqrt(flow.density * flow.shear_modulus)
            impedance[:, inside] = np.array([[along, along], [upright, along], [along, upright]]) @ sheet.outer_faces
            runs += [(*run, k) for run in runs_of(present, at)]
            node_runs += [(*run, k) for run in runs_of(mass[inside] > 0.0, at)]
        self.inverse_mass = inverse_mass
        mesh.sheets = wp.array(
            [self._sheet(sheet, flow) for sheet, flow in zip(self.sheets, self.flows, strict=False)],
            dtype=self.struct.Sheet,
            device=self.device,
        )
        mesh.runs, mesh.node_runs = self._put(np.ravel(runs), wp.int32), self._put(np.ravel(node_runs), wp.int32)
        given = {"position": position, "inverse_mass": inverse_mass, "alive": alive, "volume": volume, "length": length}
        given |= {"impedance": impedance, "near": near}
        for name, values in given.items():
            setattr(mesh, name, self._put(values.ravel().astype(self.dtype), self.real))
        for name, count in FROM_ZERO.items():
            setattr(mesh, name, wp.zeros(count * size, dtype=self.real, device=self.device))
        mesh.awake, mesh.touched = self._put(awake, wp.int32), self._put(np.full(len(awake), -1.0), wp.float64)
        mesh.crossing = wp.full(size, 1.0, dtype=self.real, device=self.device)
        return mesh

    def _sheet(self, sheet: SheetMesh, flow: Flow) -> Any:
        filled = self.struct.Sheet()
        filled.row, filled.plane = sheet.row, sheet.plane
        filled.front, filled.rear = float(sheet.x[0]), float(sheet.x[-1])
        filled.stiffness = PENALTY * flow.wave_modulus * sheet.spacing
        for name, value in flow.constants.items():
            setattr(filled, name, value)
        return filled

    def _core(self, core: Core, start: Start) -> Any:
        filled = self.struct.Core()
        filled.length, filled.centre_of_mass = core.length, core.mass_properties.centre_of_mass
        radii = np.asarray(core.radius(np.linspace(0.0, core.length, STATIONS)))
        filled.largest, filled.radii = float(radii.max()), self._put(radii, wp.float64)
        filled.friction = start.friction
        body = self.struct.rigid.Body()
        for name in ("mass", "inertia_axial", "inertia_transverse"):
            setattr(body, name, getattr(start, name))
        filled.body = body
        self.start = start
        return filled

    def _flights(self, start: Start) -> Any:
        state = self.struct.rigid.State()
        state.position, state.velocity = wp.vec3d(*start.position), wp.vec3d(*start.velocity)
        state.attitude, state.angular_momentum = wp.quatd(*start.attitude), wp.vec3d(*start.angular_momentum)
        flight = self.struct.Flight()
        flight.state, flight.first_touch, flight.last_touch, flight.status = state, -1.0, -1.0, RUNNING
        shortest = min(
            float((self.mesh.length.numpy()[at : at + sheet.nodes][sheet.alive]).min()) / flow.wave_speed
            for sheet, at, flow, awake in zip(
                self.sheets, self.firsts, self.flows, self.mesh.awake.numpy(), strict=False
            )
            if awake
        )
        flight.step = flight.before = 0.5 * choices.COURANT.value * shortest
        return wp.array([flight], dtype=self.struct.Flight, device=self.device)

    @property
    def bytes(self) -> int:
        """That its mesh takes with those to come."""
        return NODE_NUMBERS * self.dtype.itemsize * (int(self.mesh.size) + sum(layer.nodes for layer in self.unmeshed))

    @property
    def flight(self) -> Any:
        """How far the hit is, as a row of numpy."""
        return self.flights.numpy()[0]

    def advance(self, steps: int = STEPS) -> None:
        """March by some steps."""
        wp.launch(
            self.stage.kernel,
            1,
            inputs=[self.core, self.limits, steps, self.mesh],
            outputs=[self.flights, self.left],
            device=self.device,
        )

    @property
    def touched(self) -> NDArray[np.bool_]:
        """Whether the core touched each layer."""
        work, parts = self.mesh.contact_work.numpy(), zip(self.sheets, self.firsts, strict=True)
        return np.array([*(work[at : at + sheet.nodes].any() for sheet, at in parts), *[False] * len(self.unmeshed)])

    @property
    def core_energy(self) -> float:
        """Of the core's translation and rotation [J]."""
        state, start = self.flight["state"], self.start
        axis = axis_of(state["attitude"])
        momentum, velocity = np.array(state["angular_momentum"]), np.array(state["velocity"])
        along = float(momentum @ axis)
        across = float(momentum @ momentum) - along**2
        spin = along**2 / start.inertia_axial + max(0.0, across) / start.inertia_transverse
        return 0.5 * (start.mass * float(velocity @ velocity) + spin)

    @property
    def energies(self) -> Energies:
        """Where the energy has gone so far."""
        mesh, size = self.mesh, self.mesh.size
        velocity = mesh.velocity.numpy().astype(np.float64).reshape(3, size)
        mass = np.divide(1.0, self.inverse_mass, out=np.zeros(size), where=self.inverse_mass > 0.0)
        return Energies(
            lost=self.limits.impact_energy - self.core_energy,
            given=_total(mesh.contact_work),
            kinetic=0.5 * float((mass * (velocity**2).sum(axis=0)).sum()),
            work=_total(mesh.work),
            hourglass=_total(mesh.hourglass_work),
            radiated=_total(mesh.radiated),
        )


def axis_of(attitude: Any) -> Array:
    """The axis of a core, from its base to its nose."""
    x, y, z, w = (float(part) for part in attitude)
    return np.array([1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y + z * w), 2.0 * (x * z - y * w)])


def _total(values: Any) -> float:
    """Sum of an array of the device."""
    return float(values.numpy().astype(np.float64).sum())
