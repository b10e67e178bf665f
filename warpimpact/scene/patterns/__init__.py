"""Hole patterns: one hole shape on a lattice, or free forms in a cell, repeated periodically (docs/model.md §3)."""

from typing import Annotated

from pydantic import Field

from .free_form import LevelSetPattern, PolygonsPattern, Supershape, SupershapePattern, Wave
from .lattice import HolePlace, LatticePattern
from .pattern import WHOLE_CELL as WHOLE_CELL
from .pattern import BoolArray, NoPattern, Pattern
from .shapes import CirclePattern, EllipsePattern, HexagonPattern, SlotPattern, SquarePattern, TrianglePattern

AnyPattern = Annotated[
    SlotPattern
    | CirclePattern
    | TrianglePattern
    | SquarePattern
    | HexagonPattern
    | EllipsePattern
    | NoPattern
    | SupershapePattern
    | LevelSetPattern
    | PolygonsPattern,
    Field(discriminator="shape"),
]
