"""Shots: how the core arrives, and where (docs/model.md §1)."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from .exclusions import SIZE, WHOLE_PLATE, check_together
from .input_files import InputFile, read_columns
from .model import Array, Model
from .quantities import BY_LAYER, LISTED, QUANTITIES
from .target import Plate, Target
from .units import RIGHT_ANGLE, Angle, AngularVelocity, Obliquity, PositiveSpeed, Tilt, Whole

FARTHEST_HIT = 100.0
"""Largest distance of a hit from the origin [m]."""
_REPLICATES = 16
"""Default number of scramblings. It does not depend on the count, so a larger count keeps the earlier shots. Student's
interval over 16 means is 9 % wider than over infinitely many."""
EXPORTED = {quantity.column: name for name, quantity in QUANTITIES.items() if quantity.column is not None}
"""Name of a column in an exported result → its name in a list of hits."""


class Impact(Model):
    """Velocity and attitude at impact of all shots, or medians of the quantities that scatter.

    An angle is given in degrees, or as a string with its unit; the fields hold radians.

    Attributes:
        velocity: of the centre of mass [m/s].
        obliquity: angle between line of flight and plate normal [rad].
        azimuth: direction of the obliquity in the plate, from +y towards +z [rad].
        pitch, yaw: projected attitude of the axis beyond that of the line of flight [rad].
        spin: about the axis of the core [rad/s].
    """

    velocity: PositiveSpeed
    obliquity: Obliquity = 0.0
    azimuth: Angle = 0.0
    pitch: Tilt = 0.0
    yaw: Tilt = 0.0
    spin: AngularVelocity = 0.0

    @model_validator(mode="after")
    def _flies_nose_first(self) -> Self:
        """The axis is built from its projected angles, which flip at 90 degrees."""
        for name, share in (("pitch", math.sin(self.azimuth)), ("yaw", math.cos(self.azimuth))):
            angle, of_flight = getattr(self, name), math.atan(math.tan(self.obliquity) * share)
            if abs(angle + of_flight) >= RIGHT_ANGLE:
                raise ValueError(
                    f"got {name} = {math.degrees(angle):g} deg on a line of flight that has "
                    f"{math.degrees(of_flight):.4g} deg of its own, but their sum must lie between -90 and 90 deg"
                )
        return self


class Hits(Model):
    """Where the cores hit, and how the random numbers of hits and scatter are drawn.

    Attributes:
        sampling: "sobol" (scrambled, even at any count), "random" (independent), "grid" (cell centres), or
            "list" (those of `file`).
        count: number of hits; a grid takes the largest number in a rectangle of nearly square cells.
        seed: of all random numbers.
        file: CSV file of a list, with the header hit_y,hit_z in metres; more columns, named as in `Shots`, override
            those quantities: angles in degrees, all else in SI, or in the unit behind the name, as in "hit_y [mm]".
            A result that `warpimpact export` wrote is such a list, too. With another sampling, a file without hit
            points: each shot takes a random row, as of the draws that `warpimpact identify` writes.
        replicates: number of independent scramblings of a sobol sampling, 16 by default; shots are dealt to them in
            turn. Their spread gives the error of a mean.
        area: what the sampling covers: one unit cell (or a smaller plate), or all of a finite "plate".
        irreducible: sample only the irreducible part of the unit cell under the symmetries of plate and shot. Maps
            show its mirror images, too.
    """

    sampling: Literal["sobol", "grid", "random", "list"] = "sobol"
    count: Annotated[Whole, Field(ge=1, le=2**30)] | None = None
    seed: Annotated[Whole, Field(ge=0, le=2**63 - 1)] = 0
    file: InputFile | None = None
    area: Literal["cell", "plate"] = "cell"
    irreducible: Annotated[bool, Field(strict=True)] = False
    replicates: Literal[1, 8, 16, 32, 64] | None = None

    @model_validator(mode="after")
    def _is_complete(self) -> Self:
        needed, foreign = ("file", ["area", "count", "irreducible"]) if self.sampling == "list" else ("count", [])
        if getattr(self, needed) is None:
            raise ValueError(f'sampling = "{self.sampling}" needs {needed}')
        for name in foreign + ["replicates"] * (self.sampling != "sobol"):
            if getattr(self, name) != type(self).model_fields[name].default:
                raise ValueError(f'{name} and sampling = "{self.sampling}" cannot be combined; leave out {name}')
        if self.file is not None and self.irreducible:
            raise ValueError("file and irreducible = true cannot be combined; leave out irreducible")
        _ = self.listed
        return self

    @cached_property
    def listed(self) -> dict[str, Array] | None:
        """Columns of the file by name, in SI and radians, shape [hits] each; None without a file."""
        if self.file is None:
            return None
        required = ("hit_y", "hit_z") if self.sampling == "list" else ()
        columns = read_columns(self.file, {name: QUANTITIES[name].type for name in LISTED}, required, EXPORTED)
        if self.sampling != "list" and {"hit_y", "hit_z"} & columns.keys():
            raise ValueError(f'{self.file.name} has hit points. Give sampling = "list", which takes them.')
        return columns

    @property
    def scramblings(self) -> int:
        """Number of scramblings in use: 1 unless the sampling is sobol."""
        return self.replicates or (_REPLICATES if self.sampling == "sobol" else 1)

    def covered(self, plate: Plate) -> tuple[float, float]:
        """Extent along y and z [m] of the rectangle about the origin that the hits cover."""
        check_together({WHOLE_PLATE: self.area == "plate", SIZE: plate.size is not None})
        return plate.size if self.area == "plate" and plate.size is not None else plate.sampled_cell


@dataclass(frozen=True)
class Shots:
    """Shots as arrays of shape [shots] unless noted, in SI and radians; `Impact` and `Layer` define the quantities.

    Attributes:
        hit_y, hit_z: where the line of flight of the centre of mass crosses the front face [m].
        velocity: impact velocity [m/s].
        obliquity, azimuth: of the line of flight [rad].
        pitch, yaw: of the axis, beyond those of the line of flight [rad].
        spin: about the axis [rad/s].
        mass [kg], strength [Pa]: of the core; None if all shots have the value of the scene.
        static, linear, quadratic, onset: of the interaction; None as for `mass`.
        resistance [Pa], shear_coefficient, degradation, thickness [m], offset_y, offset_z [m]: of the layers, shape
            [shots, layers]; NaN where a layer has the value of the scene, None if all layers have. Layers beyond the
            columns have the value of the scene. An array of shape [shots] is that of the plate.
    """

    hit_y: Array
    hit_z: Array
    velocity: Array
    obliquity: Array
    azimuth: Array
    pitch: Array
    yaw: Array
    spin: Array
    resistance: Array | None = None
    shear_coefficient: Array | None = None
    degradation: Array | None = None
    thickness: Array | None = None
    mass: Array | None = None
    strength: Array | None = None
    offset_y: Array | None = None
    offset_z: Array | None = None
    static: Array | None = None
    linear: Array | None = None
    quadratic: Array | None = None
    onset: Array | None = None

    def __post_init__(self) -> None:
        """Make arrays of the plate alone columns of layer 0."""
        for name in BY_LAYER:
            if (column := getattr(self, name)) is not None and np.ndim(column) == 1:
                object.__setattr__(self, name, column[:, None])

    def __len__(self) -> int:
        """Number of shots."""
        return len(self.hit_y)

    def __getitem__(self, which: slice | NDArray[np.int64]) -> Self:
        """The shots of a slice or of indices."""
        return type(self)(**{name: values[which] for name, values in self.columns.items()})

    @property
    def columns(self) -> dict[str, NDArray[Any]]:
        """The arrays by name. Arrays that are None are left out."""
        return {f.name: values for f in fields(self) if (values := getattr(self, f.name)) is not None}

    def value(self, name: str, otherwise: float) -> Array:
        """A quantity of every shot, shape [shots], or the value of the scene, shape [1]."""
        return self.columns.get(name, np.array([otherwise]))

    def varies(self, name: str, layer: int) -> bool:
        """Whether the shots have values of a quantity for a layer."""
        column = self.columns.get(name)
        return column is not None and layer < column.shape[1] and not np.isnan(column[:, layer]).all()

    def layer_value(self, target: Target, name: str, layer: int) -> Array:
        """A quantity of a layer of the target; shapes as in `value`."""
        own = self.columns[name][:, layer] if self.varies(name, layer) else np.array([np.nan])
        return np.where(np.isnan(own), target.value(name, layer), own)

    def assign(self, values: Mapping[str, Array], layer: int = 0) -> Self:
        """A copy with these values by quantity, shape [shots] each; quantities of layers change in this layer alone."""
        columns: dict[str, Any] = dict(values)
        for name in columns.keys() & set(BY_LAYER):
            before = self.columns.get(name, np.empty((len(self), 0)))
            missing = max(0, layer + 1 - before.shape[1])
            columns[name] = np.pad(before, ((0, 0), (0, missing)), constant_values=np.nan)
            columns[name][:, layer] = values[name]
        return replace(self, **columns)

    @classmethod
    def joined(cls, parts: Sequence[Self]) -> Self:
        """The shots of all parts, one part after the other; all parts have the same columns."""
        return type(parts[0])(
            **{name: np.concatenate([part.columns[name] for part in parts]) for name in parts[0].columns}
        )
