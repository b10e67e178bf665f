"""What the kernels read of a scene and its shots, on one device."""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.kernels import march
from warpimpact.kernels.variant import Variant
from warpimpact.scene import OF_THE_SCENE, Core, Interaction, Numerics, Plate, Scene, Shots
from warpimpact.solver import inputs
from warpimpact.solver.bending import check_bending, sections_of
from warpimpact.solver.resolution import Fidelity, Resolution, decay_rate, resolve
from warpimpact.solver.rings import azimuths_of, rings_of
from warpimpact.solver.tile import FINER, Tile, tent_taps, tile_of

Array = NDArray[np.float64]

ONSET = 0.05
"""Onset speed of contact in units of what full contact of a wall as deep as the plate does in one step."""
LARGEST_ONSET = 0.02
"""Bound of the onset speed, as a share of the impact velocity."""


def onset_jump(core: Core, thickness: Array, mass: Array, static_stress: Array) -> Array:
    """Onset speed of contact per time step [m/s²] of cores of some masses [kg] in plates of some thicknesses [m] and
    static stresses [Pa], of their shape; positive, also for a plate without resistance."""
    wall = 2.0 * core.max_radius * np.minimum(thickness, core.length)
    return np.maximum(ONSET * static_stress * wall / mass, 1.0)


STEP_ALLOWANCE = 200
"""How many times the way of an unhindered passage a shot may take, at impact velocity, before it is given up."""


def variant_of(resolution: Resolution, scene: Scene, shots: Shots) -> Variant:
    """The build of the kernels that a scene needs."""
    plate, interaction = scene.target.plate, scene.interaction
    return Variant(
        double=resolution.double,
        nodal=resolution.nodal,
        degrades=plate.degradation < 1.0 or "degradation" in shots.columns,
        rubs=plate.shear_coefficient > 0.0 or "shear_coefficient" in shots.columns,
        rate_dependent=interaction.linear > 0.0 or interaction.quadratic > 0.0,
        rimmed=plate.size is not None,
        bends=scene.record.bending,
        scattered=any(name in shots.columns for name in OF_THE_SCENE),
    )


class Inputs:
    """The structs of the march (kernels/march.py), filled.

    Attributes:
        resolution: the numerics with every choice made.
        variant, stage: the build of the kernels that the scene needs, and its march.
        surface, body, sections, plate, law, pace, shots, own: structs on the device.
        each: what every shot has of its own or from the scene, by the names of the march's Shots and Own, of shape
            [shots].
        spacing: of the window's grid [m].
    """

    def __init__(
        self,
        scene: Scene,
        numerics: Numerics | Fidelity,
        shots: Shots,
        device: Any,
        *,
        traced: bool,
    ) -> None:
        check_bending(scene.record, numerics)
        core, plate, interaction = scene.core, scene.target.plate, scene.interaction
        self._device = device
        self.resolution = resolve(numerics, scene, shots.columns)
        self.variant = variant_of(self.resolution, scene, shots)
        self.stage = march.build(self.variant)
        self.spacing = self.resolution.grid_spacing
        self._rings = rings_of(
            core,
            self.resolution.patches_axial,
            self.resolution.patches_around,
            self.resolution.patch_width,
            discs=not self.resolution.nodal,
        )
        self.surface = self._surface(core)
        self.sections = self._sections(core)
        self.plate = self._plate(plate)
        self.law = self.stage.Law()
        self.law.a2, self.law.onset_limit = interaction.quadratic * plate.density, inputs.LARGEST_ONSET
        self.body, self.shots, self.own = self.stage.Body(), self.stage.Shots(), self.stage.Own()
        self.each = self._each(core, plate, interaction, shots)
        self.pace = self._pace(shots, traced)
        for name in self.stage.Shots.vars:
            setattr(self.shots, name, self.array(self.each[name], dtype=wp.float64))
        self._fill_in_what_may_scatter()

    def array(self, values: NDArray[Any], dtype: Any = None) -> Any:
        """Values on the device, if not said otherwise in the floating-point type of the kernels."""
        return wp.array(np.ascontiguousarray(values), dtype=dtype or self.variant.real, device=self._device)

    def _fill_in_what_may_scatter(self) -> None:
        """Give it to the scene's structs where it does not, and else to every shot."""
        stage, names = self.stage, self.stage.Own.vars
        if self.variant.scattered:
            for name in names:
                setattr(self.own, name, self.array(self.each[name], dtype=names[name].type.dtype))
            return
        for struct, kind in (
            (self.body, stage.Body),
            (self.plate, stage.Plate),
            (self.law, stage.Law),
            (self.pace, stage.Pace),
        ):
            for name in names.keys() & kind.vars.keys():
                setattr(struct, name, float(self.each[name][0]))

    def give_up_after(self, way: float) -> None:
        """Let no shot go on for longer than a way [m] at impact velocity."""
        self.pace.longest_way = way
        if self.variant.scattered:
            self.own.longest_way.fill_(way)

    def _surface(self, core: Core) -> Any:
        rings, around = self._rings, self.resolution.patches_around
        azimuths = azimuths_of(around)
        surface = self.stage.Surface()
        for name in ("station", "radius", "half_axial", "half_radial", "turn_axial", "turn_radial"):
            setattr(surface, name, self.array(getattr(rings, name)))
        area = np.hypot(rings.area_axial, rings.area_radial)
        surface.area = self.array(area)
        surface.normal_axial = self.array(rings.area_axial / area)
        surface.normal_radial = self.array(rings.area_radial / area)
        surface.cosine, surface.sine = self.array(np.cos(azimuths)), self.array(np.sin(azimuths))
        surface.rings, surface.around = len(rings.station), around
        surface.max_radius = core.max_radius
        surface.bounding_radius = core.bounding_radius
        return surface

    def _sections(self, core: Core) -> Any:
        struct = self.stage.Sections()
        if self.variant.bends:
            sections = sections_of(core, self._rings)
            for name in self.stage.Sections.vars:
                setattr(struct, name, self.array(getattr(sections, name)))
        return struct

    def _pace(self, shots: Shots, traced: bool) -> Any:
        resolution, pace, each = self.resolution, self.stage.Pace(), self.each
        pace.time_step, pace.way_along = resolution.time_step or 0.0, resolution.way_along
        if traced:
            steps = each["longest_way"] / (
                shots.velocity
                * resolution.step_at(shots.velocity, shots.obliquity, each["thickness"], each["longest_time"])
            )
            pace.rows = math.ceil(steps.max()) + 2  # the end, and a step that rounding may add
        return pace

    def _plate(self, plate: Plate) -> Any:
        nodal = self.resolution.nodal
        finer = 1 if nodal else FINER
        tile = tile_of(plate, self.spacing / finer, sharp=nodal)
        struct = self.stage.Plate()
        struct.tile, struct.clear = _on_device(tile, self.variant.real, self._device.alias)
        struct.tile_y, struct.tile_z = tile.material.shape
        struct.period_y, struct.period_z = plate.pattern.period
        if nodal:  # nodes are the tile's cells, which fit the period
            self.spacing = min(tile.dy, tile.dz)
        struct.spacing = self.spacing
        size = plate.size or (math.inf, math.inf)
        struct.half_y, struct.half_z = 0.5 * size[0], 0.5 * size[1]
        taps = tent_taps(0.0 if nodal else plate.degradation_length, self.spacing)
        struct.reach = max(1, len(taps) // 2)
        struct.taps = self.array(np.append(taps[len(taps) // 2 :], 0.0))
        return struct

    def _each(self, core: Core, plate: Plate, interaction: Interaction, shots: Shots) -> dict[str, Array]:
        thickness, degradation = shots.own("thickness", plate.thickness), shots.own("degradation", plate.degradation)
        body, passage = core.mass_properties, self.resolution.passage(thickness)
        mass = shots.own("mass", body.mass)
        scale = mass / body.mass  # of the body as a whole, so of its moments of inertia, too
        a0, a1, _ = interaction.coefficients(shots.own("resistance", plate.resistance), plate.density)
        longest_time = self.resolution.longest_time(degradation, plate.degradation_interval)
        if not self.resolution.nodal:  # the literal scheme takes β itself, once a step
            degradation = decay_rate(degradation, plate.degradation_interval)
        return shots.columns | {
            "thickness": thickness,
            "mass": mass,
            "inertia_axial": scale * body.inertia_axial,
            "inertia_transverse": scale * body.inertia_transverse,
            "a0": a0,
            "a1": a1,
            "friction": shots.own("shear_coefficient", plate.shear_coefficient),
            "decay_rate": degradation,
            "onset_jump": inputs.onset_jump(core, thickness, mass, a0),
            "way": self.resolution.travel * passage,
            "longest_time": longest_time,
            "longest_step": passage,
            "longest_way": STEP_ALLOWANCE * (thickness + 2.0 * core.bounding_radius),
        }


@lru_cache(maxsize=4)
def _on_device(tile: Tile, real: Any, device: str) -> tuple[Any, Any]:
    """Material and clearance of a tile, which no kernel changes: kept for the next shots at the same plate."""
    material, clearance = (
        wp.array(values.reshape(-1), dtype=real, device=device) for values in (tile.material, tile.clearance)
    )
    return material, clearance
