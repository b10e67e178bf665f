"""The cells and rings that one step may touch (docs/model.md §4)."""

from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.kernels import core_surface, exposure, footprint, plate_grid, structs
from warpimpact.kernels.variant import Variant

from .probes import CONE, astride, plate_of, poisoned, poisoned_fields, surface_of

Array = NDArray[np.float64]

VARIANT = Variant(double=True, rate_dependent=True)
real, vec3, quat = VARIANT.real, VARIANT.vec3, VARIANT.quat
use, struct = VARIANT.use(core_surface, exposure, footprint, plate_grid), structs.build(VARIANT)
Surface, Plate, Fields, Footprint = (
    struct.Surface,
    struct.Plate,
    struct.Fields,
    struct.Footprint,
)

CELL = 0.25e-3
THICKNESS = wp.constant(4.0e-3)


def footprints(
    surface: Surface,
    plate: Plate,
    fields: Fields,
    position: wp.array(dtype=vec3),
    attitude: wp.array(dtype=quat),
    velocity: vec3,
    omega: vec3,
    dt: real,
    actual: wp.array(dtype=Footprint),
    immersed: wp.array2d(dtype=wp.int32),
    rows: wp.array3d(dtype=wp.int32),
    columns: wp.array3d(dtype=wp.int32),
) -> None:
    """The footprints of poses; for each ring, whether it is immersed; for each patch, its first cell."""
    i = wp.tid()
    fields = use.exposure.fields_of_slot(fields, i)
    window = use.exposure.open_window(plate, real(THICKNESS), fields, 0, wp.vec2d())
    pose = use.core_surface.pose_of(surface, position[i], attitude[i], velocity, omega)
    actual[i] = use.footprint.footprint_of(surface, plate, window, pose, dt)
    for k in range(surface.rings):
        ring = use.core_surface.ring_at(surface, pose, k)
        immersed[i, k] = 0
        for j in range(surface.around):
            patch = use.core_surface.patch_at(
                pose, ring, surface.cosine[k * surface.around + j], surface.sine[k * surface.around + j]
            )
            if use.core_surface.immersed_area(pose, ring, patch, window.thickness, dt) > real(0.0):
                immersed[i, k] = 1
            cell = use.plate_grid.cell_at(window, patch.y, patch.z)
            rows[i, k, j] = (cell.index - window.first) // window.cells_z
            columns[i, k, j] = (cell.index - window.first) % window.cells_z


FOOTPRINTS = VARIANT.kernel(footprints)


def footprints_of(
    poses: dict[str, Array], cells: tuple[int, int], device: str, *, velocity: Any, omega: Any = (0.0, 0.0, 0.0)
) -> tuple[Any, ...]:
    """Footprints of a cone in windows of cells_y × cells_z, and the kernel's results for each ring and patch."""
    surface = surface_of(Surface, CONE, 12, 24, device)
    plate = plate_of(Plate, np.ones((1, 1)), (CELL, CELL), CELL, device)
    count, per_patch = len(poses["position"]), (surface.rings, surface.around)
    outputs = [
        poisoned(count, Footprint, device),
        poisoned((count, surface.rings), wp.int32, device),
        *(poisoned((count, *per_patch), wp.int32, device) for _ in range(2)),
    ]
    inputs = [
        surface,
        plate,
        poisoned_fields(Fields, count, *cells, device),
        wp.array(poses["position"], dtype=vec3, device=device),
        wp.array(poses["attitude"], dtype=quat, device=device),
        vec3(*velocity),
        vec3(*omega),
        1e-6,
    ]
    wp.launch(FOOTPRINTS, count, inputs=inputs, outputs=outputs, device=device)
    return tuple(array.numpy() for array in outputs)


def test_footprint_holds_every_cell_and_ring_that_a_step_touches(device: str) -> None:
    count, cells = 200, 240
    motion = {"velocity": (600.0, 300.0, -90.0), "omega": (2e4, 5e4, -3e4)}
    actual, immersed, rows, columns = footprints_of(astride(count), (cells, cells), device, **motion)
    ring = np.arange(immersed.shape[1])
    within = (ring >= actual["first_ring"][:, None]) & (ring <= actual["last_ring"][:, None])
    touched = immersed == 1
    some = touched.any(axis=1)
    assert some.sum() > count / 2
    assert not (touched & ~within).any()
    assert actual["inside"].all()
    for cell, low, high in ((rows, "y_low", "y_high"), (columns, "z_low", "z_high")):
        lowest = np.where(touched, cell.min(axis=2), cells).min(axis=1)
        highest = np.where(touched, cell.max(axis=2) + 1, -1).max(axis=1)
        assert (actual["box"][low] <= lowest)[some].all()
        assert (actual["box"][high] >= highest)[some].all()
        # And it is not far too large: every step works on the whole box.
        tight = some & (touched.sum(axis=1) == within.sum(axis=1))
        assert tight.sum() > count / 10
        assert (actual["box"][low] >= lowest - 4)[tight].all()
        assert (actual["box"][high] <= highest + 4)[tight].all()
