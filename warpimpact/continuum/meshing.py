"""Meshes: grids of nodes, and that of a layer that a core will meet, whose edges follow the holes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from warpimpact.kernels.continuum.fields import PIECE
from warpimpact.scene import Core, Plate, Scene, Shots
from warpimpact.scene.model import Array

GROWTH, COARSEST = 1.3, 5.0
"""By what a cell beyond the fine ones is wider than its neighbour, and the widest one, in fine cells."""
SWEEPS = 20
"""Sweeps that spread the moves of the nodes beside holes to their neighbours."""
FARTHEST_MOVE = 0.7
"""Most that a node is moved onto an edge, in cells; one farther from it stays where it is."""
SLIVER = 0.15
"""Share of the area of its cell below which a column is left out."""
FINE, PATCH, SWEPT = 2.5, 5.0, 1.0
"""Half of the fine part of a mesh, half of it all, and how far the ends of a turned core may sweep before both grow; in
radii of the core."""
CORNERS = ((0, 0, 0), (1, 0, 0), (1, 1, 0), (0, 1, 0), (0, 0, 1), (1, 0, 1), (1, 1, 1), (0, 1, 1))
"""Corners of an element along planes, rows and columns, in the order of VTK."""
WIDER = 1.0, 1.6, 2.5
"""By how much its meshes are wider, each time that a hit is computed again because its core came near their edge."""
SLOWEST = 0.1
"""Least share of its speed at which a core approaches a layer, for the place where it will cross it."""


class Extent(NamedTuple):
    """What a mesh covers in the plane, along one axis [m]: its middle from the hit, half of its fine part, and half of
    it all."""

    middle: float
    fine: float
    half: float


class Part(NamedTuple):
    """A part of a mesh that has one material and one distance to the next plane.

    Attributes:
        material: number of its material among those of the mesh.
        plane, plane_before: distance in memory to the next plane, and from the one before.
        held: nodes of the part, and so elements, shape [nodes].
    """

    material: int
    plane: int
    plane_before: int
    held: NDArray[np.bool_]


@dataclass(frozen=True)
class BodyMesh:
    """The mesh of one body: a grid of nodes, columns in rows in planes.

    The element of a number has the node of this number as its corner of least column, row and plane.

    Attributes:
        position: of the nodes [m], shape [3, planes, rows, columns].
        present: whether there is an element, shape [planes, rows, columns].
        spacing: of the fine cells [m].
        edges: coordinates along y and z before nodes were moved [m]; of a layer.
        material: number of the material of each element, shape [planes, rows, columns]; by default there is one.
        is_ring: whether the first plane follows on the last one.
    """

    position: Array
    present: NDArray[np.bool_]
    spacing: float
    edges: tuple[Array, Array] = (np.empty(0), np.empty(0))
    material: NDArray[np.int8] = field(default_factory=lambda: np.zeros((1, 1, 1), dtype=np.int8))
    is_ring: bool = False

    @classmethod
    def of_layer(cls, y: Array, z: Array, solid: NDArray[np.bool_], x: Array, spacing: float) -> BodyMesh:
        """The mesh of a layer of columns.

        Args:
            y, z: of the nodes of a plane, from the hit [m], shape [rows, columns].
            solid: whether a column has material, shape [rows − 1, columns − 1].
            x: of the planes of nodes [m].
            spacing: of the fine cells [m].
        """
        present = np.zeros((len(x), *y.shape), dtype=bool)
        present[:-1, :-1, :-1] = solid
        return cls(np.stack(np.broadcast_arrays(x[:, None, None], y, z)), present, spacing)

    @property
    def row(self) -> int:
        """Distance in memory between neighbouring rows."""
        return int(self.present.shape[2])

    @property
    def plane(self) -> int:
        """Distance in memory between neighbouring planes."""
        return int(self.present[0].size)

    @property
    def nodes(self) -> int:
        """Nodes of all planes."""
        return int(self.present.size)

    def corners(self, elements: NDArray[np.intp]) -> NDArray[np.intp]:
        """Numbers of the nodes at the CORNERS of some elements, shape [elements, 8]."""
        offsets = np.array([x * self.plane + y * self.row + z for x, y, z in CORNERS])
        return np.asarray((elements[:, None] + offsets) % self.nodes)  # beyond the last plane of a ring is its first

    @property
    def ends(self) -> tuple[float, float]:
        """Front and rear face of a layer [m]."""
        return float(self.position[0, 0, 0, 0]), float(self.position[0, -1, 0, 0])

    @property
    def parts(self) -> list[Part]:
        """Its parts, which are blocks of the march."""
        planes, material = len(self.present), np.broadcast_to(self.material, self.present.shape)
        of_plane, back = np.zeros((planes, 1, 1), dtype=int), (1 - planes) * self.plane
        strides = [(self.plane, self.plane)]
        if self.is_ring:  # the first and the last plane lead across the seam
            of_plane[0], of_plane[-1] = 1, 2
            strides += [(self.plane, back), (back, self.plane)]
        return [
            Part(number, *stride, ((material == number) & (of_plane == kind)).ravel())
            for kind, stride in enumerate(strides)
            for number in np.unique(material)
        ]

    @property
    def outer_faces(self) -> Array:
        """Area of the outer edge of a layer about each node, where it faces y and z [m²], shape [2, nodes]."""
        x, y, z = self.position[0, :, 0, 0], *self.position[1:, 0]
        faces, depth, solid = np.zeros((2, *self.present.shape)), _shared(np.diff(x)), self.present[0, :-1, :-1]
        for side in (0, -1):
            faces[0, :, side] += np.outer(depth, _shared(np.abs(np.diff(z[side])) * solid[side]))
            faces[1, :, :, side] += np.outer(depth, _shared(np.abs(np.diff(y[:, side])) * solid[:, side]))
        return faces.reshape(2, -1)


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
        cells = (_cells(extent, self.spacing) for extent in self.extents(position, velocity, axis))
        along_y, along_z = (2 * (fine + len(wider)) + 1 for fine, wider in cells)
        return (max(2, round(self.plate.thickness / self.spacing)) + 1) * along_y * along_z

    def mesh(self, position: Array, velocity: Array, axis: Array) -> BodyMesh:
        """The mesh about the place where a core of this state will cross the layer."""
        along_y, along_z = (_line(extent, self.spacing) for extent in self.extents(position, velocity, axis))
        y, z = np.meshgrid(along_y, along_z, indexing="ij")
        centre_y, centre_z = (0.25 * (at[:-1, :-1] + at[1:, :-1] + at[:-1, 1:] + at[1:, 1:]) for at in (y, z))
        solid = np.asarray(self.plate.is_solid(centre_y + self.place[0], centre_z + self.place[1]))
        if not solid.all():
            y, z = _onto_edges(self.plate, self.place, y, z, solid)
            dy, dz = (at[1:, 1:] - at[:-1, :-1] for at in (y, z))
            ey, ez = (at[:-1, 1:] - at[1:, :-1] for at in (y, z))
            areas = 0.5 * (dy * ez - dz * ey)  # half the cross product of the diagonals
            solid = solid & (areas > SLIVER * np.outer(np.diff(along_y), np.diff(along_z)))
        x = self.front + np.linspace(0.0, self.plate.thickness, max(2, round(self.plate.thickness / self.spacing)) + 1)
        return replace(BodyMesh.of_layer(y, z, solid, x, self.spacing), edges=(along_y, along_z))


def encounters_of(
    scene: Scene, shots: Shots, number: int, spacings: Sequence[float], wider: float = 1.0
) -> list[Encounter]:
    """The layers of elements that the core of one of the shots will meet.

    Args:
        spacings: size of the elements of each of them [m].
    """
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
        for k, (layer, spacing) in enumerate(zip(target.layers, spacings, strict=False))
    ]


def _line(extent: Extent, spacing: float) -> Array:
    """Coordinates of nodes along one axis."""
    fine, wider = _cells(extent, spacing)
    half = np.concatenate([[0.0], np.cumsum([spacing] * fine + wider)])
    return np.asarray(extent.middle + np.concatenate([-half[:0:-1], half]))


def _cells(extent: Extent, spacing: float) -> tuple[int, list[float]]:
    """Number of the fine cells on one side of the middle, and widths of those beyond, wider from cell to cell [m]."""
    fine, width, wider = max(2, round(extent.fine / spacing)), spacing, list[float]()
    reach = fine * spacing
    while reach < extent.half:
        width = min(GROWTH * width, COARSEST * spacing)
        wider.append(width)
        reach += width
    return fine, wider


def _onto_edges(
    plate: Plate, hit: tuple[float, float], y: Array, z: Array, solid: NDArray[np.bool_]
) -> tuple[Array, Array]:
    """Move the nodes between material and holes onto the edges; their neighbours follow."""
    around = np.pad(solid, 1, mode="edge").astype(int)
    count = around[:-1, :-1] + around[1:, :-1] + around[:-1, 1:] + around[1:, 1:]
    between = (count > 0) & (count < 4)
    reach = 1e-3 * np.ptp(y[:2, 0])

    def distance(along_y: Array, along_z: Array) -> Array:
        return np.asarray(plate.edge_distance(along_y + hit[0], along_z + hit[1]))

    at_y, at_z = y[between], z[between]
    for _ in range(2):  # the distance is exact, its gradient across a corner is not
        separation = distance(at_y, at_z)
        slope_y = (distance(at_y + reach, at_z) - distance(at_y - reach, at_z)) / (2.0 * reach)
        slope_z = (distance(at_y, at_z + reach) - distance(at_y, at_z - reach)) / (2.0 * reach)
        steep = np.maximum(slope_y**2 + slope_z**2, 0.25)
        at_y, at_z = at_y - separation * slope_y / steep, at_z - separation * slope_z / steep
    moves = np.zeros((2, *y.shape))
    moves[0][between], moves[1][between] = at_y - y[between], at_z - z[between]
    widest = FARTHEST_MOVE * np.minimum(np.gradient(y[:, 0])[:, None], np.gradient(z[0])[None, :])
    moves = np.where(np.hypot(*moves) <= widest, moves, 0.0)
    for _ in range(SWEEPS):
        spread = np.zeros_like(moves)
        spread[:, 1:-1, 1:-1] = 0.25 * (
            moves[:, :-2, 1:-1] + moves[:, 2:, 1:-1] + moves[:, 1:-1, :-2] + moves[:, 1:-1, 2:]
        )
        moves = np.where(between, moves, spread)
    return y + moves[0], z + moves[1]


def _shared(lengths: Array) -> Array:
    """Half of each length for the nodes at either end of it."""
    return np.asarray(0.5 * (np.pad(lengths, (1, 0)) + np.pad(lengths, (0, 1))))


def volumes_of(mesh: BodyMesh) -> tuple[Array, Array]:
    """Volume [m³] and length [m] of the elements at rest by one point of integration, shape [nodes] each; 0 and 1
    where no element is."""
    low, high = slice(None, -1), slice(1, None)
    x, inside, modes = mesh.position, mesh.present[: None if mesh.is_ring else -1, :-1, :-1], []
    if mesh.is_ring:
        x = np.concatenate([x, x[:, :1]], axis=1)
    for axis in range(3):
        total = np.zeros((3, *inside.shape))
        for corner in np.ndindex(2, 2, 2):
            sign = 1.0 if corner[axis] else -1.0
            total += sign * x[(slice(None), *(high if at else low for at in corner))]
        modes.append(total)
    areas = [np.cross(modes[(k + 1) % 3], modes[(k + 2) % 3], axis=0) for k in range(3)]
    volume = np.einsum("kabc,kabc->abc", modes[0], areas[0]) / 64.0
    faces = np.max([np.sqrt((area**2).sum(axis=0)) for area in areas], axis=0)
    volumes, lengths = np.zeros(mesh.present.shape), np.ones(mesh.present.shape)
    planes = len(inside)
    volumes[:planes, :-1, :-1] = np.where(inside, volume, 0.0)
    lengths[:planes, :-1, :-1] = np.where(inside, 16.0 * volume / np.where(inside, faces, 1.0), 1.0)
    return volumes.ravel(), lengths.ravel()


def runs_of(present: NDArray[np.bool_], first: int) -> NDArray[np.int32]:
    """Runs of consecutive numbers that hold all that are present, as multiples of PIECE, shape [runs, 2].

    Args:
        first: number of the first entry of `present`.
    """
    numbers = np.flatnonzero(present)
    if not len(numbers):
        return np.empty((0, 2), dtype=np.int32)
    breaks = np.flatnonzero(np.diff(numbers) > 2 * PIECE)
    starts, stops = numbers[np.append(0, breaks + 1)], numbers[np.append(breaks, -1)] + 1
    lengths = -(-(stops - starts) // PIECE) * PIECE
    return np.asarray(first + np.stack([starts, starts + lengths], axis=1), dtype=np.int32)
