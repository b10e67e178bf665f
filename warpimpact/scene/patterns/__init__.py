"""Hole patterns: one hole shape on a lattice, free forms, or any mask, repeated periodically (docs/model.md §3)."""

from typing import Annotated

from pydantic import Field

from .free_form import LevelSetPattern, Supershape, SupershapePattern, Wave
from .lattice import LatticePattern, Place
from .mask import MaskPattern
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
    | MaskPattern,
    Field(discriminator="shape"),
]
