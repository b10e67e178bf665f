"""Pictures of a hit: which cells lie in elements and in a rigid core, in which plane, and when."""

import numpy as np
import pytest

from warpimpact import FiniteElements, Plate, Scene
from warpimpact.catalogue.catalogue import flow_entry
from warpimpact.continuum.meshing import BodyMesh
from warpimpact.continuum.pictures import Frames, across_of, paint
from warpimpact.records.variables import INSTANTS, PictureLabel, picture_axes
from warpimpact.scene import PolynomialCore, Shots

CORE = PolynomialCore(coefficients=(3.0e-4, 0.24, -5.29), length=27.86e-3, mass=4.0e-3)
METHOD = FiniteElements(flows=(flow_entry("ARMOX560T Johnson-Cook").flow,), spacing=2e-3)


def test_a_cell_has_the_code_of_the_element_that_it_lies_in() -> None:
    """Elements of a sheared and turned block, some of which failed, leave no gap and nothing beyond."""
    numbers = np.random.default_rng(1)
    edges = 8.0 * np.linalg.qr(numbers.normal(size=(3, 3)))[0] @ np.array([[1.0, 0.3, 0.1], [0, 1.0, 0.2], [0, 0, 1.0]])
    nodes = np.moveaxis(np.indices((5, 5, 5)), 0, -1) - 2.0
    present = np.zeros((5, 5, 5), dtype=bool)
    present[:4, :4, :4] = numbers.random((4, 4, 4)) < 0.7
    mesh = BodyMesh(
        np.moveaxis(nodes @ edges.T, -1, 0) + np.array([30.2, 30.1, 0.3])[:, None, None, None], present, 1.0
    )
    elements, labels = np.flatnonzero(present), np.zeros((61, 61), dtype=np.int8)
    paint(labels, mesh.position.reshape(3, -1)[:, mesh.corners(elements)], np.full(len(elements), 4, dtype=np.int8))
    row, column = np.indices(labels.shape)
    away = np.stack([column - 30.2, row - 30.1, np.full(labels.shape, -0.3)], axis=-1)
    place = np.floor(away @ np.linalg.inv(edges).T + 2.0).astype(int)
    within = ((place >= 0) & (place < 4)).all(axis=-1)
    filled = within & present[tuple(np.moveaxis(np.clip(place, 0, 3), -1, 0))]
    assert 0 < filled.sum() < within.sum()
    np.testing.assert_array_equal(labels == 4, filled)


def test_pictures_show_the_section_of_a_core_and_what_is_left_of_its_plate() -> None:
    scene = Scene(core=CORE, target=Plate(thickness=4e-3, resistance=2.6e9))
    shots = Shots(*(np.array([value]) for value in (0.0, 0.0, 825.0, 0.0, 0.0, 0.0, 0.1, 0.0)))
    hit, frames = METHOD.prepare_hit(scene, shots, 0, {}), Frames()
    frames.take(hit)
    ended = hit.march(follow=frames.take)
    picture = frames.picture(CORE)
    cell = np.diff(picture_axes(CORE)[1])[0]
    station = np.linspace(0.0, CORE.length, 2001)
    section = 2.0 * np.trapezoid(CORE.radius(station), station)
    assert (picture.label == PictureLabel.CORE).sum(axis=(1, 2)) * cell**2 == pytest.approx(section, rel=0.02)
    plate = picture.label == PictureLabel.PLATE
    assert plate[0].sum() * cell == pytest.approx(4e-3 * plate.shape[1], rel=0.05)
    on_the_line = plate[:, plate.shape[1] // 2].any(axis=1)
    assert (on_the_line[0], on_the_line[4]) == (True, False)
    end = float(ended.flight["time"])
    assert picture.time == pytest.approx(end * np.array(INSTANTS), abs=0.08 * end)
    assert abs(picture.across @ np.array([0.0, 0.0, 1.0])) < 1e-6  # a core with yaw turns in the x-y plane
    assert picture.place[4, 0] == pytest.approx(float(ended.flight["state"]["position"][0]))


@pytest.mark.parametrize(
    ("flight", "axis", "across"),
    [
        pytest.param((1, 0, 0), (0.8, 0, -0.6), (0, 0, 1), id="a core that turned"),
        pytest.param((0.8, 0.6, 0), (0.8, 0.6, 0), (-0.6, 0.8, 0), id="plane of incidence"),
        pytest.param((1, 0, 0), (1, 0, 0), (0, 0, 1), id="normal incidence"),
    ],
)
def test_the_plane_is_that_in_which_the_core_turned(flight: tuple, axis: tuple, across: tuple) -> None:
    assert across_of(np.array(flight, dtype=float), np.array(axis, dtype=float)) == pytest.approx(across)
