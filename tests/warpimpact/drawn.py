"""Answers made by hand: a result with draws in which cores pass or stop as a test says."""

from collections.abc import Sequence

import numpy as np
import xarray

from warpimpact.kernels.status import Status
from warpimpact.measures.references import DRAWS, ELEMENTS, LAW, nodes_of, with_nodes, with_references
from warpimpact.records import variables as v


def with_draws(dataset: xarray.Dataset, passes: np.ndarray, elements: Sequence[int] = ()) -> xarray.DataTree:
    """An answer whose draws have the numbers of a result, of which all passed, where a core passes.

    Args:
        passes: whether each core passes in each draw, shape [draws, hits].
        elements: numbers of the hits by finite elements.
    """
    columns = {}
    for name in v.DRAWN:
        values = np.broadcast_to(dataset[name].values, (len(passes), *dataset[name].shape))
        stops = (~passes).reshape(passes.shape + (1,) * (values.ndim - 2))
        stopped = Status.ARRESTED if name == v.STATUS else 0.0 if name == v.RESIDUAL_VELOCITY else np.nan
        values = np.where(stops, stopped, values).astype(dataset[name].dtype)
        columns[name] = (v.DRAW, v.DRAWN_HIT, *dataset[name].dims[1:]), values, dataset[name].attrs
    draws = xarray.Dataset(columns, {v.DRAWN_HIT: dataset[v.HIT].values})
    share = passes.mean(axis=0)
    root = dataset.assign(
        perforated=("hit", share.astype(np.float32), dataset[v.PERFORATED].attrs),
        status=("hit", np.where(share >= 0.5, 0, 1).astype(np.int8), dataset[v.STATUS].attrs),
    )
    by_elements = dataset.isel(hit=list(elements)).assign_attrs(numerics="finite elements")
    known = {ELEMENTS: by_elements} if elements else {}
    law = xarray.Dataset({name: dataset[name].variable for name in v.DRAWN})
    return with_nodes(root, nodes_of(with_references(root, known)) | {LAW: law, DRAWS: draws})
