"""What stands over a figure: the title of the campaign, and the names of the catalogue with their evidence."""

from __future__ import annotations

from textwrap import wrap
from typing import TYPE_CHECKING

from warpimpact.results import attributes as attr

if TYPE_CHECKING:
    import xarray

_WIDTH = 80


def heading(dataset: xarray.Dataset, width: int = _WIDTH) -> str:
    """The title of a result; below it a line of at most `width` characters, or several, for every name."""
    return "\n".join([dataset.attrs.get(attr.TITLE, ""), *names(dataset, width)])


def names(dataset: xarray.Dataset, width: int = _WIDTH) -> list[str]:
    """Lines of the names of the catalogue that a result has, each with the state of its evidence."""
    lines = dataset.attrs.get(attr.EVIDENCE, "").splitlines()
    return [part for line in lines if not line.startswith(attr.NOT_TESTED) for part in wrap(line, width)]
