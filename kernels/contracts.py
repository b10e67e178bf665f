"""The contracts of a scheme and of a kind of target: the functions that the march needs, with arguments and units.

A contract annotates each function with its arguments, as `name: type`: a struct (kernels/structs.py) or a scalar.
`checked` compares a build with its contract. A missing function, or one with other arguments, is then named when a
variant is built, not in a compiler's message about the march.
"""

from dataclasses import dataclass
from typing import Annotated, Any, TypeVar, get_type_hints

import warp as wp

from . import structs
from .variant import Variant

Contract = TypeVar("Contract")


@dataclass(frozen=True)
class Scheme:
    """How one layer loads a core in one step: the consistent law by one thread (contact.py) or by the lanes of a block
    (block.py), or the paper's literal scheme (nodal.py).

    Attributes:
        fields_of_slot: Fields of all slots → Fields of one slot, from its first node on.
        open_window: plate, its thickness [m], the fields of a slot, the number of the layer, y and z of the hit in the
            layer's frame [m] → Window about the hit on an untouched plate.
        load_on: → Load of one layer in a step. It also adds the exposure of the step to the fields of the context.
    """

    fields_of_slot: Annotated[wp.Function, "fields: Fields, slot: int32"]
    open_window: Annotated[wp.Function, "plate: Plate, thickness: real, fields: Fields, layer: int32, hit: vec2d"]
    load_on: Annotated[wp.Function, "context: Context, slab: Slab"]


@dataclass(frozen=True)
class TargetKind:
    """What a step can touch of a target, and its load. A target has one plate (one_plate.py) or several layers
    (layers.py). The shot is the one in the context.

    Attributes:
        first_step: length of the `shortest` step [s] → length of the first step [s].
        begin: state at the first mid-step → Reach before the first step, and status of the shot, which may have ended.
        find_reach: Reach of the step before → Reach of this step, which is at the pose and `dt` long
            [s]. `last` is the change of the velocities in the step before.
        law_at: law of the plate → the law with the onset of contact of all that the step can touch.
        load_on: → Load of all that the step touches.
        free_time: state of a core that touches nothing → time [s] for which it flies on after this step without a
            contact, and whether it is lost between layers.
        next_step: `free` time [s] after this step → length of the next step [s].
        conclude: status, RUNNING after the last step → final status. Records how the core ended in each layer.
    """

    first_step: Annotated[wp.Function, "context: Context, shortest: real"]
    begin: Annotated[wp.Function, "context: Context, state: State"]
    find_reach: Annotated[
        wp.Function, "context: Context, before: Reach, state: State, pose: Pose, last: Change, dt: real"
    ]
    law_at: Annotated[wp.Function, "context: Context, law: Law, reach: Reach"]
    load_on: Annotated[wp.Function, "context: Context, law: Law, reach: Reach, pose: Pose, dt: real"]
    free_time: Annotated[wp.Function, "context: Context, reach: Reach, state: State, pose: Pose, dt: real"]
    next_step: Annotated[
        wp.Function, "context: Context, reach: Reach, pose: Pose, last: Change, clock: Clock, free: real"
    ]
    conclude: Annotated[wp.Function, "context: Context, reach: Reach, state: State, status: int32, touched: bool"]


def checked(contract: type[Contract], variant: Variant, build: Any) -> Contract:
    """The functions of a build that its contract names.

    Raises:
        TypeError: the build lacks a function, or a function takes other arguments.
    """
    struct = structs.build(variant)
    scalars = {"real": variant.real, "int32": wp.int32, "float64": wp.float64, "vec2d": wp.vec2d, "bool": wp.bool}

    def type_of(name: str) -> Any:
        return scalars[name] if name in scalars else getattr(struct, name)

    offered = {}
    for name, hint in get_type_hints(contract, include_extras=True).items():
        (arguments,) = hint.__metadata__
        expected = [argument.split(": ") for argument in arguments.split(", ")]
        offered[name] = function = getattr(build, name, None)
        if not isinstance(function, wp.Function):
            raise TypeError(f"a {contract.__name__} needs the device function {name}({arguments})")
        taken = list(function.input_types.items())
        if taken != [(argument, type_of(kind)) for argument, kind in expected]:
            given = ", ".join(f"{argument}: {getattr(kind, 'key', kind.__name__)}" for argument, kind in taken)
            raise TypeError(f"{name} of a {contract.__name__} takes ({given}), but it must take ({arguments})")
    return contract(**offered)
