"""The mesh of a layer: edges on the holes, symmetry, runs of elements."""

import numpy as np
import pytest

from warpimpact import CirclePattern, OgiveCore, Plate, SlotPattern
from warpimpact.continuum.meshing import Encounter, SheetMesh, runs_of
from warpimpact.continuum.one_hit import volumes_of
from warpimpact.scene import NoPattern

SLOTS = SlotPattern(length=12e-3, width=4e-3, spacing=(8e-3, 16e-3), staggered=True)
ROUND = CirclePattern(diameter=5e-3, spacing=(9e-3, 9e-3))
CORE = OgiveCore(diameter=6e-3, crh=3, length=20e-3, mass=4e-3)
ALONG_X = np.array([1.0, 0.0, 0.0])


def plate_of(pattern: SlotPattern | CirclePattern | NoPattern) -> Plate:
    return Plate(thickness=4e-3, resistance=2.6e9, pattern=pattern)


def mesh_of(pattern: SlotPattern | CirclePattern | NoPattern, hit: tuple[float, float] = (0.0, 0.0)) -> SheetMesh:
    return Encounter(CORE, plate_of(pattern), hit, 0.0, 0.5e-3, 1.4).mesh(0.0 * ALONG_X, 800.0 * ALONG_X, ALONG_X)


@pytest.mark.parametrize("pattern", [SLOTS, ROUND])
def test_nodes_at_a_hole_lie_on_its_edge(pattern: SlotPattern | CirclePattern) -> None:
    hit = (1.3e-3, 0.7e-3)
    mesh = mesh_of(pattern, hit)
    around = np.pad(mesh.solid, 1, mode="edge").astype(int)
    count = around[:-1, :-1] + around[1:, :-1] + around[:-1, 1:] + around[1:, 1:]
    fine = (np.abs(mesh.y) < 7e-3) & (np.abs(mesh.z) < 7e-3)
    adjacent = (count > 0) & (count < 4) & fine
    assert adjacent.sum() > 50
    separation = np.abs(plate_of(pattern).edge_distance(mesh.y[adjacent] + hit[0], mesh.z[adjacent] + hit[1]))
    assert np.quantile(separation, 0.95) < 0.02 * mesh.spacing
    assert separation.max() < mesh.spacing


def test_the_mass_of_the_mesh_is_that_of_the_plate_with_its_holes() -> None:
    mesh = mesh_of(ROUND)
    volume, _ = volumes_of(mesh)
    half = float(mesh.y.max())
    whole = (volume.sum() / 4e-3) / (2.0 * half) ** 2
    assert whole == pytest.approx(1.0 - ROUND.open_area, abs=0.05)  # the mesh ends somewhere in a cell
    assert mesh_of(NoPattern()).solid.all()


def test_a_mirrored_plate_has_the_mirrored_mesh() -> None:
    mesh = mesh_of(SLOTS)
    assert mesh.y == pytest.approx(-mesh.y[::-1], abs=1e-12)
    assert mesh.z == pytest.approx(-mesh.z[:, ::-1], abs=1e-12)
    assert np.array_equal(mesh.solid, mesh.solid[::-1, ::-1])


def test_runs_hold_all_elements_in_whole_lanes() -> None:
    present = np.zeros(200, dtype=bool)
    present[[3, 4, 9, 60, 61, 199]] = True
    runs = runs_of(present, 1000)
    inside = np.concatenate([np.arange(*run) for run in runs])
    assert {*(1000 + np.flatnonzero(present))} <= {*inside.tolist()}
    assert len(inside) == len({*inside.tolist()})
    assert (np.diff(runs, axis=1) % 8 == 0).all()
    assert not len(runs_of(np.zeros(5, dtype=bool), 0))
