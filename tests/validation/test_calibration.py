"""Posteriors are right on average: a small version of calibrate_fit.py."""

from warpimpact.identification.fit_file import fit_from

from .calibrate_fit import FIT, HERE, calibrate


def test_posteriors_are_calibrated() -> None:
    """Ranks are uniform, and 90 % intervals cover 90 %."""
    fit = fit_from(FIT.replace("hits = 64", "hits = 32"), "fit.toml", HERE)
    found = calibrate(fit, data_sets=60, library=512, device="cpu")
    assert found.uniformity.min() > 0.001
    # Binomial: 54 of 60 expected; 45 or fewer have a probability of 3e-4.
    assert (60 * found.coverage).min() > 45
    assert found.recovery[0] > 0.7  # the resistance
