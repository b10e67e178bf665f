"""Jacket and filler around a rigid core: mass, seam, momentum, energy, company (docs/continuum.md)."""

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from warpimpact import FiniteElements, Plate, Record, Scene, simulate
from warpimpact.catalogue.catalogue import Catalogue, flow_entry
from warpimpact.catalogue.entries import Threat
from warpimpact.continuum import meshing
from warpimpact.continuum.many_hits import ManyHits
from warpimpact.continuum.meshing import volumes_of
from warpimpact.continuum.one_hit import OneHit
from warpimpact.continuum.replay import replay_continuum
from warpimpact.kernels.status import Status
from warpimpact.scene.bullet import Bullet

from .scenes import PAPER_CORE as CORE
from .scenes import shots_at
from .test_continuum import STEEL

PLATE = Plate(thickness=4e-3, resistance=2.6e9)
SCENE = Scene(core=CORE, target=PLATE, record=Record(standoffs=(0.05,)))
SHOT = shots_at(obliquity=7.0, yaw=3.0, spin=1.7e4)
MATERIALS = {"jacket": flow_entry("jacket brass").flow, "filler": flow_entry("lead").flow}


def bullet() -> Bullet:
    known = Catalogue().named(Threat, "P80").bullet
    assert known is not None
    return known.model_copy(update=MATERIALS)


@pytest.fixture(autouse=True)
def _rough(monkeypatch: pytest.MonkeyPatch) -> None:
    """Patches and meshes of the bullet that are too rough for a result: what these tests show does not depend on it."""
    monkeypatch.setattr(meshing, "FINE", 1.7)
    monkeypatch.setattr(meshing, "PATCH", 4.0)
    monkeypatch.setattr("warpimpact.continuum.bullet_mesh.AROUND", 16)
    monkeypatch.setattr("warpimpact.continuum.bullet_mesh.ALONG", 1.2e-3)


SETTINGS = {"flows": (STEEL,), "spacing": 1e-3, "bullet": bullet(), "double": True}


def hit_of(**settings: Any) -> OneHit:
    return FiniteElements(**SETTINGS | settings).prepare_hit(SCENE, SHOT, 0, {})


def vectors(hit: OneHit, name: str) -> NDArray[np.float64]:
    """Vectors of all nodes, shape [3, nodes]."""
    return np.asarray(getattr(hit.mesh, name).numpy().reshape(3, -1), dtype=np.float64)


def momentum(hit: OneHit) -> NDArray[np.float64]:
    """Of core, bullet and plate [N s]."""
    masses = np.divide(1.0, hit.inverse_mass, out=np.zeros(hit.inverse_mass.shape), where=hit.inverse_mass > 0.0)
    core = hit.start.body.mass * np.array(hit.flight["state"]["velocity"])
    return np.asarray(core + (masses * vectors(hit, "velocity")).sum(axis=1))


def test_a_bullet_has_its_mass_and_flies_as_its_core() -> None:
    hit = hit_of()
    mesh, own = hit.meshes[0], slice(hit.firsts[0], hit.firsts[0] + hit.meshes[0].nodes)
    inverse = hit.inverse_mass[own]
    assert (1.0 / inverse[inverse > 0.0]).sum() == pytest.approx(9.7e-3 - CORE.mass, rel=1e-6)
    assert (volumes_of(mesh)[0][mesh.present.ravel()] > 0.0).all()
    moving = vectors(hit, "velocity")[:, own].T
    away = vectors(hit, "position")[:, own].T - hit.start.position
    axis = hit.start.arriving[2]
    assert moving == pytest.approx(hit.start.velocity + 1.7e4 * np.cross(axis, away), abs=1e-3)
    assert mesh.position[0].max() == pytest.approx(0.0, abs=1e-5)  # its foremost point touches the plate


def test_a_ring_has_no_seam() -> None:
    """Jacket and filler that are pushed outwards evenly stay round, across the seam, too; far from the plate."""
    hit = FiniteElements(**SETTINGS).prepare_hit(SCENE, shots_at(), 0, {})
    mesh, own = hit.meshes[0], slice(hit.firsts[0], hit.firsts[0] + hit.meshes[0].nodes)
    outwards = mesh.position[1:] / np.hypot(*mesh.position[1:])
    hit.mesh.velocity.numpy().reshape(3, -1)[1:, own] = 100.0 * outwards.reshape(2, -1)
    hit.advance(20)
    y, z = vectors(hit, "position")[1:, own].reshape(2, *mesh.present.shape)
    radius, before = np.hypot(y, z)[:, :, 10:20], np.hypot(*mesh.position[1:, 0, :, 10:20])
    assert np.ptp(radius, axis=0) == pytest.approx(0.0, abs=1e-12)
    assert (radius[0] > before + 1e-6).all()


def test_all_momentum_stays_where_the_plate_floats() -> None:
    """To 1e-9 of the bullet's, while its nose is crushed."""
    hit = hit_of(friction=0.1)
    hit.mesh.impedance.zero_()
    before = momentum(hit)
    hit.advance(600)
    assert hit.mesh.touched.numpy().min() > 0.0  # the core touches the plate, and the bullet has
    assert hit.energies.taken > 20.0
    assert momentum(hit) == pytest.approx(before, abs=1e-9 * before[0])
    assert hit.energies.imbalance < 0.02


def test_a_bullet_has_the_same_bits_alone_and_in_company(device: str) -> None:
    """And the numbers of the march of one hit, to the rounding of other sums."""
    one = hit_of()
    alone, other = (FiniteElements(**SETTINGS).prepare_hit(SCENE, SHOT, 0, {}, device) for _ in range(2))
    rough = FiniteElements(**SETTINGS | {"friction": 0.2}).prepare_hit(SCENE, SHOT, 0, {}, device)
    one.advance(60)
    ManyHits([alone]).advance(60)
    ManyHits([rough, other]).advance(60)
    assert alone.flight == other.flight
    assert alone.mesh.contacts.pushing.numpy().any()
    assert vectors(alone, "position") == pytest.approx(vectors(one, "position"), abs=1e-12)
    for name in ("position", "stress", "alive", "work"):
        assert np.array_equal(getattr(alone.mesh, name).numpy(), getattr(other.mesh, name).numpy()), name


def test_a_whole_bullet_leaves_faster_than_its_core(monkeypatch: pytest.MonkeyPatch) -> None:
    """Jacket and filler bring energy: published limits of whole bullets are below those of bare cores. Its replay has
    the same bits, and shows jacket and filler."""
    monkeypatch.setattr("warpimpact.continuum.one_hit.LARGEST_HOURGLASS_SHARE", 1.0)
    methods = [FiniteElements(flows=(STEEL,), spacing=1e-3, bullet=of) for of in (None, bullet())]
    bare, whole = (simulate(SCENE, shots_at(), method=method, device="cpu") for method in methods)
    assert bare.status[0] == whole.status[0] == Status.PERFORATED
    assert whole.residual_velocity[0] > bare.residual_velocity[0] + 5.0
    assert whole.energy_imbalance[0] < 0.02
    replayed = replay_continuum(SCENE, shots_at(), methods[1])
    assert replayed.outcomes.residual_velocity[0] == whole.residual_velocity[0]
    assert replayed.deformed is not None
    assert replayed.deformed.position[0, :, 0].min() < -25e-3
    assert not replayed.deformed.left[-1].all()
