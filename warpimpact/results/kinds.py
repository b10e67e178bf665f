"""All kinds of files, and how a file's kind is recognised."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path

import netCDF4

from warpimpact.results import attributes as attr
from warpimpact.results import checks, firing, front, posterior_file, replayed_hit
from warpimpact.results import variables as v
from warpimpact.results.kind import Kind
from warpimpact.scene.toml_text import parsed, read_text

_BEGIN_NETCDF = b"\x89HDF", b"CDF"


NETCDF = (posterior_file.POSTERIOR, front.FRONT, firing.FIRING, replayed_hit.HISTORY)
"""Kinds that are recognised by their marks. A map of hits and a sweep are recognised by the variable of statuses."""

DESIGN = Kind("a design file", "warpimpact optimise takes it", ("variables", "objectives"))
FIT = Kind("a fit", "warpimpact identify takes it", ("shot", "prior"))
TEST = Kind("a test file", "warpimpact test takes it", ("target", "procedure"))
ENTRIES = Kind("a catalogue", "warpimpact catalogue --file takes it", ("threat", "material"))
CAMPAIGN = Kind("a campaign", "warpimpact run takes it", ("hits", "sweep"))
_TEXT_KINDS = (DESIGN, FIT, TEST, ENTRIES, CAMPAIGN)


def is_netcdf(path: Path) -> bool:
    """Whether a path is a regular file that begins as netCDF files do."""
    with path.open("rb") as file:
        return file.read(4).startswith(_BEGIN_NETCDF)


def kind_of(path: Path) -> Kind | None:
    """The kind of a regular file, by its contents; None if it is no known kind.

    Raises:
        Exception: of any class, for a damaged netCDF file.
    """
    if not is_netcdf(path):
        try:
            return kind_of_tables(parsed(read_text(path), path.name))
        except ValueError:
            return None
    with netCDF4.Dataset(path) as file:
        names = {*file.variables, *file.groups, *file.ncattrs()}
        if (kind := _marked(names, NETCDF)) is not None:
            return kind
        if v.STATUS not in file.variables:
            return None
        is_sweep = attr.SWEEP in names and file.variables[v.STATUS].dimensions != (v.HIT,)
        return checks.SWEEP if is_sweep else checks.RESULT


def kind_of_tables(tables: Collection[str]) -> Kind | None:
    """The kind of a TOML file with these tables."""
    return _marked(tables, _TEXT_KINDS)


def _marked(names: Collection[str], kinds: Collection[Kind]) -> Kind | None:
    return next((kind for kind in kinds if {*kind.marks} & {*names}), None)
