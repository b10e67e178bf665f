"""Numbers between hit points: planes through neighbours, and the likelihood that they give."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import multivariate_normal

from warpimpact.identification.aim import POINT_STEPS, HitPoints
from warpimpact.identification.between import changes
from warpimpact.identification.likelihood import Compared, Data
from warpimpact.identification.measured import Observation
from warpimpact.records.exit import OUTCOME_VARIABLES
from warpimpact.records.outcomes import Outcomes
from warpimpact.scene import Shots, Symmetry

CELL = np.array([8e-3, 16e-3])
MIRRORED = (Symmetry(1, 1, False), Symmetry(-1, 1, False), Symmetry(1, -1, False), Symmetry(-1, -1, False))
VELOCITY = Observation("residual_velocity", None, None, 700.0, 8.0)
YAW = Observation("yaw", 0, 0.05, np.radians(20.0), np.radians(3.0))
PITCH = Observation("pitch", 0, 0.05, np.radians(-4.0), np.radians(3.0))


def aim_of(count: int, shift: float = 0.3) -> HitPoints:
    """Points of a quarter of the cell with their mirror images."""
    part = 0.5 * CELL
    places = np.mod(np.arange(count)[:, None] * POINT_STEPS + shift, 1.0) * part
    hits = (places[:, None] * [[one.along_y, one.along_z] for one in MIRRORED]).reshape(-1, 2)
    zeros = np.zeros(len(hits))
    shots = Shots(
        **dict.fromkeys(("velocity", "obliquity", "azimuth", "pitch", "yaw", "spin"), zeros),
        hit_y=hits[:, 0],
        hit_z=hits[:, 1],
    )
    return HitPoints(shots, MIRRORED, np.ones((1, len(hits))), 8, (part, CELL))


def outcomes_at(hits: np.ndarray) -> Outcomes:
    """A core that is slower over the middle of the cell, and turns away from it."""
    y, z = np.sin(2.0 * np.pi * hits / CELL).T
    columns = {str(one): np.zeros(len(hits)) for one in OUTCOME_VARIABLES}
    columns |= {"residual_velocity": 700.0 - 40.0 * (np.cos(2.0 * np.pi * hits / CELL)).sum(axis=1)}
    columns |= {"yaw": 1.5 * y[:, None], "pitch": 0.5 * z[:, None], "status": np.zeros(len(hits), dtype=np.int8)}
    return Outcomes(**columns)


def test_numbers_change_as_their_map_does() -> None:
    aim = aim_of(512)
    hits = aim.hits[0]
    outcomes = outcomes_at(hits)
    computed = np.stack([one.of(outcomes) for one in (VELOCITY, YAW, PITCH)], axis=-1)
    found = changes((VELOCITY, YAW, PITCH), aim, computed[None])[0]
    angle, per_part = 2.0 * np.pi * hits[:: len(MIRRORED)] / CELL, np.pi / np.sqrt(12.0 * 512)
    expected = np.stack([40.0 * np.sin(angle), 1.5 * np.cos(angle) * [1.0, 0.0]], axis=-1) * per_part
    missed = np.abs(found[:, :, :2] - expected) / (per_part * np.array([40.0, 1.5]))
    assert missed.max() < 0.15
    assert np.quantile(missed, 0.95) < 0.05
    gone = computed.copy()
    gone[np.hypot(*hits.T) > 1e-3] = np.nan  # few are left: no plane goes through one or two
    assert np.isfinite(changes((VELOCITY, YAW, PITCH), aim, gone[None])).all()
    assert (changes((VELOCITY,), replace(aim, part=None), computed[None, :, :1]) == 0.0).all()


def test_angles_change_the_short_way_round() -> None:
    aim = aim_of(64)
    outcomes = outcomes_at(aim.hits[0])
    yaw = outcomes.yaw[None]
    beyond = np.where(yaw > 0.5, yaw - 2.0 * np.pi, yaw)
    assert changes((YAW,), aim, beyond) == pytest.approx(changes((YAW,), aim, yaw))


def test_the_likelihood_has_the_covariance_of_the_neighbourhood() -> None:
    aim, data = aim_of(32), Data((VELOCITY, YAW, PITCH), None)
    compared = Compared.of(data, aim, outcomes_at(aim.hits[0]))
    scales = {"velocity": np.array([5.0]), "angle": np.radians([4.0])}
    found = compared.score(scales, np.random.default_rng(0)).log_likelihood[0]
    variances = data.spread(scales)[0] ** 2
    densities = []
    for point, row in enumerate(compared.missed[0]):
        symmetry = MIRRORED[point % 4]
        turned = compared.changes[0, point // 4] * [1.0, symmetry.along_y, symmetry.along_z]
        densities.append(multivariate_normal(np.zeros(3), np.diag(variances) + turned.T @ turned).pdf(row))
    assert found == pytest.approx(np.log(np.mean(densities)))


def test_few_points_do_the_work_of_many() -> None:
    """64 points with their neighbourhoods are nearer to 16,384 points than 64 points alone."""
    data = Data((VELOCITY, YAW, PITCH), None)
    scales = {"velocity": np.array([1.0]), "angle": np.radians([1.0])}

    def log_likelihood(aim: HitPoints) -> float:
        compared = Compared.of(data, aim, outcomes_at(aim.hits[0]))
        return float(compared.score(scales, np.random.default_rng(0)).log_likelihood[0])

    many = log_likelihood(replace(aim_of(16384), part=None))
    few = [aim_of(64, shift) for shift in (0.1, 0.25, 0.5, 0.75)]
    smooth, plain = (
        np.array([log_likelihood(one) for one in ones]) - many
        for ones in (few, [replace(one, part=None) for one in few])
    )
    assert np.abs(smooth).max() < 0.5
    assert np.sqrt((smooth**2).mean()) < 0.5 * np.sqrt((plain**2).mean())
