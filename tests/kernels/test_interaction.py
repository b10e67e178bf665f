"""The stress on the device is that on the host, from which limit velocities of solid plates are integrated."""

from typing import Any

import numpy as np
import pytest
import warp as wp

from warpimpact.kernels import interaction, structs
from warpimpact.kernels.variant import Variant
from warpimpact.scene import FreeSurface, Hits, Impact, Interaction, Plate, Scene, make_shots
from warpimpact.scene.interaction import normal_stress
from warpimpact.solver.resolution import materials_of

from .probes import CONE, poisoned, records

SPEED = 800.0


@pytest.mark.parametrize("free_surface", [None, FreeSurface(reach=0.7, attack=1.45)])
def test_host_and_device_have_the_same_stress(device: str, free_surface: FreeSurface | None) -> None:
    law = Interaction(static=0.9, linear=0.3, quadratic=1.1, free_surface=free_surface)
    plate = Plate(thickness=6e-3, resistance=1.7e9, density=7850.0)
    variant = Variant(double=True, rate_dependent=True, free_surface=free_surface is not None)
    on_device, Law, real = interaction.build(variant), structs.build(variant).Law, variant.real

    def stresses(laws: wp.array(dtype=Law), closing: variant.reals, radius: variant.reals, out: variant.reals) -> None:
        i = wp.tid()
        out[i] = on_device.normal_stress(laws[0], closing[i], radius[i])

    shots = make_shots(Impact(velocity=SPEED), Hits(sampling="grid", count=1), plate)
    (material,) = materials_of(Scene(core=CONE, target=plate, interaction=law), shots)
    members: dict[str, Any] = {name: getattr(material, name) for name in ("a0", "a1", "a2", "per_reach")}
    attack = 0.0 if free_surface is None else free_surface.attack
    laws = records(Law, device, **members, attack=attack, per_speed=1.0 / SPEED)
    closing, radius = (grid.ravel() for grid in np.meshgrid(np.linspace(0.0, 1.2 * SPEED, 25), [0.0, 1e-3, 4e-3]))
    out = poisoned(len(closing), real, device)
    inputs = [laws, *(wp.array(values, dtype=real, device=device) for values in (closing, radius))]
    wp.launch(variant.kernel(stresses), len(closing), inputs=inputs, outputs=[out], device=device)
    expected = normal_stress(law, plate, plate.resistance, closing, closing / SPEED, radius)
    np.testing.assert_allclose(out.numpy(), expected, rtol=4e-15)
