"""Channels of earlier cores: how wide a wall is, and which cores are drawn section by section."""

import numpy as np
import pytest
import warp as wp

from warpimpact.kernels import channel, core_surface, earlier, exposure, structs
from warpimpact.kernels.variant import Variant
from warpimpact.scene import ConeCore

from .probes import plate_of, poisoned_fields, surface_of
from .test_earlier import CELL, CELLS_Y, CELLS_Z, NODES, SLOT, SLOTS, scratch

VARIANT = Variant(double=True, burst=True)
use, struct = VARIANT.use(channel, core_surface, earlier, exposure), structs.build(VARIANT)
Plate, Fields, Earlier, Surface, Touches = struct.Plate, struct.Fields, struct.Earlier, struct.Surface, struct.Touches
real, vec3, quat = VARIANT.real, VARIANT.vec3, VARIANT.quat
THICKNESS = 4.0e-3
OUTSIDE = [0.0, 0.025, 0.05, 1.0]
"""Places outside of a channel [cells]."""


def touch_walls(plate: Plate, fields: Fields, earlier: Earlier, touches: Touches) -> None:
    """One touch in a channel that is everywhere as deep as at its first node."""
    fields = use.exposure.fields_of_slot(fields, SLOT)
    window = use.exposure.open_window(plate, wp.float64(THICKNESS), fields, 0, wp.vec2d())
    window = use.channel.open_window(earlier, window, wp.float64(THICKNESS), 0)
    touches.place[0] = window.channel
    use.channel.spare(fields, window, touches, 0, 1)


walls = VARIANT.kernel(touch_walls)


def follow_core(
    plate: Plate,
    fields: Fields,
    earlier: Earlier,
    surface: Surface,
    position: vec3,
    attitude: quat,
    drawn: wp.array(dtype=real),
) -> None:
    """The channel on the front face after the core of the first shot was there once."""
    fields = use.exposure.fields_of_slot(fields, SLOT)
    window = use.exposure.open_window(plate, wp.float64(THICKNESS), fields, 0, wp.vec2d())
    window = use.channel.open_window(earlier, window, wp.float64(THICKNESS), 0)
    use.earlier.begin(earlier, SLOT, 0)
    place = use.earlier.place_of(earlier, SLOT, 0, 0)
    use.channel.begin(earlier, window, place)
    pose = use.core_surface.pose_of(surface, position, attitude, vec3(), vec3())
    use.channel.follow(earlier, surface, window, place, pose)
    for k in range(NODES):
        drawn[k] = earlier.inside[place.channel + k]


followed = VARIANT.kernel(follow_core)


def test_the_wall_of_a_channel_is_a_twentieth_of_a_cell_wide(device: str) -> None:
    plate = plate_of(Plate, np.ones((4, 4)), (1e-3, 1e-3), CELL, device)
    found = []
    for outside in OUTSIDE:
        fields, touches = poisoned_fields(Fields, SLOTS, CELLS_Y, CELLS_Z, device), Touches()
        fields.channel_nodes = 2 * NODES
        fields.channel = wp.full(2 * SLOTS * NODES, -outside * CELL, dtype=real, device=device)
        for name in ("area", "slope", "gain"):
            setattr(touches, name, wp.ones(1, dtype=real, device=device))
        for name in ("ahead", "y", "z"):
            setattr(touches, name, wp.zeros(1, dtype=real, device=device))
        touches.place = wp.zeros(1, dtype=wp.int32, device=device)
        wp.launch(walls, 1, inputs=[plate, fields, scratch(device), touches], device=device)
        assert touches.area.numpy() == touches.slope.numpy() == touches.gain.numpy()
        found.append(touches.area.numpy().item())
    assert found == pytest.approx([0.0, 0.5, 1.0, 1.0], abs=1e-12)


@pytest.mark.parametrize(("cosine", "at_once"), [(0.51, False), (0.49, True)])
def test_a_core_at_more_than_60_degrees_is_drawn_node_by_node(cosine: float, at_once: bool, device: str) -> None:
    """Sections of a steeper core wait until the next one is known not to hold them."""
    plate = plate_of(Plate, np.ones((4, 4)), (1e-3, 1e-3), CELL, device)
    core = ConeCore(diameter=1e-3, length=6e-3, cone_length=1e-3, mass=1e-3)
    drawn = wp.zeros(NODES, dtype=real, device=device)
    half = 0.5 * np.arccos(cosine)
    inputs = [plate, poisoned_fields(Fields, SLOTS, CELLS_Y, CELLS_Z, device), scratch(device)]
    inputs += [surface_of(Surface, core, 6, 8, device), vec3(), quat(0.0, 0.0, np.sin(half), np.cos(half))]
    wp.launch(followed, 1, inputs=inputs, outputs=[drawn], device=device)
    assert bool((drawn.numpy() > 0.0).any()) == at_once
