"""The fragments of a core: what is connected, which one leads, where the core broke."""

import numpy as np
import pytest

from warpimpact.continuum.fragments import CoreElements, Fragments

MASS = np.full((10, 2, 2), 1.0e-4)
"""Of a bar of ten planes, whose nose is in the last one [kg]."""
STATION = 1.0e-3 * (9.5 - np.arange(10))
"""Behind the nose [m]."""


def bar(*gaps: int, forward: tuple[float, ...] = (800.0,) * 10) -> CoreElements:
    """A bar without some planes, whose planes have velocities [m/s]."""
    alive = np.ones(MASS.shape, dtype=bool)
    alive[list(gaps)] = False
    return CoreElements(alive, MASS, np.broadcast_to(np.array(forward)[:, None, None], MASS.shape))


def test_a_whole_core_is_one_fragment() -> None:
    whole = Fragments.of(bar(), STATION, 5.0, 1.0)
    assert (whole.number, whole.broken, whole.share) == (1, False, 1.0)
    assert (whole.front, whole.rear) == pytest.approx((0.0, 10.0e-3))
    assert whole.mass == pytest.approx(4.0e-3)
    assert whole.eroded == pytest.approx(0.0, abs=1e-12)


def test_a_core_that_lost_its_tip_is_not_broken() -> None:
    blunt = Fragments.of(bar(8, 9), STATION, 5.0, 1.0)
    assert (blunt.number, blunt.broken) == (1, False)
    assert (blunt.share, blunt.eroded) == pytest.approx((0.8, 0.8e-3))
    assert (blunt.front, blunt.rear) == pytest.approx((2.0e-3, 10.0e-3))


def test_a_core_in_two_parts_is_broken_where_they_parted() -> None:
    parts = Fragments.of(bar(3), STATION, 5.0, 1.0)
    assert parts.broken
    assert (parts.number, parts.mass, parts.eroded) == pytest.approx((2, 2.4e-3, 0.4e-3))
    assert parts.section == pytest.approx(STATION[3])
    assert (parts.front, parts.rear) == pytest.approx((0.0, 6.0e-3))


def test_the_stretch_of_a_fragment_has_the_planes_that_are_mostly_its_own() -> None:
    """A quarter of the last plane is left, and three quarters of the fourth one."""
    frayed = bar(0, 1, 2)
    frayed.alive[9, 1, :], frayed.alive[9, 0, 1], frayed.alive[3, 1, 1] = False, False, False
    parts = Fragments.of(frayed, STATION, 5.0, 1.0)
    assert (parts.front, parts.rear) == pytest.approx((1.0e-3, 7.0e-3))


def test_elements_that_share_an_edge_alone_are_two_fragments() -> None:
    core = bar()
    core.alive[4, 0, :], core.alive[5, 1, :] = False, False
    assert len(core.labels()[1]) == 2


def test_the_fragment_with_the_most_momentum_leads_unless_it_is_a_splinter() -> None:
    """The larger part rests in the plate."""
    stuck = bar(6, forward=(0.0,) * 6 + (500.0,) * 4)
    labels, masses = stuck.labels()
    assert (labels[7:] == 1).all()
    assert masses == pytest.approx([1.2e-3, 2.4e-3])
    splinter = bar(8, forward=(-1.0,) * 9 + (900.0,))
    splinter.alive[9, 1, :], splinter.alive[9, 0, 1] = False, False
    assert splinter.labels()[1] == pytest.approx([3.2e-3, 1.0e-4])
