"""Exponential and logarithm of the continuum against those of numpy."""

from typing import Any

import numpy as np
import pytest
import warp as wp

from warpimpact.kernels.continuum import transcendental
from warpimpact.kernels.variant import Variant


@pytest.mark.parametrize("double", [False, True])
def test_exponential_and_logarithm_are_those_of_numpy(double: bool) -> None:
    variant = Variant(double=double)
    use, real = transcendental.build(variant.real), variant.real

    def evaluate(
        x: wp.array(dtype=real), y: wp.array(dtype=real), powers: wp.array(dtype=real), logs: wp.array(dtype=real)
    ):
        k = wp.tid()
        powers[k] = use.exp(x[k])
        logs[k] = use.log(y[k])

    x = np.concatenate([np.linspace(-60.0, 60.0, 2001), np.linspace(-1e-3, 1e-3, 101)])
    y = np.geomspace(1e-20, 1e20, len(x))
    given: Any = [wp.array(values, dtype=real, device="cpu") for values in (x, y)]
    powers, logs = (wp.zeros(len(x), dtype=real, device="cpu") for _ in range(2))
    wp.launch(variant.kernel(evaluate), len(x), inputs=[*given, powers, logs], device="cpu")
    digits = 1e-14 if double else 4e-7
    x, y = (values.numpy().astype(np.float64) for values in given)
    assert np.allclose(powers.numpy(), np.exp(x), rtol=digits, atol=0.0)
    assert np.allclose(logs.numpy(), np.log(y), rtol=digits, atol=digits)
