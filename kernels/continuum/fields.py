"""The structs of the continuum: material, mesh with its state, core, and how far a hit is.

A body, such as a layer of the target, is a grid of nodes: columns, rows and planes, in a layer along z, along y, and
through the thickness. The element of a number has the node of this number as its corner of least column, row and plane.
So an element's nodes, and a node's elements, lie at fixed distances in memory, and no table of neighbours is read. A
body is one block or several (`Block`): where planes go round, the last one is a block from which the next plane is the
first one.
"""

from functools import cache
from types import SimpleNamespace
from typing import Any

import warp as wp

from .. import structs
from ..memory import read, write
from ..variant import Variant

PIECE = 8
"""Consecutive elements, or nodes, into which runs divide: what a CPU computes side by side."""
PARTS = 256
"""Partial sums of each of the hits that march together."""
CELLS_ALONG, FACES_IN_CELL, FACES_OF_NODE = 16, 512, 128
"""Of the grids for contact between bodies: cells along each axis, most faces in a cell, and most that a node may
reach."""
PART_OF_BULLET, CORE = -1, -2
"""What jacket and filler, and a core of elements, have in the place of a number of a layer."""
RIGID = Variant(double=True)
"""The core moves in double precision whatever the elements have."""
rigid = structs.build(RIGID)
"""The structs of the core's motion."""


@wp.struct
class Core:
    """The core: its mass, its length and centre of mass behind the nose [m], its largest radius [m], its radii at even
    distances from nose to base [m], and the friction of its surface. It is rigid, or it deforms (1): then it is a body
    of the mesh, and its state is that of the rigid body that moves as its nodes.

    If its bending is recorded, `sections` are those behind slices of one length, and `impulses` those of the
    contact on the slices since the last look, with their moments about the centre of mass [N s, N m s], in the
    plate frame, by parts of the nodes, shape [parts, 6 slices]; else [1, 0].
    """

    body: rigid.Body
    length: wp.float64
    centre_of_mass: wp.float64
    largest: wp.float64
    radii: wp.array(dtype=wp.float64)
    friction: wp.float64
    deforms: wp.int32
    sections: rigid.Sections
    impulses: wp.array2d(dtype=wp.float64)


@wp.struct
class Limits:
    """When a hit ends: rear face of the target [m], the impact energy [J], and the longest time [s]. `unmeshed` is
    the front face of the next layer that has no mesh yet [m]; infinite if all have one."""

    rear: wp.float64
    unmeshed: wp.float64
    impact_energy: wp.float64
    longest: wp.float64


@wp.struct
class Flight:
    """How far a hit is: state of the core, of its velocities half a step before; time, this step and the last one
    [s]; first and last touch [s], negative before; status (kernels/status.py) and number of steps; its bending so
    far, and the time of the last look at it [s]; when faces last entered the grid of the contact [s], negative before.
    """

    state: rigid.State
    time: wp.float64
    step: wp.float64
    before: wp.float64
    first_touch: wp.float64
    last_touch: wp.float64
    status: wp.int32
    steps: wp.int32
    bending: rigid.Bending
    window: wp.float64
    sorted: wp.float64


@wp.struct
class Push:
    """Force of a face on a node [N], with the corners of the face and their shares of the reaction."""

    node: wp.int32
    face: wp.int32
    corners: wp.vec4i
    shares: wp.vec4d
    force: wp.vec3d


@wp.struct
class Contacts:
    """Contact between bodies (contact.py); all arrays are empty where there is one body.

    Attributes:
        cell: width of a cell of the grids, of which each body has one [m].
        margin: how far a node may come nearer to a face before faces enter the grid anew [m].
        reach: how far from a face, then, a node may be that touches it [m].
        interval: time after which they do [s].
        boxes: least and largest x, y and z of each body [m], shape [6 bodies].
        exposed: bits of the sides of each element that are faces, shape [size].
        bounds: least and largest x, y and z at which each face may be touched [m], shape [36 size].
        counts: number of faces in each cell of each body; `cells` has them, shape [cells FACES_IN_CELL].
        near: number of the faces that each node may touch; `faces` has them, shape [FACES_OF_NODE size].
        normals: of the face that each node touched in the last step, shape [3 size]; 0 if there was none.
        depths: how deep it lay behind that face [m], shape [size].
        pushes: of the nodes, by parts of equal room; `pushing` is the number of each part, shape [PARTS].
        crowded: 1 once a cell or a node had no room for a face, else 0, shape [1]; the hit then fails.
    """

    cell: wp.float64
    margin: wp.float64
    reach: wp.float64
    interval: wp.float64
    boxes: wp.array(dtype=wp.float64)
    exposed: wp.array(dtype=wp.int32)
    bounds: wp.array(dtype=wp.float32)
    counts: wp.array(dtype=wp.int32)
    cells: wp.array(dtype=wp.int32)
    near: wp.array(dtype=wp.int32)
    faces: wp.array(dtype=wp.int32)
    normals: wp.array(dtype=wp.float64)
    depths: wp.array(dtype=wp.float64)
    pushes: wp.array(dtype=Push)
    pushing: wp.array(dtype=wp.int32)
    crowded: wp.array(dtype=wp.int32)


@wp.struct
class Body:
    """A body: number of a layer, PART_OF_BULLET or CORE; Coulomb's coefficient of its faces; of a layer, its rear face,
    and the front and rear face between which a core keeps it awake [m]."""

    layer: wp.int32
    friction: wp.float64
    rear: wp.float64
    wakes: wp.float64
    sleeps: wp.float64


@cache
def build(variant: Variant) -> SimpleNamespace:
    """The structs `Material`, `Block`, `Cylinder`, `Mesh` and `Hit` for one precision."""
    real = variant.real

    @wp.struct
    class Material:
        """Elastic and flow constants.

        Moduli and stresses [Pa], density [kg/m³], speed of dilatational waves [m/s], rates [1/s]; `heating` is the
        share of the range to melting that a unit of plastic work per volume heats through [1/Pa]; `fracture_work` [Pa].
        An element fails, too, beyond a mean tension `spall` [Pa], a largest principal stress `tensile` [Pa] and a
        plastic strain `ductility`.
        """

        density: real
        bulk: real
        shear: real
        wave_speed: real
        yield_stress: real
        hardening: real
        exponent: real
        voce_stress: wp.types.vector(2, real)
        voce_rate: wp.types.vector(2, real)
        rate_exponent: real
        reference_rate: real
        heating: real
        softening: real
        fracture_work: real
        spall: real
        tensile: real
        ductility: real

    @wp.struct
    class Block:
        """A part of the grid of a body that has one material and one distance in memory between neighbours.

        Attributes:
            body: that it is a part of.
            material: of its elements.
            row: distance in memory from a node to the next one along y.
            plane, plane_before: distance to the next plane of nodes, and from the one before.
            stiffness: of the contact with a node [N/m].
            hourglass: resistance against hourglasses over density, wave speed and area.
            spacing: size of its fine elements [m].
            finest: the same where elements fail that are thinner than a share of it; 0 where none do.
            folding: plastic strain beyond which folded elements fail.
            debris: 1 where nodes push the core that no element holds any more, else 0.
        """

        body: wp.int32
        material: Material
        row: wp.int32
        plane: wp.int32
        plane_before: wp.int32
        stiffness: real
        hourglass: real
        spacing: real
        finest: real
        folding: real
        debris: wp.int32

    @wp.struct
    class Cylinder:
        """What holds the core: nodes outside of it are not touched. Centre [m], axis, half the length and the square
        of the radius [m²]."""

        centre: wp.types.vector(3, real)
        axis: wp.types.vector(3, real)
        half_length: real
        square: real

    @wp.struct
    class Mesh:
        """Nodes and elements of all bodies. Arrays of nodes and of elements have shape [size], of vectors [3 size] by
        component, of symmetric tensors [6 size] in the order xx, yy, zz, xy, yz, zx.

        Attributes:
            runs: first number, number after the last, and block of each run of consecutive elements, shape [3 runs].
            node_runs: the same of nodes.
            block: of each element and node, shape [size].
            awake: 1 for a body that is marched, 0 for one that the core has not reached or has left, shape [bodies].
            touched: time at which the core last touched each layer, or a part of the bullet any layer [s], negative
                before, shape [bodies].
            cylinder: about the core.
            kick: between this step's velocities and the next ones [s].
            position [m], velocity [m/s], inverse_mass [1/kg] (0 where a node has no element), contact [N] and
            contact_work [J] of nodes; `near` is 1 where the core may touch.
            impedance [N s/m] of the material beyond the outer edge, of nodes by component; radiated [J] into it.
            volume [m³] and length [m] of elements at rest; `alive` is 1 or 0; `leading` is 1 in the fragment of a core
            that has the most momentum, else 0.
            stress [Pa], strain, damage, heat (share of the range to melting) of elements; work of stress and viscosity
            [J], of the resistance against hourglasses [J].
            crossing: time that a wave takes across an element [s].
            force: of elements on their corners [N], shape [24 size]: by corner, then by component.
        """

        size: wp.int32
        bodies: wp.array(dtype=Body)
        blocks: wp.array(dtype=Block)
        runs: wp.array(dtype=wp.int32)
        node_runs: wp.array(dtype=wp.int32)
        block: wp.array(dtype=wp.int32)
        contacts: Contacts
        awake: wp.array(dtype=wp.int32)
        touched: wp.array(dtype=wp.float64)
        cylinder: Cylinder
        kick: real
        position: wp.array(dtype=real)
        velocity: wp.array(dtype=real)
        inverse_mass: wp.array(dtype=real)
        impedance: wp.array(dtype=real)
        radiated: wp.array(dtype=real)
        contact: wp.array(dtype=real)
        contact_work: wp.array(dtype=real)
        near: wp.array(dtype=real)
        volume: wp.array(dtype=real)
        length: wp.array(dtype=real)
        alive: wp.array(dtype=real)
        leading: wp.array(dtype=real)
        stress: wp.array(dtype=real)
        strain: wp.array(dtype=real)
        damage: wp.array(dtype=real)
        heat: wp.array(dtype=real)
        work: wp.array(dtype=real)
        hourglass_work: wp.array(dtype=real)
        crossing: wp.array(dtype=real)
        force: wp.array(dtype=real)

    @wp.struct
    class Hit:
        """One of the hits that march together, with arrays of its own.

        Attributes:
            pieces: first number and block of each piece of the runs of elements, shape [2 pieces]; a piece is PIECE
                consecutive elements.
            node_pieces: the same of nodes.
            flights: how far it is, shape [1].
            left: state with which the core left each layer, shape [layers, 7]: velocity, axis, and time; NaN before.
        """

        core: Core
        limits: Limits
        mesh: Mesh
        pieces: wp.array(dtype=wp.int32)
        node_pieces: wp.array(dtype=wp.int32)
        flights: wp.array(dtype=Flight)
        left: wp.array2d(dtype=wp.float64)

    return SimpleNamespace(Material=Material, Block=Block, Cylinder=Cylinder, Mesh=Mesh, Hit=Hit)


@wp.func
def vector_at(values: wp.array(dtype=Any), size: wp.int32, number: wp.int32):
    """A vector of an array of shape [3 size] by component."""
    return wp.vector(read(values, number), read(values, size + number), read(values, 2 * size + number))


@wp.func
def put_vector(values: wp.array(dtype=Any), size: wp.int32, number: wp.int32, vector: Any):
    """Write a vector to an array of shape [3 size] by component."""
    write(values, number, vector[0])
    write(values, size + number, vector[1])
    write(values, 2 * size + number, vector[2])


@wp.func
def tensor_at(values: wp.array(dtype=Any), size: wp.int32, number: wp.int32):
    """A symmetric tensor of an array of shape [6 size] by component."""
    normal, shear = vector_at(values, size, number), vector_at(values, size, 3 * size + number)
    return wp.vector(normal[0], normal[1], normal[2], shear[0], shear[1], shear[2])


@wp.func
def put_tensor(values: wp.array(dtype=Any), size: wp.int32, number: wp.int32, tensor: Any):
    """Write a symmetric tensor to an array of shape [6 size] by component."""
    put_vector(values, size, number, wp.vector(tensor[0], tensor[1], tensor[2]))
    put_vector(values, size, 3 * size + number, wp.vector(tensor[3], tensor[4], tensor[5]))


def over_runs(function: Any) -> Any:
    """A device function that calls f(mesh, block, number, dt) for all numbers of some runs of a Mesh in the bodies that
    are awake.

    The passes of such a loop write to places of their own, which no other pass reads. A compiler cannot see this of
    arrays that are known at run time only, and gives up at 128 pairs that it would have to check. The pragma says so.
    """

    @wp.func_native(f"""
    #if !defined(__CUDA_ARCH__)
    _Pragma("clang loop vectorize(assume_safety)")
    #endif
    for (int number = first; number < last; ++number) {function.native_func}(mesh, block, number, dt);
    """)
    def call_all(mesh: Any, block: Any, first: wp.int32, last: wp.int32, dt: Any): ...

    @wp.func(name=f"{function.key.rpartition('.')[2]}_all")
    def call_in_runs(mesh: Any, runs: wp.array(dtype=wp.int32), dt: Any):
        for run in range(runs.shape[0] // 3):
            first, last = runs[3 * run], runs[3 * run + 1]
            block = mesh.blocks[runs[3 * run + 2]]
            if last < first:  # never: it names the function, so that it is compiled before the loop that calls it
                function(mesh, block, first, dt)
            if mesh.awake[block.body] != 0:
                call_all(mesh, block, first, last, dt)

    return call_in_runs
