"""Kinds of files: by what each is recognised, which command writes it and which takes it."""

from __future__ import annotations

from collections.abc import Collection
from pathlib import Path
from typing import NamedTuple

import netCDF4

from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.scene.toml_text import parsed, read_text

_BEGIN_NETCDF = b"\x89HDF", b"CDF"


class Kind(NamedTuple):
    """A kind of file.

    Attributes:
        what: what it is, as a phrase.
        use: which command takes it.
        marks: names of variables, groups and attributes, or of tables, of which such a file has one and others none.
    """

    what: str
    use: str
    marks: Collection[str] = ()


_MAP = "warpimpact inspect, plot, report, export, compare and replay take it"
RESULT = Kind("a result, as warpimpact run and limit write", _MAP)
POSTERIOR = Kind(
    "a posterior, as warpimpact identify writes",
    "warpimpact report takes it, and warpimpact run with --posterior",
    ("posterior", attr.EFFECTIVE),
)
FRONT = Kind(
    "a search for designs, as warpimpact optimise writes", "warpimpact report and design take it", (attr.DESIGN_FILE,)
)
FIRING = Kind(
    "a firing test, as warpimpact test writes",
    "its text and figure stand beside it; xarray.open_dataset reads it",
    (attr.FIRING_TEST,),
)
HISTORY = Kind("the history of a single hit, as warpimpact replay writes", "warpimpact export takes it", (v.TIME,))
SWEEP = Kind(
    "a sweep, as warpimpact sweep writes",
    "its points, in the folder beside it, are results, as is what isel(INPUT=0) chooses of it",
    (attr.SWEEP,),
)
_NETCDF = (POSTERIOR, FRONT, FIRING, HISTORY)

DESIGN = Kind("a design file", "warpimpact optimise takes it", ("variables", "objectives"))
FIT = Kind("a fit", "warpimpact identify takes it", ("shot", "prior"))
TEST = Kind("a firing test", "warpimpact test takes it", ("target", "procedure"))
ENTRIES = Kind("a catalogue", "warpimpact catalogue --file takes it", ("threat", "material"))
CAMPAIGN = Kind("a campaign", "warpimpact run takes it", ("hits", "sweep"))
_TEXTS = (DESIGN, FIT, TEST, ENTRIES, CAMPAIGN)


def is_netcdf(path: Path) -> bool:
    """Whether a file begins as netCDF files do; it is a regular one."""
    with path.open("rb") as file:
        return file.read(4).startswith(_BEGIN_NETCDF)


def kind_of(path: Path) -> Kind | None:
    """What a regular file is, by its contents; None of one that is nothing known.

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
        if (kind := _marked(names, _NETCDF)) is not None:
            return kind
        if v.STATUS not in file.variables:
            return None
        return SWEEP if attr.SWEEP in names and file.variables[v.STATUS].dimensions != (v.HIT,) else RESULT


def kind_of_tables(tables: Collection[str]) -> Kind | None:
    """What a TOML file with these tables is."""
    return _marked(tables, _TEXTS)


def told(path: Path | str, kind: Kind, wanted: str) -> str:
    """That a file is another one than is wanted, and what takes it."""
    return f"{path}: is {kind.what}, not {wanted}; {kind.use}"


def _marked(names: Collection[str], kinds: Collection[Kind]) -> Kind | None:
    return next((kind for kind in kinds if {*kind.marks} & {*names}), None)
