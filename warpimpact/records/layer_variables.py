"""How each core left each layer of the target, and where it came to rest (kernels/passage.py).

A core leaves a layer when its last point passes the rear face; values are NaN if it does not.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from warpimpact.kernels.status import Status
from warpimpact.records.variable import HITS, IN_LAYER, Columns, Returned, Variable, VariableGroup

if TYPE_CHECKING:
    from warpimpact.scene import Scene, Shots

LAYER_STATUS = Variable("layer_status", IN_LAYER, "1", "how the core ended in each layer", flags=Status)
LAYER_RESIDUAL_VELOCITY = Variable(
    "layer_residual_velocity",
    IN_LAYER,
    "m s-1",
    "velocity when the last point of the core leaves the layer",
    field="velocity",
)
LAYER_TILT = Variable(
    "layer_tilt", IN_LAYER, "degree", "angle between core axis and line of fire when its last point leaves the layer"
)
STOPPED_IN = Variable("stopped_in", HITS, "1", "deepest layer that the core rests in; -1 where it does not rest in one")
DEPTH = Variable("depth", HITS, "m", "how far behind the front face of that layer any point of the core came")

LAYER_FRONT = Variable("layer_front", ("layer",), "m", "front face of the layer, from that of the target")
LAYER_REAR = Variable("layer_rear", ("layer",), "m", "rear face of the layer, from the front face of the target")
LAYER_FACES = (LAYER_FRONT, LAYER_REAR)
"""Means over the shots if thicknesses scatter."""
LAYER = Variable("layer", ("layer",), "1", "number of the layer; the plate is layer 0")
LAYER_NAME = Variable("layer_name", ("layer",), "1", "name of the layer")
LAYER_MATERIAL = Variable("layer_material", ("layer",), "1", "material of the layer in the catalogue, or empty")
LAYER_LABELS = (LAYER, LAYER_NAME, LAYER_MATERIAL)
_CODES = (LAYER_STATUS, STOPPED_IN)


def _layered(scene: Scene, shots: Shots) -> bool:
    return len(scene.target.layers) > 1


def _columns(returned: Returned, group: VariableGroup) -> Columns:
    """Columns of a group from the struct of the same names."""
    arrays = {name: getattr(returned.passage, name.field.removeprefix("layer_")).numpy() for name in group}
    return {name: values.astype(np.int8 if name in _CODES else np.float64) for name, values in arrays.items()}


LAYER_VARIABLES: VariableGroup = VariableGroup(
    "With layers behind the plate",
    (LAYER_STATUS, LAYER_RESIDUAL_VELOCITY, LAYER_TILT, STOPPED_IN, DEPTH),
    _layered,
    lambda returned: _columns(returned, LAYER_VARIABLES),
    beside=LAYER_FACES,
)
LAYER_NUMBERS = (LAYER_RESIDUAL_VELOCITY, LAYER_TILT)
"""Variables with one number per hit and layer."""
