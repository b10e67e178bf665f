"""Kinds of files, how they are recognised, and the commands that take them."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from typing import NamedTuple

from warpimpact.records import attributes as attr
from warpimpact.records import variables as v


class Kind(NamedTuple):
    """A kind of netCDF file.

    Attributes:
        name: name with its article.
        mark: name and version, the value of the global attribute `attr.KIND`.
        maker: the command that writes it.
        use: the commands that take it.
        needed: variables and global attributes that it must have to be read as a table of hits.
    """

    name: str
    mark: str
    maker: str
    use: str
    needed: Sequence[str] = ()


_OF_HITS = (*v.COORDINATES, *v.VARIABLES, attr.PLATE_PERIOD)
HIT_MAP = Kind(
    "a map of hits",
    "hit map 5",
    "warpimpact run or limit",
    "warpimpact inspect, plot, report, export, compare and replay take it",
    _OF_HITS,
)
SWEEP = Kind(
    "a sweep",
    "sweep 5",
    "warpimpact sweep",
    "warpimpact inspect and report take it; its points, in the folder beside it, are results, as is what isel(INPUT=0) "
    "chooses of it",
    (*_OF_HITS[:-1], attr.SWEEP),
)
HISTORY = Kind(
    "the history of a hit",
    "history 3",
    "warpimpact replay",
    "warpimpact inspect, report and export take it",
)
POSTERIOR = Kind(
    "a posterior",
    "posterior 1",
    "warpimpact identify",
    "warpimpact report takes it",
)
FRONT = Kind(
    "a search for designs",
    "design search 1",
    "warpimpact optimise",
    "warpimpact report and design take it",
)
FIRING = Kind(
    "a firing test",
    "firing test 1",
    "warpimpact test",
    "its text and figure stand beside it; xarray.open_dataset reads it",
)
KINDS = (HIT_MAP, SWEEP, HISTORY, POSTERIOR, FRONT, FIRING)

DESIGN, FIT, TEST, CAMPAIGN = "a design file", "a fit", "a test file", "a campaign"
_TABLES = {
    ("variables", "objectives"): (DESIGN, "warpimpact optimise takes it"),
    ("shot", "prior"): (FIT, "warpimpact identify takes it"),
    ("target", "procedure"): (TEST, "warpimpact test takes it"),
    ("threat", "material"): ("a catalogue", "warpimpact catalogue --file takes it"),
    ("hits", "sweep"): (CAMPAIGN, "warpimpact run takes it"),
}
"""Tables of a TOML file, one of which only files of one kind have: the kind, and the command that takes it."""


def text_kind(tables: Collection[str], wanted: str = "") -> tuple[str, str]:
    """The kind of a TOML file with these tables, the wanted one if it may be that, and its use; empty if unknown."""
    matching = [kind for names, kind in _TABLES.items() if {*names} & {*tables}]
    return next((kind for kind in matching if kind[0] == wanted), matching[0] if matching else ("", ""))
