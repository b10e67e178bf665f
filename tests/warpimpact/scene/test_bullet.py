"""Bullets: their outline, and walls that give them their mass."""

from typing import Any

import numpy as np
import pytest

from warpimpact import OgiveCore
from warpimpact.catalogue.catalogue import Catalogue, flow_entry
from warpimpact.catalogue.entries import Threat
from warpimpact.scene.bullet import Bullet

CORE = OgiveCore(diameter=6e-3, crh=3.0, length=20e-3, mass=4e-3)
MATERIALS = {"jacket": flow_entry("jacket brass").flow, "filler": flow_entry("lead").flow}
OUTLINE = {"mass": 7.5e-3, "diameter": 7.82e-3, "crh": 7.0, "core_place": 3e-3}


def bullet_of(**changes: Any) -> Bullet:
    return Bullet(**OUTLINE | MATERIALS | changes)


def test_a_nose_is_a_tangent_ogive_from_its_flat() -> None:
    """R² = (R − d/2 + f)² + n², and the slope at the shoulder is nought."""
    bullet = bullet_of()
    radius, nose = 7.0 * 7.82e-3, bullet.nose_length
    assert radius**2 == pytest.approx((radius - 0.5 * 7.82e-3 + 1e-3) ** 2 + nose**2)
    assert bullet.outline(np.array([0.0, nose, 2.0 * nose])) == pytest.approx([1e-3, 3.91e-3, 3.91e-3])
    assert bullet.outline(np.array([nose - 1e-5]))[0] == pytest.approx(3.91e-3, abs=1e-9)


def test_a_wall_follows_from_the_mass_or_the_densities_from_both() -> None:
    """A heavier bullet has less brass, as lead is denser."""
    walls = [bullet_of(mass=mass).closed(CORE) for mass in (7.4e-3, 7.5e-3)]
    for bullet, mass in zip(walls, (3.4e-3, 3.5e-3), strict=True):
        assert sum(bullet.masses(CORE)) == pytest.approx(mass, rel=1e-6)
    assert walls[0].wall is not None
    assert walls[1].wall is not None
    assert walls[0].wall > walls[1].wall + 1e-5
    given = bullet_of(mass=7.6e-3, wall=walls[1].wall).closed(CORE)
    assert sum(given.masses(CORE)) == pytest.approx(3.6e-3, rel=1e-6)
    assert [flow.density for flow in given.flows] == pytest.approx([10660 * 3.6 / 3.5, 8520 * 3.6 / 3.5], rel=1e-4)


@pytest.mark.parametrize(
    ("changes", "sentence"),
    [
        ({"mass": 20e-3}, r"bullet.mass: got 20 g, but with walls of 0.1 mm and more it is between .* and .* g$"),
        ({"wall": 0.5e-3, "mass": 9.5e-3}, r"bullet.mass: got 9.5 g, but .* have .* g; leave out bullet.wall$"),
        ({"diameter": 6.05e-3}, "bullet: got a core that is wider than the bullet"),
        ({"core_place": 0.0, "crh": 20.0}, "bullet: got a core that is wider than the bullet, or reaches out"),
    ],
)
def test_a_bullet_that_does_not_close_is_refused(changes: dict[str, float], sentence: str) -> None:
    with pytest.raises(ValueError, match=sentence):
        bullet_of(**changes).closed(CORE)


def test_bullets_of_the_catalogue_close_with_walls_of_drawn_jackets() -> None:
    """Jackets are drawn to walls of 0.43 to 0.81 mm."""
    bullets = {name: threat for name, threat in Catalogue().all(Threat).items() if threat.bullet}
    assert len(bullets) >= 2
    for name, threat in bullets.items():
        assert threat.bullet is not None
        assert threat.bullet.mass == threat.bullet_mass
        assert "bullet" in threat.known | threat.assumed
        closed = threat.bullet.model_copy(update=MATERIALS).closed(threat.core)
        assert closed.wall is not None
        assert 0.43e-3 < closed.wall < 0.81e-3, name
