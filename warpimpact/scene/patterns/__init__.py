"""Hole patterns: one hole shape on a lattice, or any mask, repeated periodically (docs/model.md §3)."""

from typing import Annotated

from pydantic import Field

from .lattice import LatticePattern, Place
from .mask import MaskPattern
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
    | MaskPattern,
    Field(discriminator="shape"),
]
