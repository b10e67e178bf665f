"""Masks: any holes, as square cells that are hole or material (docs/model.md §3)."""

from functools import cached_property
from typing import Literal, Self

from pydantic import model_validator

from ..files import InputFile
from ..units import PositiveLength
from .cells import CellsPattern
from .mask_files import read_mask
from .pattern import BoolArray


class MaskPattern(CellsPattern):
    """Square cells of `cell_size` [m] from a file, repeated periodically, the mask centred on the origin.

    A .npy file holds a two-dimensional array, axis 0 along y and axis 1 along z: zero is hole, one other
    value is material. In a PNG image y runs from left to right and z from bottom to top: black is hole, one
    other grey is material. An SVG drawing has the same orientation and must have a width and a height in mm. Filled
    shapes are holes, and a cell is hole if its middle lies in one.

    Attributes:
        shape: "mask".
        file: PNG image, .npy array or SVG drawing.
        cell_size: side of a cell [m].
    """

    shape: Literal["mask"] = "mask"
    file: InputFile
    cell_size: PositiveLength

    @model_validator(mode="after")
    def _is_a_mask(self) -> Self:
        _ = self.material
        return self

    @cached_property
    def material(self) -> BoolArray:
        """Where a cell is material, bool of shape [cells along y, cells along z], read-only."""
        material = read_mask(self.file, self.cell_size)
        material.setflags(write=False)
        return material

    @property
    def side(self) -> float:
        return self.cell_size
