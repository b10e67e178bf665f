"""All structs of the device code, in the order of a shot: core, target, shots, one step, memory, results.

A struct is what functions of several stages, or the host and a kernel, pass to each other. Its docstring gives the
meaning, the unit and the shape of each member. Numbers are SI, angles in radians. Arrays lie in the memory of the
device; the host fills those of the inputs (solver/structs.py, solver/memory.py).
"""

from functools import cache
from types import SimpleNamespace

import warp as wp

from .variant import Variant


def build(variant: Variant) -> SimpleNamespace:
    """The structs of one variant, by name. Variants of one precision have the same structs, whatever their physics, so
    a variant can read what another has filled. Only a plate may come by value or from a table."""
    return _build(variant.double, variant.layered)


@cache
def _build(double: bool, many_plates: bool) -> SimpleNamespace:
    variant = Variant(double=double)
    real, vec2, vec3, mat33, quat = variant.real, variant.vec2, variant.vec3, variant.mat33, variant.quat

    # --- The core ---

    @wp.struct
    class Surface:
        """The surface of a core: rings from nose to base, the discs that close them included.

        `of_rings` has, one array behind the other, of every ring: station ahead of the centre of mass and radius [m];
        area of one patch [m²]; the patch's normal along the axis and outwards; half of the ring's extent along the
        meridian, axially and radially [m]; and half of the change of the normal over it. `of_patches` repeats each
        number for all patches of the ring, so that a CPU goes through the patches of all rings in one loop.
        `cosine` and `sine` belong to the azimuths of all patches, ring by ring. Odd rings are turned by half a patch,
        so that neighbouring rings do not all miss the same edge. The number of patches around a ring is a multiple of
        4.
        """

        of_rings: wp.array(dtype=real)
        of_patches: wp.array(dtype=real)
        cosine: wp.array(dtype=real)
        sine: wp.array(dtype=real)
        rings: wp.int32
        around: wp.int32
        max_radius: real
        bounding_radius: real

    @wp.struct
    class Sections:
        """The sections of a core behind its rings; arrays of shape [rings]. `station` is the distance behind the nose
        [m], `ahead` the distance ahead of the centre of mass [m]. `stress` is the stress per bending moment, 4/(π r³)
        [1/m³]; it is 0 where no stress is computed.

        ξ is the distance of a slice ahead of the centre of mass, x that of the section. The integrals run over all
        slices ahead of the section, per mass of the core: first = ∫ (ξ − x) dm [m], second = ∫ (ξ − x) ξ dm [m²] and
        rotary = ∫ r²/4 dm [m²].
        """

        station: wp.array(dtype=real)
        ahead: wp.array(dtype=real)
        stress: wp.array(dtype=real)
        first: wp.array(dtype=real)
        second: wp.array(dtype=real)
        rotary: wp.array(dtype=real)

    @wp.struct
    class Body:
        """Mass [kg] and principal moments of inertia [kg m²] of a core."""

        mass: real
        inertia_axial: real
        inertia_transverse: real

    @wp.struct
    class State:
        """Position [m], attitude, velocity [m/s] and angular momentum [N m s] of a core in the plate frame. The origin
        is the hit point on the front face."""

        position: vec3
        attitude: quat
        velocity: vec3
        angular_momentum: vec3

    @wp.struct
    class Pose:
        """A core as its surface sees it: centre of mass [m] and body axes in the plate frame; velocity [m/s] and
        angular velocity [rad/s] along the body axes (axis, right, up). `speed` is an upper bound of the speed of its
        points [m/s]."""

        position: vec3
        axis: vec3
        right: vec3
        up: vec3
        velocity: vec3
        omega: vec3
        speed: real

    @wp.struct
    class Ring:
        """One ring in a pose; `sector` is half the angle of a patch."""

        centre: vec3
        station: real
        radius: real
        area: real
        normal_axial: real
        normal_radial: real
        half_axial: real
        half_radial: real
        turn_axial: real
        turn_radial: real
        sector: real

    @wp.struct
    class Patch:
        """The centre of one patch: position in the plate frame [m], components along x of the directions outwards and
        around, velocity along the axis, outwards and around [m/s]. `swing` is the rate at which the axis turns towards
        the direction outwards [rad/s]. `closing` is the velocity along the outward normal [m/s]."""

        x: real
        y: real
        z: real
        outward_x: real
        around_x: real
        velocity_axial: real
        velocity_outward: real
        velocity_around: real
        swing: real
        closing: real

    @wp.struct
    class Face:
        """The part of a patch in contact: its normal (axial, outwards, around), its closing speed [m/s], and the place
        of its middle: station ahead of the centre of mass and radius [m]."""

        axial: real
        outward: real
        around: real
        closing: real
        station: real
        radius: real

    # --- The target ---

    @wp.struct
    class Plate:
        """The pristine pattern of a plate.

        `tile` holds the material fractions of one period, shape [tile_y × tile_z]; its corner is at the origin. `clear`
        is a lower bound of each cell's distance from material [m]. `period_y` and `period_z` are the extents of the
        period [m]. `half_y` and `half_z` are half the sides of a finite plate [m], infinite without a rim. `spacing` is
        the spacing of the exposure's grid [m]. `taps` is half of the tent filter on this grid, and `reach` is its reach
        in nodes, at least 1.

        `cover` has the material along a normal [m] (kernels/free_edges.py), shape [radii × (directions + 1) × (cover_y
        + 1) × (cover_z + 1)]: classes of the core's radius; directions, where the last repeats the first; the nodes of
        a period and the first ones of the next. `cover_per_y` and `cover_per_z` are nodes per metre, `cover_per_row`
        and `cover_per_column` nodes per cell of the tile.
        """

        tile: wp.array(dtype=real)
        clear: wp.array(dtype=real)
        tile_y: wp.int32
        tile_z: wp.int32
        period_y: wp.float64
        period_z: wp.float64
        half_y: wp.float64
        half_z: wp.float64
        spacing: real
        taps: wp.array(dtype=real)
        reach: wp.int32
        cover: wp.array(dtype=real)
        cover_y: wp.int32
        cover_z: wp.int32
        radii: wp.int32
        directions: wp.int32
        cover_per_y: real
        cover_per_z: real
        cover_per_row: real
        cover_per_column: real

    @wp.struct
    class Window:
        """The part of a slot's fields that a layer has, and its place on the tile.

        `first` is the index of the first node. `home` is the index of the node at the hit, in row `home_y` and column
        `home_z`, which may lie outside the window: so a shot computes the same bits in a window of any size and place.
        `per_cell` is nodes per metre. `row` and `column` are the cell of the tile that holds the hit, `tile_y` and
        `tile_z` are the hit's place in this cell, `per_row` and `per_column` are cells of the tile per metre.
        `thickness` is the thickness of the plate; `low_y`, `high_y`, `low_z` and `high_z` are its rims relative to the
        hit [m]. (y0, z0) is the place of the node `home` in the literal scheme [m]. `weakens` says whether the fields
        hold this window.
        """

        first: wp.int32
        home: wp.int32
        home_y: wp.int32
        home_z: wp.int32
        cells_y: wp.int32
        cells_z: wp.int32
        nodes: wp.int32
        per_cell: real
        row: wp.int32
        column: wp.int32
        tile_y: real
        tile_z: real
        per_row: real
        per_column: real
        thickness: real
        low_y: real
        high_y: real
        low_z: real
        high_z: real
        y0: real
        z0: real
        weakens: wp.bool

    @wp.struct
    class Cell:
        """The four nodes around a point: index, row and column of the first, and the point's place between them, 0 to
        1."""

        index: wp.int32
        row: wp.int32
        column: wp.int32
        y: real
        z: real

    @wp.struct
    class Box:
        """Rows and columns of nodes of a window, ends included."""

        y_low: wp.int32
        y_high: wp.int32
        z_low: wp.int32
        z_high: wp.int32

    @wp.struct
    class Strip:
        """Nodes of a window: `rows` rows of `count` nodes, `stride` apart, from node `start` on."""

        start: wp.int32
        rows: wp.int32
        count: wp.int32
        stride: wp.int32

    @wp.struct
    class Law:
        """Normal stress a0 + a1 v_n + a2 v_n² [Pa], friction η and ln(β)/Δt_β [1/s]; or, where exposure counts the path
        of the centre of mass (`by_path`), ln(β)/Δs_β [1/m]. The literal scheme takes β itself (`degradation`) once a
        step.

        `onset` is the closing speed [m/s] over which contact sets in (`onset_speed`). It is the share `onset_share` of
        the core's velocity; or, where the step needs a wider one, `onset_jump` [m/s²] times the time step, but at most
        the share `onset_limit` of the core's velocity. `steadied` is the closing speed [m/s] below which contact damps
        by its chord (`steady_slope`).

        Near a free surface a0 is divided by 1 + r · `per_reach` [1/m], r the radius of the core. The share
        `attack` of it, times the sine v_n · `per_speed` of the angle of attack, is added; `per_speed` is one over the
        core's velocity [s/m]. A patch presses by 1 − exp(−`cover` · b / r), b the length of material ahead of it.
        """

        a0: real
        a1: real
        a2: real
        friction: real
        decay_rate: real
        degradation: real
        by_path: wp.bool
        onset_share: real
        onset_jump: real
        onset_limit: real
        onset: real
        steadied: real
        per_reach: real
        attack: real
        per_speed: real
        cover: real

    # A single plate comes by value, because CUDA does not know the memory behind a pointer that lies in memory.
    Plates = wp.array(dtype=Plate) if many_plates else Plate

    @wp.struct
    class Target:
        """The layers of the target, front to back; arrays of shape [layers].

        `front` is the front face behind that of the target [m]; `offset_y` and `offset_z` are the place of the layer's
        origin in the plane of the plate [m]. These, `thickness` [m] and the members of Law have one value for all shots
        or one per shot: shape [layers, 1] or [layers, shots]. The layers that a step can touch add their `onset_jump`,
        up to `most_jump`, as if they were one plate. `weakens` says whether the layer keeps a field.
        `stretch` is the ratio of the longest allowed step to the shortest one while a core touches nothing but the
        layer, and `slowing` is the share of its speed that a longer step may take. Where there are several layers,
        windows that `slide` follow a core that leaves them.
        """

        count: wp.int32
        plates: Plates
        weakens: wp.array(dtype=wp.bool)
        by_path: wp.array(dtype=wp.bool)
        slowing: real
        slide: wp.bool
        front: wp.array2d(dtype=wp.float64)
        thickness: wp.array2d(dtype=wp.float64)
        offset_y: wp.array2d(dtype=wp.float64)
        offset_z: wp.array2d(dtype=wp.float64)
        a0: wp.array2d(dtype=real)
        a1: wp.array2d(dtype=real)
        a2: wp.array2d(dtype=real)
        friction: wp.array2d(dtype=real)
        degradation: wp.array2d(dtype=real)
        decay_rate: wp.array2d(dtype=real)
        onset_jump: wp.array2d(dtype=real)
        most_jump: wp.array2d(dtype=real)
        per_reach: wp.array2d(dtype=real)
        stretch: wp.array2d(dtype=real)

    # --- The shots ---

    @wp.struct
    class Shots:
        """The conditions of all shots. Arrays of shape [1], one value for all shots, or [shots].

        Hit point, velocity and attitude on impact (docs/model.md §1); the members of Body; the strength of the core
        [Pa]; `onset_share` of Law; the shortest time step [s]; and the way [m] at impact velocity after which a shot
        that has not ended is given up.
        """

        hit_y: wp.array(dtype=wp.float64)
        hit_z: wp.array(dtype=wp.float64)
        velocity: wp.array(dtype=wp.float64)
        obliquity: wp.array(dtype=wp.float64)
        azimuth: wp.array(dtype=wp.float64)
        pitch: wp.array(dtype=wp.float64)
        yaw: wp.array(dtype=wp.float64)
        spin: wp.array(dtype=wp.float64)
        mass: wp.array(dtype=real)
        inertia_axial: wp.array(dtype=real)
        inertia_transverse: wp.array(dtype=real)
        strength: wp.array(dtype=real)
        onset_share: wp.array(dtype=real)
        time_step: wp.array(dtype=wp.float64)
        longest_way: wp.array(dtype=wp.float64)

    @wp.struct
    class Inputs:
        """What a launch of the march reads. Each shot has `rows` rows of the trace; 0 means no trace. Cores begin with
        the states in `starts`; where it is empty, at the front face."""

        surface: Surface
        sections: Sections
        target: Target
        law: Law
        shots: Shots
        starts: wp.array(dtype=State)
        rows: wp.int32

    # --- One step ---

    @wp.struct
    class Clock:
        """The time of a shot (kernels/trace.py): it has done `steps` steps, of which `contact_steps` touched material.

        `step` is the length of the present step and `shortest` that of the shortest one [s]. Steps are counted as if
        all were the shortest; `beyond` is the time that this leaves out, and `contact_beyond` the part of it in contact
        [s].
        """

        shortest: real
        step: real
        steps: wp.int32
        contact_steps: wp.int32
        beyond: real
        contact_beyond: real

    @wp.struct
    class Footprint:
        """The rings and the nodes of one layer that a step can touch. `first_ring` and `last_ring` are the first and
        the last ring that can be in the slab; last < first if there is none. `first_closing` and `last_closing` are the
        first and the last of these that may close in. `through` means that all rings are behind the rear face, `back`
        that all are before the front face. `box` holds the nodes around the rings in the slab. `inside` means that the
        window holds the box."""

        first_ring: wp.int32
        last_ring: wp.int32
        first_closing: wp.int32
        last_closing: wp.int32
        through: wp.bool
        back: wp.bool
        inside: wp.bool
        box: Box

    @wp.struct
    class Slab:
        """One layer as a step loads it, in the frame of the layer: its front face is at x = 0, and the home of its
        window at y = z = 0. `pose` is the pose at mid-step, and `dt` the length of the step [s]."""

        plate: Plate
        law: Law
        window: Window
        footprint: Footprint
        pose: Pose
        dt: real

    @wp.struct
    class Reach:
        """What a step can touch of the target. `footprint` covers all layers together.

        For a target of one plate, `window` is the plate's. The other members have no meaning: a core is never `behind`
        a plate of its target, and nothing is a `barrier` to it.

        For a target of several layers, the layers from `first` to `last` can be touched; `first` > `last` if there is
        none. `rearmost` and `foremost` are the ends of the core along x, and `deepest` is the largest x that it has
        reached [m]. `clearance` is a lower bound of its distance from the material of layers that it passes through a
        hole or beside [m]. `behind` says whether it has left the plate through its rear face. `barrier` is the work [J]
        of a core that goes straight through the layers before it, if they were solid. `flight` is the unit vector along
        the line of fire; a core that gets farther than `farthest` [m] away from the hit across the line never ends.
        """

        footprint: Footprint
        window: Window
        first: wp.int32
        last: wp.int32
        rearmost: real
        foremost: real
        deepest: real
        clearance: real
        behind: wp.bool
        barrier: real
        flight: vec3
        farthest: real

    @wp.struct
    class Contact:
        """How a patch touches: its mean share of contact; the derivative of this share by the closing speed [s/m]; and
        the distance of the middle of its touching part from its own middle, in halves of the patch and per variation of
        the closing speed over it [s/m]."""

        share: real
        slope: real
        shift: real

    @wp.struct
    class Sums:
        """Sums over some patches: force [N] and moment [N m] along the body axes, and Σ slope of the traction [N s/m] ×
        two factors. The factors are the normal's components along the axis (a) and outwards (r), and its lever about
        the centre of mass (l). Each r or l brings a cos or sin of the azimuth: (cos, sin) for one of them, (cos², cos
        sin, sin²) for two."""

        force: vec3
        moment: vec3
        aa: real
        ar: vec2
        rr: vec3
        al: vec2
        rl: vec3
        ll: vec3

    @wp.struct
    class Load:
        """Force [N], moment about the centre of mass [N m], and their resistance to a change of velocity; along the
        body axes.

        The damping blocks are −½ ∂(force, moment)/∂(velocity, angular velocity). `damped` means that at least one of
        them is not zero, `touching` that at least one patch touches material.
        """

        force: vec3
        moment: vec3
        damping_vv: mat33
        damping_vw: mat33
        damping_ww: mat33
        damped: wp.bool
        touching: wp.bool

    @wp.struct
    class Change:
        """Change of velocity [m/s] and angular velocity [rad/s] in a step, along the body axes."""

        velocity: vec3
        omega: vec3

    # --- Scratch: memory of the slots, each of which computes one shot after the other ---

    @wp.struct
    class Fields:
        """The nodes of all slots, or of one. A slot has `nodes` of each array. The window of a layer has
        cells_y × cells_z of them, from number `first` on; shape [layers].

        The consistent law keeps the exposure [s] (or [m] where it counts a path), the exposure gained in the step, and
        room for the filter. The literal scheme keeps each node's share of the resistance Y, 0 in holes, and 1 where the
        step `touched` the node.
        """

        exposure: wp.array(dtype=real)
        gain: wp.array(dtype=real)
        filtered: wp.array(dtype=real)
        share: wp.array(dtype=real)
        touched: wp.array(dtype=real)
        nodes: wp.int32
        first: wp.array(dtype=wp.int32)
        cells_y: wp.array(dtype=wp.int32)
        cells_z: wp.array(dtype=wp.int32)

    @wp.struct
    class Touches:
        """What the first pass over the patches finds, for every patch of every slot, from the first ring on that may
        close in.

        `area` is the area that presses on material [m²], `slope` its derivative by the closing speed [m s], and `shift`
        that of Contact. `gain` is the exposure that the patch gives to its nodes [s]. `tile` and `cell` are its cells
        of the tile and of the grid; `y` and `z` are its place in the grid's cell. `ring_area` is the area of all
        patches of a ring. If the bending moment is recorded, `sums` holds the sums of the second pass over a ring, and
        `total_area` the area of a ring in all layers of the target. `cover` is the index of the node and direction
        before the patch in the table of the cover, `cover_y`, `cover_z` and `cover_turn` are the fractions of the way
        to the next ones, and `cover_decay` is the negative exponent per cover [1/m].
        """

        area: wp.array(dtype=real)
        slope: wp.array(dtype=real)
        shift: wp.array(dtype=real)
        gain: wp.array(dtype=real)
        tile: wp.array(dtype=wp.int32)
        cell: wp.array(dtype=wp.int32)
        y: wp.array(dtype=real)
        z: wp.array(dtype=real)
        ring_area: wp.array(dtype=real)
        sums: wp.array(dtype=Sums)
        total_area: wp.array(dtype=real)
        cover: wp.array(dtype=wp.int32)
        cover_y: wp.array(dtype=real)
        cover_z: wp.array(dtype=real)
        cover_turn: wp.array(dtype=real)
        cover_decay: wp.array(dtype=real)

    @wp.struct
    class Stack:
        """State of several layers in each slot; shape [slots × layers], empty for one plate.

        For each layer: the footprint of the step, the layer's window, the place of the window's home relative to the
        hit [m], whether the window is open, whether the core was near the layer in the last step, and the nodes that
        the window has held, from its home (`known`). `first_cells` are the nodes, in each direction, of the first
        window that a shot alone needs, shape [layers, 1] or [layers, shots]: the windows of shots that are computed
        with it may be wider, and its outcome must not depend on them.
        """

        footprint: wp.array(dtype=Footprint)
        window: wp.array(dtype=Window)
        home: wp.array(dtype=vec3)
        open: wp.array(dtype=wp.bool)
        near: wp.array(dtype=wp.bool)
        known: wp.array(dtype=Box)
        first_cells: wp.array2d(dtype=wp.int32)

    @wp.struct
    class Scratch:
        """What the shots of a launch write while they run."""

        fields: Fields
        touches: Touches
        stack: Stack

    # --- Results ---

    @wp.struct
    class Outcomes:
        """How each shot's contact ended: arrays of shape [shots]; position relative to the hit point."""

        status: wp.array(dtype=wp.int32)
        steps: wp.array(dtype=wp.int32)
        contact_duration: wp.array(dtype=real)
        energy_loss: wp.array(dtype=real)
        position: wp.array(dtype=vec3)
        axis: wp.array(dtype=vec3)
        velocity: wp.array(dtype=vec3)
        angular_momentum: wp.array(dtype=vec3)

    @wp.struct
    class Passage:
        """How each core left each layer: arrays of shape [shots, layers], empty for one plate.

        Velocity and tilt are taken at the instant when the last point of the core leaves the layer through its
        rear face; NaN where it does not leave. Per shot: the layer in which the core came to rest, or −1, and the
        largest distance of its points behind this layer's front face [m].
        """

        status: wp.array2d(dtype=wp.int32)
        velocity: wp.array2d(dtype=real)
        tilt: wp.array2d(dtype=real)
        stopped_in: wp.array(dtype=wp.int32)
        depth: wp.array(dtype=real)

    @wp.struct
    class Bending:
        """The largest bending moment [N m] and nominal stress [Pa] so far, and where behind the nose [m].

        A core is broken from the first step on in which the stress is above its `strength` [Pa]. Recorded are the
        middle of that step [s], the most stressed section then, behind the nose [m], and this section ahead of the hit
        point along x.
        """

        moment: real
        moment_station: real
        stress: real
        stress_station: real
        strength: real
        broken: wp.int32
        broken_time: real
        broken_station: real
        broken_x: real

    @wp.struct
    class Report:
        """The values of each shot that a result shows; arrays of shape [shots] or [shots, stand-offs], NaN where there
        is no value."""

        residual_velocity: wp.array(dtype=real)
        deflection: wp.array(dtype=real)
        angular_velocity: wp.array(dtype=vec3)
        energy_loss: wp.array(dtype=real)
        contact_duration: wp.array(dtype=real)
        tilt: wp.array2d(dtype=real)
        pitch: wp.array2d(dtype=real)
        yaw: wp.array2d(dtype=real)
        total_yaw: wp.array2d(dtype=real)

    @wp.struct
    class Results:
        """What a launch of the march fills. `bending` has shape [shots] where it is recorded, and `trace` has a row for
        each step of each shot (kernels/trace.py)."""

        outcomes: Outcomes
        passage: Passage
        bending: wp.array(dtype=Bending)
        trace: wp.array2d(dtype=real)

    # --- One shot ---

    @wp.struct
    class Context:
        """One shot, number `shot` of all, in slot number `slot`: what stays the same from its start to its end, and the
        memory that its functions share. `depth` is the rear face of the target behind its front [m], `impact_energy`
        the kinetic energy at the start [J]. `law` is the law of the plate."""

        shot: wp.int32
        slot: wp.int32
        depth: real
        impact_energy: real
        surface: Surface
        sections: Sections
        body: Body
        target: Target
        law: Law
        shots: Shots
        fields: Fields
        touches: Touches
        stack: Stack
        passage: Passage

    return SimpleNamespace(**locals())
