"""The contact law: when a surface element touches, what it carries, and that it takes power (docs/model.md §4)."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray

from warpimpact.kernels import interaction
from warpimpact.kernels.variant import Variant

from .probes import poisoned, unit_vectors

Array = NDArray[np.float64]

VARIANT = Variant(double=True, rate_dependent=True)
real = VARIANT.real
laws = interaction.build(VARIANT)
Law = laws.Law

FRICTION, ONSET = 0.05, 4.0
A0, A1, A2 = 2.6e9, 4.5e6, 7850.0
STATIC, SINGLE = Variant(double=True), Variant()
static = interaction.build(STATIC)
StaticLaw = static.Law
singles = interaction.build(SINGLE)
SingleLaw = singles.Law


def law(
    law: Law,
    closing: wp.array(dtype=real),
    variation: wp.array(dtype=real),
    sliding: wp.array(dtype=real),
    speed: wp.array(dtype=real),
    exposures: wp.array(dtype=real),
    fractions: wp.array(dtype=real),
    stresses: wp.array(dtype=real),
    slopes: wp.array(dtype=real),
    frictions: wp.array(dtype=real),
    remaining: wp.array(dtype=real),
) -> None:
    i = wp.tid()
    rate = laws.onset_rate(law, real(1.0) / (variation[i] + real(1.0e-30)))
    fractions[i] = laws.contact_fraction(closing[i], variation[i], rate, speed[i])
    stresses[i] = laws.normal_stress(law, closing[i])
    slopes[i] = laws.stress_slope(law, closing[i])
    frictions[i] = laws.friction_per_speed(law, sliding[i], speed[i])
    remaining[i] = laws.remaining(law, exposures[i])


def static_law(law: StaticLaw, closing: wp.array(dtype=real), stresses: wp.array(dtype=real)) -> None:
    i = wp.tid()
    stresses[i] = static.normal_stress(law, closing[i])


def onset(law: Law, dt: real, velocity: wp.array(dtype=real), impact: real, onsets: wp.array(dtype=real)) -> None:
    i = wp.tid()
    onsets[i] = laws.onset_speed(law, dt, velocity[i], impact)


def exponential(law: SingleLaw, x: wp.array(dtype=wp.float32), values: wp.array(dtype=wp.float32)) -> None:
    i = wp.tid()
    values[i] = singles.remaining(law, x[i])


LAW, ONSET_SPEED = VARIANT.kernel(law), VARIANT.kernel(onset)
STATIC_LAW, EXPONENTIAL = STATIC.kernel(static_law), SINGLE.kernel(exponential)


def filled(struct: Any) -> Any:
    law = struct()
    law.a0, law.a1, law.a2, law.friction, law.onset = A0, A1, A2, FRICTION, ONSET
    law.decay_rate = np.log(0.8) / 1e-6
    return law


def applied(
    closing: Any, device: str, *, variation: Any = 0.0, sliding: Any = 0.0, speed: Any = 1.0, exposure: Any = 0.0
) -> SimpleNamespace:
    given = [np.array(a) for a in np.broadcast_arrays(closing, variation, sliding, speed, exposure)]
    names = ("fraction", "stress", "slope", "friction", "remaining")
    outputs = {name: poisoned(len(given[0]), real, device) for name in names}
    inputs = [filled(Law), *(wp.array(a, dtype=real, device=device) for a in given)]
    wp.launch(LAW, len(given[0]), inputs=inputs, outputs=list(outputs.values()), device=device)
    return SimpleNamespace(**{name: array.numpy() for name, array in outputs.items()})


def random_elements(count: int = 2000) -> tuple[Array, Array, Array]:
    """Closing speeds from far below to far above the onset, sliding speeds and speeds of their elements."""
    rng = np.random.default_rng(1)
    normals = unit_vectors(rng, count)
    velocities = unit_vectors(rng, count) * 10.0 ** rng.uniform(-3, 3, (count, 1))
    closing = (normals * velocities).sum(axis=1)
    sliding = np.linalg.norm(velocities - closing[:, None] * normals, axis=1)
    return closing, sliding, np.linalg.norm(velocities, axis=1)


def test_contact_sets_in_over_the_onset_speed(device: str) -> None:
    closing = ONSET * np.array([-100.0, -1.0, 0.0, 0.25, 0.5, 1.0, 1.01, 100.0])
    fraction = applied(closing, device, speed=np.maximum(np.abs(closing), 1e-3)).fraction
    np.testing.assert_allclose(fraction, [0, 0, 0, 0.25, 0.5, 1, 1, 1], rtol=0, atol=1.1e-5)


@pytest.mark.parametrize("variation", [0.5 * ONSET, ONSET, 50.0 * ONSET])
def test_patch_touches_with_the_part_that_closes_in(variation: float, device: str) -> None:
    # Closing speeds evenly over closing ± variation, at least as wide as the onset: the share of them above 0.
    closing = variation * np.linspace(-2, 2, 401)
    spread = closing[:, None] + variation * (2 * (np.arange(4000) + 0.5) / 4000 - 1)
    fraction = applied(closing, device, variation=variation).fraction
    # 1/4000 of the numerical average, and the threshold, 1e-5 of a speed of 1 m/s, over the range of 2 × variation.
    np.testing.assert_allclose(fraction, (spread > 0).mean(axis=1), atol=1 / 4000 + 1e-5 / variation)


def test_slightly_curved_patch_sets_in_over_the_onset_speed_from_where_its_first_part_closes_in(device: str) -> None:
    variation = 0.1 * ONSET
    closing = ONSET * np.linspace(-1, 2, 301)
    fraction = applied(closing, device, variation=variation).fraction
    np.testing.assert_allclose(fraction, ((closing + variation) / ONSET).clip(0, 1), atol=1e-5)


def test_wall_that_slides_along_itself_does_not_touch(device: str) -> None:
    # Rounding in float32 gives v_p·n of some 1e-7 of the speed (docs/model.md §4: a small stated threshold).
    speed = 800.0
    fraction = applied(speed * np.array([1e-7, -1e-7, 1e-6, 1e-4]), device, sliding=speed, speed=speed).fraction
    np.testing.assert_array_equal(fraction[:3], 0.0)
    assert 0 < fraction[3] < 0.1 * speed / ONSET


def test_contact_grows_with_the_closing_speed(device: str) -> None:
    for variation in (0.0, 1.0, 3.0):
        fraction = applied(np.linspace(-5, 6, 200), device, variation=variation, speed=10.0).fraction
        assert (np.diff(fraction) >= 0).all()
        assert fraction[0] == 0.0
        assert fraction[-1] == 1.0


def test_onset_follows_the_step_and_a_core_that_slows_down(device: str) -> None:
    law = filled(Law)
    law.onset_jump, law.onset_limit = 1e7, 0.02
    velocity = np.array([800.0, 100.0, 1.0, 0.0])
    onsets = poisoned(4, real, device)
    inputs = [law, 2e-7, wp.array(velocity, dtype=real, device=device), 800.0]
    wp.launch(ONSET_SPEED, 4, inputs=inputs, outputs=[onsets], device=device)
    # The jump times the step, at most 2 % of the velocity, at least 1e-4 of the impact velocity.
    np.testing.assert_allclose(onsets.numpy(), [2.0, 2.0, 0.08, 0.08], rtol=1e-12)


def test_stress_is_the_quadratic_of_the_closing_speed(device: str) -> None:
    closing, sliding, speed = random_elements()
    found = applied(closing, device, sliding=sliding, speed=speed)
    np.testing.assert_allclose(found.stress, np.polynomial.Polynomial([A0, A1, A2])(closing), rtol=1e-12)
    np.testing.assert_allclose(found.slope, A1 + 2 * A2 * closing, rtol=1e-9)


def test_friction_is_its_share_of_the_normal_stress_against_the_sliding(device: str) -> None:
    closing, sliding, speed = random_elements()
    friction = applied(closing, device, sliding=sliding, speed=speed).friction
    np.testing.assert_allclose(friction * sliding, FRICTION, rtol=1e-12)


def test_friction_vanishes_without_sliding(device: str) -> None:
    # What rounding leaves of the sliding velocity, some 1e-16 of the speed, must not carry friction.
    friction = applied(np.full(1, 800.0), device, sliding=1e-13, speed=800.0).friction
    assert 0.0 < friction[0] * 1e-13 < 1e-9
    still = applied(np.zeros(1), device, speed=0.0)
    np.testing.assert_array_equal(still.fraction, 0.0)


def test_exposure_degrades_once_per_interval(device: str) -> None:
    remaining = applied(np.ones(4), device, exposure=[0.0, 1e-6, 2e-6, 0.5e-6]).remaining
    np.testing.assert_allclose(remaining, [1.0, 0.8, 0.64, np.sqrt(0.8)], rtol=1e-13)


def test_variant_without_rate_has_the_static_stress(device: str) -> None:
    closing, _, _ = random_elements()
    stresses = poisoned(len(closing), real, device)
    inputs = [filled(StaticLaw), wp.array(closing, dtype=real, device=device)]
    wp.launch(STATIC_LAW, len(closing), inputs=inputs, outputs=[stresses], device=device)
    np.testing.assert_array_equal(stresses.numpy(), A0)


def single_exponential(x: Array, device: str) -> Array:
    """e^x in single precision, computed as the share that is left at a rate of 1/s."""
    law = SingleLaw()
    law.decay_rate = 1.0
    values = poisoned(len(x), wp.float32, device)
    given = wp.array(x, dtype=wp.float32, device=device)
    wp.launch(EXPONENTIAL, len(x), inputs=[law, given], outputs=[values], device=device)
    return values.numpy()


def test_single_precision_exponential_is_numpy_s(device: str) -> None:
    x = np.concatenate([np.linspace(-87.3, 87.3, 200_001), np.linspace(-1e-3, 1e-3, 2001)]).astype(np.float32)
    found, expected = single_exponential(x, device).astype(float), np.exp(x.astype(float))
    # x log2(e) is rounded: half a unit of the last place of up to 126 is 126 ln 2 × 2^-24 at the ends.
    bound = 3e-7 + np.abs(x) * 2.0**-23
    assert (np.abs(found / expected - 1) < bound).all()
    assert single_exponential(np.array([0.0, -0.0]), device).tolist() == [1.0, 1.0]


def test_single_precision_exponential_is_monotonic_bounded_and_keeps_nan(device: str) -> None:
    small, large = np.float32(2.0**-126), np.float32(2.0**126)
    x = np.array([-np.inf, -3e38, -1e30, -1e4, -87.5], dtype=np.float32)
    found = single_exponential(x, device)
    assert (found <= 1.0001 * small).all()  # on CUDA the library's goes on to zero
    assert (found >= 0.0).all()
    found = single_exponential(-x, device)
    assert (found >= 0.9999 * large).all()
    nan = np.array([np.nan, -np.nan], dtype=np.float32)
    assert np.isnan(single_exponential(nan, device)).all()
    steps = single_exponential(np.linspace(-90, 1, 100_001).astype(np.float32), device)
    assert (np.diff(steps) >= -3e-7 * steps[1:]).all()
