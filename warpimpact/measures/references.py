"""A result as a tree: the map of hits at its root, and the same hits in another way as nodes.

A node is along the hits of the map. Values of hits that it lacks are NaN. One hit of a reference that stands for all
has no dimension "hit". Inputs of the shots that are as in the map, and texts, are left out.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple, TypeAlias

import numpy as np
import xarray
from numpy.typing import NDArray

from warpimpact.measures.hits import hit_numbers
from warpimpact.records import attributes as attr
from warpimpact.records import variables as v
from warpimpact.records.variables import has_passed

Result: TypeAlias = xarray.DataTree | xarray.Dataset
"""A result, or its map alone, which has no references."""
NAMES = {"solid": "solid, same weight", "base_alone": "base alone"}
"""Names of the references, which are those of their nodes, and their names as plates."""
LAW, ELEMENTS, DRAWS = "law", "elements", "draws"
"""Nodes of an answer: what the fast law alone says, some hits by finite elements, and draws of the map."""
PICTURES = "pictures"
"""Node of the pictures of hits by finite elements, which along all hits of a map would be too large."""
FINER = "finer"
"""Node of the outcomes of some hits at a finer level of resolution, present where a pilot found the resolution."""
_PLACES = (v.HIT_Y, v.HIT_Z)
_INPUTS = (*_PLACES, *v.SHOT_VARIABLES)
_BY_HIT = {*_PLACES, *(name for name in v.hit_variables() if v.HIT in name.dims)}


def as_dataset(result: Result) -> xarray.Dataset:
    """The map of a result."""
    return result.to_dataset() if isinstance(result, xarray.DataTree) else result


def as_tree(result: Result) -> xarray.DataTree:
    """A result, or its map alone, as a tree."""
    return result if isinstance(result, xarray.DataTree) else xarray.DataTree(result)


def with_references(dataset: xarray.Dataset, references: Mapping[str, xarray.Dataset]) -> xarray.DataTree:
    """A map with nodes by their names, such as {"solid": run(campaign.solid()).to_dataset()}.

    A hit has the same number in a node. A single hit of a solid plate, or of a base, stands for all.
    """
    return with_nodes(dataset, {name: Node.of(dataset, name, one).whole for name, one in references.items()})


def with_nodes(dataset: xarray.Dataset, nodes: Mapping[str, xarray.Dataset]) -> xarray.DataTree:
    """A map with nodes that are along its hits, by their paths, such as "solid" and "solid/draws"."""
    return xarray.DataTree.from_dict({"/": dataset, **{f"/{path}": node for path, node in nodes.items()}})


def nodes_of(tree: xarray.DataTree) -> dict[str, xarray.Dataset]:
    """All nodes of a result by their paths, without what they have of nodes above."""
    return {node.path.lstrip("/"): node.to_dataset(inherit=False) for node in tree.subtree if node is not tree}


def law_of(result: Result) -> xarray.DataTree:
    """A result as the fast law alone has it, with its references but without hits by elements and draws."""
    tree = as_tree(result)
    if LAW not in tree.children:
        return tree
    dataset, law = tree.to_dataset(), tree.children[LAW].to_dataset(inherit=False)
    fast = dataset.drop_vars(v.PERFORATED).assign(law.data_vars)
    fast[v.PERFORATED] = (v.HITS, has_passed(fast[v.STATUS].values), v.PERFORATED.attributes)
    nodes = {path: node for path, node in nodes_of(tree).items() if path not in (LAW, DRAWS, ELEMENTS, PICTURES)}
    return with_nodes(fast, nodes)


class Node(NamedTuple):
    """Hits of a reference, and their places in a map.

    Attributes:
        known: hits that both have, without what the node leaves out; a single hit that stands for all has no "hit".
        places: of these hits in the map.
        hits: number of hits of the map.
    """

    known: xarray.Dataset
    places: NDArray[np.int64]
    hits: int

    @classmethod
    def of(cls, dataset: xarray.Dataset, name: str, reference: xarray.Dataset) -> Node:
        """The node of a map with this name, of a reference along "hit". Of an open map, only its hits are read."""
        numbers, own = hit_numbers(dataset), hit_numbers(reference)
        # xarray crashes when it reads and closes groups with texts again and again.
        known = reference.drop_vars([label for label, of in reference.variables.items() if of.dtype.kind in "UOT"])
        if name in NAMES and len(own) == 1:
            known, places = known.isel(hit=0, drop=True), np.arange(0)
        else:
            places, order = np.flatnonzero(np.isin(numbers, own)), np.argsort(own)
            known = known.isel(hit=order[np.searchsorted(own, numbers[places], sorter=order)])
            shared = [label for label in _INPUTS if label in dataset and label in known]
            alike = [label for label in shared if _is_same(known[label], dataset[label].isel(hit=places))]
            known = known.drop_vars([*alike, v.HIT], errors="ignore")
        inherited = [dim for dim in known.dims if dim in known.coords and dim in dataset.coords]
        return cls(known.drop_vars(inherited), places, len(numbers))

    @property
    def whole(self) -> xarray.Dataset:
        """The node along all hits of the map."""
        return next(self.parts(self.hits))

    def parts(self, most: int) -> Iterator[xarray.Dataset]:
        """The node along consecutive hits of the map, at most so many at a time."""
        if v.HIT not in self.known.dims or len(self.places) == self.hits == most:
            yield self.known
            return
        for first in range(0, self.hits, most):
            count = min(most, self.hits - first)
            low, high = np.searchsorted(self.places, (first, first + count))
            columns = {
                name: _spread(column[low:high], self.places[low:high] - first, count)
                for name, column in self.known.variables.items()
                if v.HIT in column.dims
            }
            coordinates = [name for name in columns if name in self.known.coords]
            yield self.known.drop_dims(v.HIT).assign(columns).set_coords(coordinates)


def _is_same(one: xarray.DataArray, other: xarray.DataArray) -> bool:
    return np.array_equal(one.values, other.values, equal_nan=True)


def _spread(column: xarray.Variable, places: NDArray[np.int64], count: int) -> xarray.Variable:
    """Values at some of so many hits, NaN at the others. In a file whole numbers stay whole (CF: _FillValue)."""
    is_real = column.dtype.kind == "f"
    values = np.full((count, *column.shape[1:]), np.nan, column.dtype if is_real else np.float32)
    values[places] = column.values
    stored = np.dtype(np.int8) if column.dtype == np.bool_ else column.dtype
    encoding = {} if is_real else {"dtype": stored, "_FillValue": np.iinfo(stored).min}
    return xarray.Variable(column.dims, values, column.attrs, encoding)


def split_pictures(hits: xarray.Dataset) -> tuple[xarray.Dataset, dict[str, list[xarray.Dataset]]]:
    """Hits by finite elements without their pictures, and the node that has these, in one chunk; without pictures there
    is none."""
    names = [str(name) for name in (*v.PICTURE_VARIABLES, *v.PICTURE_AXES) if name in hits.variables]
    if not names:
        return hits, {}
    own = hits.drop_vars([label for label in hits.variables if label not in {*names, v.HIT}])
    return hits.drop_vars(names), {PICTURES: [own.rename({v.HIT: v.PICTURE_HIT}).drop_attrs(deep=False)]}


def pictures_of(result: Result) -> xarray.Dataset | None:
    """The pictures of hits by finite elements, along "hit"; None if there are none."""
    node = as_tree(result).children.get(PICTURES)
    return None if node is None else node.to_dataset(inherit=False).rename({v.PICTURE_HIT: v.HIT}).set_xindex(v.HIT)


def node_places(result: Result, name: str) -> NDArray[np.int64]:
    """Places of the hits that a node has in the map; empty if there is no such node, or no dimension "hit"."""
    tree = as_tree(result)
    node = tree.children.get(name)
    if node is None or node.dataset[v.STATUS].dims != (v.HIT,):
        return np.arange(0)
    return np.flatnonzero(node.dataset[v.STATUS].notnull().values)


def node_hits(result: Result, name: str) -> xarray.Dataset | None:
    """The hits that a node has, along "hit", with their inputs; None if it has none. A single one stands for all."""
    tree, places = as_tree(result), node_places(result, name)
    dataset, node = tree.to_dataset(), tree.children.get(name)
    if node is None or dataset[v.STATUS].dims != (v.HIT,):
        return None
    own = node.to_dataset(inherit=False)  # may have a dimension of the map that no variable of its own has
    known = xarray.Dataset(dict(own.variables), attrs=own.attrs).set_coords([*own.coords])
    if not known[v.STATUS].dims:
        by_hit = [label for label in known.variables if label in _BY_HIT and label in (*_PLACES, *known.data_vars)]
        known, places = known.assign({label: known[label].expand_dims(v.HIT) for label in by_hit}), np.arange(1)
    elif not len(places):
        return None
    rows = dataset.isel(hit=places)
    known = known.transpose(v.HIT, ...).isel(hit=places)
    whole = [label for label in known.data_vars if label in dataset and dataset[label].dtype.kind in "iub"]
    known = known.assign({label: known[label].astype(dataset[label].dtype) for label in whole})
    shared = [dim for dim in known.dims if dim not in known.coords and dim in dataset.coords and dim != v.HIT]
    inputs = [label for label in rows.variables if label in _INPUTS or str(label).startswith("core_")]
    columns = {label: rows[label].variable for label in (v.HIT, *inputs, *shared) if label not in known}
    return known.assign(columns).set_coords([label for label in columns if label in rows.coords])


def reference(result: Result, name: str) -> xarray.Dataset | None:
    """A reference of a result, along "hit": its first hits, or a single one that stands for all; None if there is none.

    A solid plate that stands alone is its own reference, except that of its limits.
    """
    dataset = as_dataset(result)
    is_alone = attr.LIMIT not in dataset.attrs and v.LAYER_STATUS not in dataset.variables
    if name == "solid" and is_alone and dataset.attrs.get(attr.OPEN_AREA) == 0.0:
        return dataset
    known, places = node_hits(result, name), node_places(result, name)
    if known is None:
        return None
    first = int(np.argmax(np.append(places != np.arange(len(places)), True)))  # hits before the first one without
    return None if len(places) and not first else known.isel(hit=slice(first or None))


def reference_result(result: Result, name: str) -> Result | None:
    """A reference of a result as a result of its own: its map, with the draws that it has."""
    tree, known = as_tree(result), reference(result, name)
    if known is None:
        return None
    if name not in tree.children:  # a solid plate alone
        return result
    draws = {path: node.to_dataset(inherit=False) for path, node in tree.children[name].children.items()}
    return with_nodes(known, draws) if draws else known


def as_plates(result: Result) -> dict[str, Result]:
    """The references of a result by their names as plates. One that stands for all has every hit of the result."""
    dataset = as_dataset(result)
    tree = as_tree(result)
    plates = {label: reference_result(result, name) for name, label in NAMES.items() if name in tree.children}
    every = {name: dataset[name].variable for name in (v.HIT, v.HIT_Y, v.HIT_Z)}
    return {
        label: plate
        if DRAWS in as_tree(plate).children or as_dataset(plate).sizes["hit"] > 1
        else as_dataset(plate).isel(hit=[0] * dataset.sizes["hit"]).assign_coords(every)
        for label, plate in plates.items()
        if plate is not None
    }


def finer_pair(result: Result) -> tuple[xarray.Dataset, xarray.Dataset] | None:
    """The hits of a result that the fast law computed at a finer level, too: with its values in the result, and with
    those at the finer level. None if there are none."""
    fine = node_hits(result, FINER)
    if fine is None:
        return None
    given = as_dataset(law_of(result)).isel(hit=node_places(result, FINER))
    columns: dict[str, Any] = {
        str(name): (given[name].dims, fine[name].values, given[name].attrs) for name in fine.data_vars if name in given
    }
    columns[v.PERFORATED] = (v.HITS, has_passed(fine[v.STATUS].values), {})
    return given, given.assign(columns)
