"""How finely and by which scheme a shot is computed."""

from typing import Annotated, Literal

from pydantic import Field

from .model import Model
from .units import PositiveLength, PositiveTime


class Numerics(Model):
    """A fidelity, and single settings that go before it; what is None follows from fidelity and scheme.

    Attributes:
        fidelity: "draft", "standard" or "reference".
        scheme: "consistent", or "nodal" for the paper's literal scheme (MODEL §4).
        time_step: [s].
        patches_axial, patches_around: surface patches along the core and around it; a multiple of 4 around it
            makes mirrored shots mirror exactly.
        grid_spacing: spacing of the plate grid [m].
        precision: of the arithmetic.
    """

    fidelity: Literal["draft", "standard", "reference"] = "standard"
    scheme: Literal["consistent", "nodal"] = "consistent"
    time_step: PositiveTime | None = None
    patches_axial: Annotated[int, Field(strict=True, ge=4, le=4096)] | None = None
    patches_around: Annotated[int, Field(strict=True, ge=8, le=4096, multiple_of=4)] | None = None
    grid_spacing: PositiveLength | None = None
    precision: Literal["single", "double"] | None = None
