"""The contact law: when a surface element touches, what it carries, and that it takes power (MODEL.md §4)."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import warp as wp
from numpy.typing import NDArray

from warpimpact.kernels import interaction
from warpimpact.kernels.variant import Variant

from .probes import poisoned, unit_vectors

Array = NDArray[np.float64]

VARIANT = Variant(double=True, rate_dependent=True)
real, vec3 = VARIANT.real, VARIANT.vec3
laws = interaction.build(VARIANT)
Law = laws.Law

FRICTION, ONSET = 0.05, 4.0
A0, A1, A2 = 2.6e9, 4.5e6, 7850.0
STATIC = Variant(double=True, rubs=False)
frictionless = interaction.build(STATIC)
FrictionlessLaw = frictionless.Law


def law(
    law: Law,
    normals: wp.array(dtype=vec3),
    velocities: wp.array(dtype=vec3),
    exposures: wp.array(dtype=real),
    fractions: wp.array(dtype=real),
    stresses: wp.array(dtype=real),
    slopes: wp.array(dtype=real),
    directions: wp.array(dtype=vec3),
    remaining: wp.array(dtype=real),
) -> None:
    i = wp.tid()
    closing, speed = wp.dot(velocities[i], normals[i]), wp.length(velocities[i])
    fractions[i] = laws.contact_fraction(law, closing, speed)
    stresses[i] = laws.normal_stress(law, closing)
    slopes[i] = laws.stress_slope(law, closing)
    directions[i] = laws.traction_direction(law, normals[i], velocities[i], closing, speed)
    remaining[i] = laws.remaining(law, exposures[i])


def plain_law(
    law: FrictionlessLaw,
    normals: wp.array(dtype=vec3),
    velocities: wp.array(dtype=vec3),
    stresses: wp.array(dtype=real),
    directions: wp.array(dtype=vec3),
) -> None:
    i = wp.tid()
    closing, speed = wp.dot(velocities[i], normals[i]), wp.length(velocities[i])
    stresses[i] = frictionless.normal_stress(law, closing)
    directions[i] = frictionless.traction_direction(law, normals[i], velocities[i], closing, speed)


LAW, PLAIN_LAW = VARIANT.kernel(law), STATIC.kernel(plain_law)


def filled(struct: Any) -> Any:
    law = struct()
    law.a0, law.a1, law.a2, law.friction, law.onset = A0, A1, A2, FRICTION, ONSET
    law.decay_rate = np.log(0.8) / 1e-6
    return law


def applied(normals: Array, velocities: Array, device: str, exposures: Array | None = None) -> SimpleNamespace:
    count = len(normals)
    exposures = np.zeros(count) if exposures is None else exposures
    outputs = {
        name: poisoned(count, vec3 if name == "direction" else real, device)
        for name in ("fraction", "stress", "slope", "direction", "remaining")
    }
    inputs = [
        filled(Law),
        wp.array(normals, dtype=vec3, device=device),
        wp.array(velocities, dtype=vec3, device=device),
        wp.array(exposures, dtype=real, device=device),
    ]
    wp.launch(LAW, count, inputs=inputs, outputs=list(outputs.values()), device=device)
    return SimpleNamespace(**{name: array.numpy() for name, array in outputs.items()})


def random_elements(count: int = 2000) -> tuple[Array, Array, Array]:
    """Unit normals, velocities, and closing speeds from far below to far above the onset."""
    rng = np.random.default_rng(1)
    normals = unit_vectors(rng, count)
    velocities = unit_vectors(rng, count) * 10.0 ** rng.uniform(-3, 3, (count, 1))
    return normals, velocities, (normals * velocities).sum(axis=1)


def at_closing(closing: Array, sliding: float, device: str) -> SimpleNamespace:
    """Elements that face along x, close at given speeds [m/s] and slide along y."""
    count = len(closing)
    normals = np.tile([1.0, 0.0, 0.0], (count, 1))
    velocities = np.stack([closing, np.full(count, sliding), np.zeros(count)], axis=1)
    return applied(normals, velocities, device)


def test_contact_sets_in_over_the_onset_speed(device: str) -> None:
    closing = ONSET * np.array([-100.0, -1.0, 0.0, 0.25, 0.5, 1.0, 1.01, 100.0])
    fraction = at_closing(closing, 0.0, device).fraction
    np.testing.assert_allclose(fraction, [0, 0, 0, 0.25, 0.5, 1, 1, 1], rtol=0, atol=1.1e-5)


def test_wall_that_slides_along_itself_does_not_touch(device: str) -> None:
    # Rounding in float32 gives v_p·n of some 1e-7 of the speed (MODEL.md §4: a small stated threshold).
    speed = 800.0
    found = at_closing(speed * np.array([1e-7, -1e-7, 1e-6, 1e-4]), speed, device)
    np.testing.assert_array_equal(found.fraction[:3], 0.0)
    assert 0 < found.fraction[3] < 0.1 * speed / ONSET


def test_contact_grows_with_the_closing_speed(device: str) -> None:
    fraction = at_closing(np.linspace(-1, 6, 200), 10.0, device).fraction
    assert (np.diff(fraction) >= 0).all()
    assert fraction[0] == 0.0
    assert fraction[-1] == 1.0


def test_stress_is_the_quadratic_of_the_closing_speed(device: str) -> None:
    normals, velocities, closing = random_elements()
    found = applied(normals, velocities, device)
    np.testing.assert_allclose(found.stress, np.polynomial.Polynomial([A0, A1, A2])(closing), rtol=1e-12)
    np.testing.assert_allclose(found.slope, A1 + 2 * A2 * closing, rtol=1e-9)


def test_traction_is_the_normal_stress_and_friction_against_the_sliding(device: str) -> None:
    normals, velocities, closing = random_elements()
    direction = applied(normals, velocities, device).direction
    np.testing.assert_allclose((direction * normals).sum(axis=1), -1.0, rtol=1e-12)
    tangential = direction + normals
    sliding = velocities - closing[:, None] * normals
    expected = -FRICTION * sliding / np.linalg.norm(sliding, axis=1, keepdims=True)
    np.testing.assert_allclose(tangential, expected, atol=1e-12)


def test_traction_takes_power_from_the_core(device: str) -> None:
    normals, velocities, closing = random_elements()
    found = applied(normals, velocities, device)
    power = found.fraction * found.stress * (found.direction * velocities).sum(axis=1)
    assert (power <= 0).all()
    assert (power[closing > ONSET] < 0).all()
    assert (power[closing < 0] == 0).all()


def test_friction_vanishes_without_sliding(device: str) -> None:
    normals = unit_vectors(np.random.default_rng(2), 500)
    direction = applied(normals, 800.0 * normals, device).direction
    # What rounding leaves of the sliding velocity, some 1e-16 of the speed, must not carry friction.
    np.testing.assert_allclose(direction, -normals, atol=1e-9)
    still = applied(normals, np.zeros((500, 3)), device)
    np.testing.assert_array_equal(still.fraction, 0.0)


def test_exposure_degrades_once_per_interval(device: str) -> None:
    normals = np.tile([1.0, 0.0, 0.0], (4, 1))
    remaining = applied(normals, normals, device, exposures=np.array([0.0, 1e-6, 2e-6, 0.5e-6])).remaining
    np.testing.assert_allclose(remaining, [1.0, 0.8, 0.64, np.sqrt(0.8)], rtol=1e-13)


def test_variant_without_rate_and_friction_is_the_static_stress_along_the_normal(device: str) -> None:
    normals, velocities, _ = random_elements()
    count = len(normals)
    stresses, directions = poisoned(count, real, device), poisoned(count, vec3, device)
    inputs = [filled(FrictionlessLaw), *(wp.array(a, dtype=vec3, device=device) for a in (normals, velocities))]
    wp.launch(PLAIN_LAW, count, inputs=inputs, outputs=[stresses, directions], device=device)
    np.testing.assert_array_equal(stresses.numpy(), A0)
    np.testing.assert_array_equal(directions.numpy(), -normals)
