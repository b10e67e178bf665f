"""A variable of the hits over the unit cell: a regular map, which xarray can plot, and estimates between hits."""

from __future__ import annotations

import numpy as np
import xarray
from numpy.typing import NDArray
from scipy.spatial import KDTree

from warpimpact.measures.hits import failed, passed
from warpimpact.measures.references import DRAWS, ELEMENTS, Result, as_dataset, as_tree, node_hits, node_places
from warpimpact.measures.vocabulary import place_of_standoff
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.scene.sampling import IDENTITY, SYMMETRIES, Symmetry

Array = NDArray[np.float64]

_FARTHEST = 2.0
"""Largest distance of a place from the nearest hit, in mean hit spacings; farther places have too few hits. With random
hits, 3e-6 of the places lie farther."""
BY_ELEMENTS = "by_elements"
"""Coordinate of the maps of an answer: whether finite elements have computed a hit."""
OF_PASSED = {v.RESIDUAL_VELOCITY, v.DEFLECTION}
"""Variables that count only for cores that passed: a core that ricocheted has them in front of the plate."""
_DIMENSIONS = {("hit",), ("hit", "standoff"), ("hit", "layer")}
"""Dimensions of variables with one number per hit, once a stand-off and a layer are chosen."""


def hit_map(
    result: Result,
    variable: str,
    *,
    standoff: float | None = None,
    layer: int | None = None,
    pixels: int = 200,
) -> xarray.DataArray:
    """One variable of a result over where the cores hit, on a regular grid of the unit cell.

    A place has the value of the nearest hit. It has none (NaN) where there are too few hits. Residual velocity and
    deflection are those of cores that passed the plate. The cell continues across its edges unless the plate is finite.

    Args:
        result: of a campaign, or hits chosen from it.
        variable: name of a variable with one number per hit, or one per hit for each stand-off and layer.
        standoff: distance behind the plate, or the layer, [m] for a variable that has one; the largest if None.
        layer: number of the layer for a variable that has layers, 0 the plate; the last one if None.
        pixels: places along the longer side, 1 or more.

    Returns:
        Map of shape [hit_z, hit_y], with these coordinates [m] and the attributes of the variable.

    Raises:
        ValueError: the variable cannot be mapped, the result has no such stand-off, no hits, or hits outside the cell.
    """
    if pixels < 1:
        raise ValueError(f"pixels: got {pixels}, but it must be at least 1")
    dataset = mirrored(result)
    array = select_variable(dataset, variable, standoff, layer)
    values = array.values.astype(np.float64)
    if variable in OF_PASSED:
        values = np.where(share_that_passes(dataset) > 0.0, values, np.nan)
    period, hits = np.asarray(dataset.attrs[attr.PLATE_PERIOD]), hit_points(dataset)
    if not len(hits):
        raise ValueError("the result has no hits")
    if np.any(np.abs(hits) > period / 2 * (1.0 + 1e-9)):
        raise ValueError("the result has hits outside the cell, so a map of the cell cannot show them")
    y, z = axes_of(period, pixels)
    is_periodic = "size_y" not in dataset
    tree = KDTree((hits + period / 2) % period % period, boxsize=period) if is_periodic else KDTree(hits + period / 2)
    distance, nearest = tree.query(np.stack(np.meshgrid(y, z), axis=-1) + period / 2)
    image = np.where(distance <= _FARTHEST * np.sqrt(period.prod() / len(hits)), values[nearest], np.nan)
    coordinates = {name: (name, along, name.attributes) for name, along in ((v.HIT_Z, z), (v.HIT_Y, y))}
    known = {name: array[name] for name in (v.STANDOFF,) if name in array.coords}
    return xarray.DataArray(image, coordinates | known, (v.HIT_Z, v.HIT_Y), str(variable), array.attrs)


def select_variable(
    dataset: xarray.Dataset, variable: str, standoff: float | None = None, layer: int | None = None
) -> xarray.DataArray:
    """A variable with one number per hit, shape [hits], at one stand-off [m] if it has stand-offs (None: the largest),
    in or behind one layer if it has layers (None: the last one).

    Raises:
        ValueError: the variable is none of these, or the Dataset has no such stand-off or layer.
    """
    array = dataset.get(variable)
    if array is None or array.dims not in _DIMENSIONS or variable in (v.HIT, v.HIT_Y, v.HIT_Z):
        known = [str(name) for name, one in dataset.data_vars.items() if one.dims in _DIMENSIONS]
        raise ValueError(f'"{variable}" cannot be mapped; choose one of {", ".join(known)}')
    if "layer" in array.dims:
        layers = array.sizes["layer"]
        if layer is not None and not 0 <= layer < layers:
            raise ValueError(f"the result has no layer {layer}; it has layers 0 (the plate) to {layers - 1}")
        array = array.isel(layer=-1 if layer is None else layer)
    if v.STANDOFF in array.dims:
        array = array.isel(standoff=-1 if standoff is None else place_of_standoff(dataset[v.STANDOFF].values, standoff))
    return array


def symmetries_of(dataset: xarray.Dataset) -> list[Symmetry]:
    """Symmetries that give the rest of the cell from the hits; the identity alone where the hits cover it."""
    names = str(dataset.attrs.get(attr.SYMMETRIES, IDENTITY)).split("; ")
    return [symmetry for symmetry in SYMMETRIES if str(symmetry) in names]


def marked(result: Result) -> xarray.Dataset:
    """The map of a result; that of an answer has the coordinate `BY_ELEMENTS`, which is true for no image."""
    dataset = as_dataset(result)
    if DRAWS not in as_tree(result).children:
        return dataset
    own = np.isin(np.arange(dataset.sizes["hit"]), node_places(result, ELEMENTS))
    return dataset.assign_coords({BY_ELEMENTS: ("hit", own)})


def mirrored(result: Result) -> xarray.Dataset:
    """The hits with their mirror images, to be drawn, where they cover the irreducible part of the cell only.

    The coordinate "image" is 0 for the hits themselves. Variables with vectors are left out.
    """
    dataset = marked(result)
    group, hits = symmetries_of(dataset), dataset.sizes["hit"]
    if len(group) == 1 or "image" in dataset.coords:
        return dataset
    points, cell = (dataset[v.HIT_Y].values, dataset[v.HIT_Z].values), dataset.attrs[attr.PLATE_PERIOD]
    images = np.concatenate([symmetry.image(*points, cell) for symmetry in group], axis=1)
    whole = dataset.drop_dims("axis", errors="ignore").isel(hit=np.tile(np.arange(hits), len(group)))
    changed = {name: whole[name].copy(data=places) for name, places in zip((v.HIT_Y, v.HIT_Z), images, strict=True)}
    for name in (name for name in v.hit_variables() if name.mirror is not None and name in whole):
        signs = np.repeat([getattr(symmetry, str(name.mirror)) for symmetry in group], hits)
        whole = whole.assign({name: whole[name].copy(data=(whole[name].values.T * signs).T)})
    image = np.repeat(np.arange(len(group)), hits)
    marks = {BY_ELEMENTS: whole[BY_ELEMENTS] & (image == 0)} if BY_ELEMENTS in whole.coords else {}
    return whole.assign_coords({**changed, **marks, "image": ("hit", image)})


def share_that_passes(dataset: xarray.Dataset) -> Array:
    """Share of the draws in which each core passes, shape [hits]; 1 or 0 without draws, NaN where none is known."""
    share = dataset[v.PERFORATED].values.astype(float) if v.PERFORATED in dataset else passed(dataset)
    return np.where(failed(dataset), np.nan, share)


def is_by_law(dataset: xarray.Dataset, variable: str) -> bool:
    """Whether an answer has a variable by the fast law alone, because its draws have none."""
    of_fragments = v.DRAWN_OF_FRAGMENTS if v.FRAGMENT_MASS in dataset else ()
    is_drawn = variable in (*v.DRAWN, *v.DRAWN_BEHIND, *of_fragments, *v.MEANS_ONLY, v.PERFORATED)
    return BY_ELEMENTS in dataset.coords and variable in v.record_variables() and not is_drawn


def deformed_hits(result: Result) -> xarray.Dataset | None:
    """The hits by finite elements of cores that deform; None if a result has none."""
    dataset = as_dataset(result)
    hits = dataset if attr.CONTINUUM in dataset.attrs else node_hits(result, ELEMENTS)
    return hits if hits is not None and v.FRAGMENT_MASS in hits else None


def hit_points(dataset: xarray.Dataset) -> Array:
    """Hit points [m], shape [hits, 2]."""
    return np.stack([dataset[v.HIT_Y].values, dataset[v.HIT_Z].values], axis=-1)


def axes_of(period: Array, count: int) -> tuple[Array, Array]:
    """Centres of nearly square pixels along y and z [m], `count` of them along the longer side of a cell."""
    counts = np.ceil(count * period / period.max()).astype(int)
    y, z = (((np.arange(n) + 0.5) / n - 0.5) * length for n, length in zip(counts, period, strict=True))
    return y, z
