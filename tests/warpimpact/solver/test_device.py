"""Kernels made ready on a device."""

import warp as wp

from warpimpact.kernels.variant import Variant
from warpimpact.solver.device import find_device, load


def test_kernel_is_compiled_for_the_launches_to_come_and_for_nothing_else() -> None:
    def one(values: wp.array(dtype=wp.float32)) -> None:
        values[wp.tid()] = 1.0

    kernel, device = Variant().kernel(one), find_device("cpu")
    load(kernel, device)
    values = wp.zeros(3, dtype=wp.float32, device=device)
    wp.launch(kernel, 3, outputs=[values], device=device)
    assert values.numpy().tolist() == [1.0, 1.0, 1.0]
    assert len(kernel.module.execs) == 1
