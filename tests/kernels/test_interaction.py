"""The contact law: when a surface element touches, what it carries, and that it takes power (docs/model.md §4)."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
import warp as wp
from numpy.typing import NDArray

from warpimpact.kernels import interaction, structs
from warpimpact.kernels.variant import Variant

from .probes import poisoned

Array = NDArray[np.float64]

VARIANT = Variant(double=True, rate_dependent=True)
real = VARIANT.real
use, struct = VARIANT.use(interaction), structs.build(VARIANT)
Law, Contact = struct.Law, struct.Contact

ONSET = 4.0
SINGLE = Variant()
single = SINGLE.use(interaction)
SingleLaw = structs.build(SINGLE).Law


def law(
    law: Law,
    closing: wp.array(dtype=real),
    variation: wp.array(dtype=real),
    speed: wp.array(dtype=real),
    contacts: wp.array(dtype=Contact),
) -> None:
    i = wp.tid()
    actual = use.interaction.contact_of(law, closing[i], variation[i], speed[i])
    touching = closing[i] + actual.shift * variation[i] * variation[i]
    actual.slope = use.interaction.steady_slope(law, actual.share, actual.slope, touching)
    contacts[i] = actual


def onset(law: Law, dt: real, velocity: wp.array(dtype=real), impact: real, onsets: wp.array(dtype=real)) -> None:
    i = wp.tid()
    onsets[i] = use.interaction.onset_speed(law, dt, velocity[i], impact)


def exponential(law: SingleLaw, x: wp.array(dtype=wp.float32), values: wp.array(dtype=wp.float32)) -> None:
    i = wp.tid()
    values[i] = single.interaction.remaining(law, x[i])


LAW, ONSET_SPEED = VARIANT.kernel(law), VARIANT.kernel(onset)
EXPONENTIAL = SINGLE.kernel(exponential)


def filled(struct: Any) -> Any:
    law = struct()
    law.onset = ONSET
    return law


def applied(
    closing: Any,
    device: str,
    *,
    variation: Any = 0.0,
    speed: Any = 1.0,
    steadied: float = 0.0,
) -> SimpleNamespace:
    given = [np.array(a) for a in np.broadcast_arrays(closing, variation, speed)]
    contacts = poisoned(len(given[0]), Contact, device)
    law = filled(Law)
    law.steadied = steadied
    inputs = [law, *(wp.array(a, dtype=real, device=device) for a in given)]
    wp.launch(LAW, len(given[0]), inputs=inputs, outputs=[contacts], device=device)
    actual = contacts.numpy()
    return SimpleNamespace(fraction=actual["share"], rise=actual["slope"], shift=actual["shift"])


VARIATIONS = pytest.mark.parametrize("variation", [1e-3 * ONSET, 0.5 * ONSET, 50.0 * ONSET])


def spread(closing: Array, variation: float) -> tuple[Array, Array, Array]:
    """Places within patches, in halves of them, their closing speeds and their shares of contact; [patches, places]."""
    places = (2 * (np.arange(4000) + 0.5) / 4000 - 1)[None, :]
    speeds = closing[:, None] + variation * places
    return places, speeds, (speeds / ONSET).clip(0, 1)


@VARIATIONS
def test_share_of_a_patch_is_the_mean_of_its_parts(variation: float, device: str) -> None:
    # Mean of min(1, x/w) for x > 0 over x = closing ± variation. The numerical mean is good to 1/4000 of the slope; the
    # threshold is 1e-5 of a speed of 1 m/s.
    closing = (variation + ONSET) * np.linspace(-2, 2, 401)
    _, _, shares = spread(closing, variation)
    fraction = applied(closing, device, variation=variation).fraction
    np.testing.assert_allclose(fraction, shares.mean(axis=1), rtol=0, atol=1e-5 / ONSET + 1e-6 * variation / ONSET)


def test_small_variation_leaves_the_ramp_as_it_is(device: str) -> None:
    closing = ONSET * np.linspace(-1, 2, 301)
    for variation in (0.0, 1e-30, 1e-12):
        actual = applied(closing, device, variation=variation)
        np.testing.assert_allclose(actual.fraction, (closing / ONSET).clip(0, 1), rtol=0, atol=1e-5)
        assert np.abs(actual.shift * variation).max() < 1e-9


def test_wall_that_slides_along_itself_does_not_touch(device: str) -> None:
    # Rounding in float32 gives v_p·n of some 1e-7 of the speed (docs/model.md §4: a small stated threshold).
    speed = 800.0
    fraction = applied(speed * np.array([1e-7, -1e-7, 1e-6, 1e-4]), device, speed=speed).fraction
    np.testing.assert_array_equal(fraction[:3], 0.0)
    assert 0 < fraction[3] < 0.1 * speed / ONSET


def test_onset_follows_the_step_and_a_core_that_slows_down(device: str) -> None:
    law = filled(Law)
    law.onset_jump, law.onset_limit = 1e7, 0.02
    velocity = np.array([800.0, 100.0, 1.0, 0.0])
    onsets = poisoned(4, real, device)
    inputs = [law, 2e-7, wp.array(velocity, dtype=real, device=device), 800.0]
    wp.launch(ONSET_SPEED, 4, inputs=inputs, outputs=[onsets], device=device)
    # The jump times the step, at most 2 % of the velocity, at least 1e-4 of the impact velocity.
    np.testing.assert_allclose(onsets.numpy(), [2.0, 2.0, 0.08, 0.08], rtol=1e-12)
    # The law's own where that is wider.
    law.onset_share = 0.005
    wp.launch(ONSET_SPEED, 4, inputs=inputs, outputs=[onsets], device=device)
    np.testing.assert_allclose(onsets.numpy(), [4.0, 2.0, 0.08, 0.08], rtol=1e-12)


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
    actual, expected = single_exponential(x, device).astype(float), np.exp(x.astype(float))
    # x log2(e) is rounded: half a unit of the last place of up to 126 is 126 ln 2 × 2^-24 at the ends.
    bound = 3e-7 + np.abs(x) * 2.0**-23
    assert (np.abs(actual / expected - 1) < bound).all()
    assert single_exponential(np.array([0.0, -0.0]), device).tolist() == [1.0, 1.0]
