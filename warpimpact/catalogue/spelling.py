"""Which entry of a catalogue a name means. Case, spaces and hyphens do not count, and entries have aliases."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from difflib import SequenceMatcher

from warpimpact.scene.units import MOST_QUOTED, quoted

_EQUAL_LETTERS = 0.75
"""Smallest share of equal letters of a slip of the keyboard."""
_FEW = 12
"""Most entries that a message lists."""
_CALIBRE = r"\.?\d+(?:\.\d+)?(?:mm)?"
_ALUMINIUM = r"^(?:enaw|aa|aluminium|aluminum|al)(?=\d{4})"


def key(name: str) -> str:
    """What all spellings of a name have in common.

    Case, spaces, hyphens and slashes do not count. "7.62 mm" is "7.62", but "30 mm" is not ".30". Aluminium alloys need
    no prefix: "6061-T6", "AA6061-T6" and "EN AW-6061 T6" are one name.
    """
    compact = re.sub(r"[^a-z0-9.×]", "", name[:MOST_QUOTED].casefold()).replace("×", "x")
    decimal = re.sub(r"(\d\.\d+)mm", r"\1", compact)
    return re.sub(_ALUMINIUM, "", re.sub(r"\.(?!\d)", "", decimal))


def the_entry(name: str, spellings: Mapping[str, Sequence[str]]) -> str:
    """Name of the entry that a name or an alias stands for; `spellings` are aliases by the names of the entries.

    Raises:
        ValueError: there is none, or an alias stands for several; the message lists whom it may mean.
    """
    if named := [entry for entry in spellings if key(entry) == key(name)]:
        return named[0]
    called = [entry for entry, aliases in spellings.items() if key(name) in map(key, aliases)]
    if len(called) == 1:
        return called[0]
    if called:
        raise ValueError(f"got {quoted(name)}, which several entries of the catalogue are: {_listed(called)}; name one")
    meant = [entry for entry, aliases in spellings.items() if any(_close(name, word) for word in (entry, *aliases))]
    few = f"allowed are {', '.join(spellings)}" if len(spellings) <= _FEW else "warpimpact catalogue lists all"
    hint = f"did you mean {_listed(meant)}?" if meant else few
    raise ValueError(f"got {quoted(name)}, which is not in the catalogue; {hint}")


def _listed(names: Sequence[str]) -> str:
    *others, last = (f'"{name}"' for name in names)
    return f"{', '.join(others)} or {last}" if others else last


def _close(name: str, spelling: str) -> bool:
    """Whether a name is part of a spelling or a slip of it.

    Numbers tell calibres and alloys apart: those of a part must be in the spelling, those of a slip are the same."""
    given, known = key(name), key(spelling)
    numbers, others = _numbers(given), _numbers(known)
    if len(given) > 1 and given in known and numbers <= others:
        return True
    letters, other_letters = (re.sub(_CALIBRE, "", word) for word in (given, known))
    return numbers == others and SequenceMatcher(None, letters, other_letters).ratio() >= _EQUAL_LETTERS


def _numbers(word: str) -> set[str]:
    return {number.removeprefix(".") for number in re.findall(_CALIBRE, word)}
