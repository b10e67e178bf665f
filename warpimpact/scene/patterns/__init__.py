"""Hole patterns: one hole shape on a lattice, or polygons, repeated periodically (docs/model.md §3)."""

from typing import Annotated

from pydantic import Field

from .geometry import WHOLE_CELL as WHOLE_CELL
from .pattern import HolePlace, LatticePattern, NoPattern, Pattern
from .polygons import PolygonsPattern
from .shapes import CirclePattern, EllipsePattern, HexagonPattern, SlotPattern, SquarePattern, TrianglePattern

AnyPattern = Annotated[
    SlotPattern
    | CirclePattern
    | TrianglePattern
    | SquarePattern
    | HexagonPattern
    | EllipsePattern
    | NoPattern
    | PolygonsPattern,
    Field(discriminator="shape"),
]
