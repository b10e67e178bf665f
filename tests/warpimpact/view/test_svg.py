"""Drawings as SVG: to scale, the second axis up, and nothing of a plate beyond its frame."""

from xml.etree import ElementTree

import numpy as np

from warpimpact.view import svg

HALF = np.array([4e-3, 2e-3])
HOLE = np.array([(-1e-3, 1e-3), (1e-3, 1e-3), (0.0, 5e-3)])


def test_a_path_is_in_millimetres_and_counts_downwards() -> None:
    assert svg.path([HOLE, np.empty((0, 2))]) == "M-1.000,-1.000L1.000,-1.000L0.000,-5.000Z"


def test_rings_are_separated_by_nan() -> None:
    first, second = np.array([0.0, 1.0, np.nan, 2.0]), np.array([0.0, 1.0, np.nan, 3.0])
    assert [ring.tolist() for ring in svg.rings(first, second)] == [[[0.0, 0.0], [1.0, 1.0]], [[2.0, 3.0]]]
    assert svg.rings(np.empty(0), np.empty(0)) == []


def test_a_drawing_has_its_scale_and_its_label() -> None:
    root = ElementTree.fromstring(svg.drawing([svg.plate([HOLE], -HALF, HALF)], -HALF, HALF, "a < b", scale=10.0))
    assert root.attrib["aria-label"] == "a < b"
    assert (root.attrib["width"], root.attrib["height"]) == ("80", "40")
    assert root.attrib["viewBox"] == "-4.0000 -2.0000 8.0000 4.0000"
    (shape,) = root
    assert shape.attrib["d"].count("Z") == 2  # the plate, and its hole
