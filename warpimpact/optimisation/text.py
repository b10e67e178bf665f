"""What a search found, as lines for a terminal."""

from __future__ import annotations

import json
from collections.abc import Iterator
from typing import TYPE_CHECKING

import numpy as np

from warpimpact.analysis.numbers import interval_text, number_text
from warpimpact.results import front as f

if TYPE_CHECKING:
    import xarray

NEEDED = 0.95
"""Share of the draws of a posterior from which a difference survives."""


def front_lines(dataset: xarray.Dataset) -> Iterator[str]:
    """The front of a search with its intervals, what fresh hits took from it, and which designs are one."""
    designs, told = dataset.sizes["design"], dataset.attrs
    yield (
        f"{designs} designs computed, {int(dataset[f.HITS].sum())} hits, {told[f.PILOTS]} pilots; "
        f"{told[f.REFUSED]} more broke a constraint and were not computed"
    )
    if told[f.OUTCOME] == f.NONE_FEASIBLE:
        yield from _nearest(dataset)
        return
    on_front, confirmed = int(dataset[f.ON_FRONT].sum()), dataset.sizes["front"]
    yield f"front: {on_front} designs, of which {confirmed} were computed again with fresh hits"
    for place in range(confirmed):
        notes = []
        if (group := int(dataset[f.GROUP][place])) != place:
            notes.append(f"cannot be told from {dataset[f.FILE].values[group]}")
        if not int(dataset[f.KEPT][place]):
            notes.append("not on the front by fresh hits")
        yield f"{dataset[f.FILE].values[place]}: {'; '.join([', '.join(numbers_of_front(dataset, place)), *notes])}"
        yield f"    {design_text(dataset, int(dataset[f.NUMBER][place]))}"
    for place, name in enumerate(dataset[f.REFERENCE].values):
        yield f"{name}: {', '.join(numbers_of_reference(dataset, place))}"
        yield from _against(dataset, place)
    yield from _shrinkage(dataset)
    yield from _survival(dataset)


def _survival(dataset: xarray.Dataset) -> Iterator[str]:
    """Which part of the order of the front survives the uncertainty of the parameters."""
    for place, label in enumerate(dataset[f.LABEL].values):
        least = dataset[f.SURVIVAL_AT_LEAST].values[:, place]
        if (known := np.isfinite(least)).any():
            name, survive = str(label).partition(" [")[0], int((least[known] >= NEEDED).sum())
            yield (
                f"{name}: {survive} of {int(known.sum())} differences between neighbours on the front survive the "
                f"uncertainty of the parameters (in at least {NEEDED:.0%} of the draws)"
            )


def _against(dataset: xarray.Dataset, reference: int) -> Iterator[str]:
    """How much better than a reference a design is in one of two objectives that is no worse in the other."""
    goals = np.flatnonzero(np.isnan(dataset[f.LIMIT].values))
    if len(goals) != 2:
        return
    signs, names = dataset[f.SIGN].values[goals], [str(label).partition(" [")[0] for label in dataset[f.LABEL].values]
    fresh = (signs * dataset[f.FRESH].values[:, goals])[dataset[f.KEPT].values == 1]
    files = dataset[f.FILE].values[dataset[f.KEPT].values == 1]
    own = signs * dataset[f.REFERENCE_FOUND].values[reference, goals]
    for one, other in ((0, 1), (1, 0)):
        able = np.flatnonzero(fresh[:, other] <= own[other])
        if len(able) and own[one]:
            best = able[np.argmin(fresh[able, one])]
            gain = (own[one] - fresh[best, one]) / abs(own[one])
            yield (
                f"    no worse in {names[goals[other]]}: {files[best]} has {abs(gain):.1%} "
                f"{'less' if gain * signs[one] > 0 else 'more'} {names[goals[one]]}"
            )


def numbers_of_front(dataset: xarray.Dataset, place: int) -> list[str]:
    """Objectives and bounds of a design of the front by fresh hits, with their intervals."""
    names = (f.FRESH, f.FRESH_LOW, f.FRESH_HIGH)
    return [_number(dataset, names, place, asked) for asked in range(dataset.sizes["asked"])]


def numbers_of_reference(dataset: xarray.Dataset, place: int) -> list[str]:
    """The same of a target to compare with."""
    names = (f.REFERENCE_FOUND, f.REFERENCE_LOW, f.REFERENCE_HIGH)
    return [_number(dataset, names, place, asked) for asked in range(dataset.sizes["asked"])]


def _number(dataset: xarray.Dataset, names: tuple[str, str, str], place: int, asked: int) -> str:
    name, _, unit = str(dataset[f.LABEL].values[asked]).removesuffix("]").partition(" [")
    found, low, high = (float(dataset[one][place, asked]) for one in names)
    within = "" if low == high else f" ({interval_text(low, high, '{:.4g}'.format)})"
    return f"{name} {number_text(found)}{within}{' ' + unit if unit else ''}"


def design_text(dataset: xarray.Dataset, design: int) -> str:
    """The variables of a design with their values."""
    parts = []
    for place, name in enumerate(dataset[f.NAME].values):
        value = float(dataset[f.VALUE][design, place])
        labels, unit = str(dataset[f.LABELS].values[place]), str(dataset[f.UNIT].values[place])
        if not np.isnan(value):
            shown = json.loads(labels)[int(value)] if labels else f"{value:.6g} {unit}".strip()
            parts.append(f"{name} = {shown}")
    return ", ".join(parts)


def _shrinkage(dataset: xarray.Dataset) -> Iterator[str]:
    """By how much fresh hits are worse than the search had it."""
    searched, fresh = dataset[f.FOUND].values[dataset[f.NUMBER].values], dataset[f.FRESH].values
    for place, (label, sign, limit) in enumerate(
        zip(dataset[f.LABEL].values, dataset[f.SIGN].values, dataset[f.LIMIT].values, strict=True)
    ):
        if not np.isnan(limit) or not len(fresh) or str(dataset[f.ASKED].values[place]).startswith("areal_density"):
            continue
        worse = float(np.mean(sign * (fresh[:, place] - searched[:, place])))
        before = float(np.mean(searched[:, place]))
        share = f", {abs(worse / before):.1%} of it" if before else ""
        name, _, unit = str(label).removesuffix("]").partition(" [")
        yield (
            f"shrinkage: by fresh hits {name} is {'worse' if worse > 0 else 'better'} by "
            f"{number_text(abs(worse))}{' ' + unit if unit else ''}{share}, mean over the front"
        )


def _nearest(dataset: xarray.Dataset) -> Iterator[str]:
    """Which design comes nearest to the bounds where none keeps them."""
    limits, signs, found = dataset[f.LIMIT].values, dataset[f.SIGN].values, dataset[f.FOUND].values
    bounds = np.flatnonzero(~np.isnan(limits))
    over = np.maximum(
        signs[bounds] * (found[:, bounds] - limits[bounds]) / np.maximum(np.abs(limits[bounds]), 1e-30), 0.0
    )
    nearest = int(np.nanargmin(over.sum(axis=1))) if len(bounds) and np.isfinite(over).any() else 0
    asked = [
        f"{dataset[f.LABEL].values[one]!s} {'<' if signs[one] > 0 else '>'}= {limits[one]:.4g}"
        f" (nearest: {number_text(float(found[nearest, one]))})"
        for one in bounds
    ]
    yield f"no design keeps the bounds: {'; '.join(asked) or 'no hit of any design could be computed'}"
    yield f"    the nearest: {design_text(dataset, nearest)}"
