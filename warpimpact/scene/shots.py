"""Shots: how the core arrives, and where (MODEL §1)."""

import math
from dataclasses import dataclass, fields
from functools import cached_property
from typing import Annotated, Literal, Self

import numpy as np
from pydantic import Field, model_validator

from .files import InputFile, read_table
from .model import Array, Model
from .plate import Plate
from .symmetry import IDENTITY, Symmetry, irreducible_part, symmetries
from .units import Angle, AngularVelocity, PositiveSpeed

_RIGHT_ANGLE = np.pi / 2

_Tilt = Annotated[Angle, Field(gt=-_RIGHT_ANGLE, lt=_RIGHT_ANGLE)]


class Impact(Model):
    """Velocity and attitude at impact, the same for all shots of a campaign.

    Attributes:
        velocity: [m/s].
        obliquity: angle between line of flight and plate normal [rad].
        azimuth: direction of the obliquity in the plate, from +y towards +z [rad].
        pitch, yaw: projected attitude of the axis beyond that of the line of flight [rad].
        spin: about the axis of the core [rad/s].
    """

    velocity: PositiveSpeed
    obliquity: Annotated[Angle, Field(ge=0, lt=_RIGHT_ANGLE)] = 0.0
    azimuth: Angle = 0.0
    pitch: _Tilt = 0.0
    yaw: _Tilt = 0.0
    spin: AngularVelocity = 0.0

    @model_validator(mode="after")
    def _flies_nose_first(self) -> Self:
        """The axis is built from its projected angles, which flip at 90 degrees."""
        flight = np.tan(self.obliquity) * np.array([np.sin(self.azimuth), np.cos(self.azimuth)])
        for name, own, of_flight in zip(("pitch", "yaw"), (self.pitch, self.yaw), np.arctan(flight), strict=True):
            if abs(own + of_flight) >= _RIGHT_ANGLE:
                raise ValueError(
                    f"got {name} = {math.degrees(own):g} deg on a line of flight that has {math.degrees(of_flight):.4g}"
                    f" deg of its own, but their sum must lie between -90 and 90 deg"
                )
        return self


class Hits(Model):
    """Where the cores hit.

    Attributes:
        sampling: "sobol" (scrambled, even at any count), "random" (independent), "grid" (cell centres), or
            "list" (those of `file`).
        count: how many; a grid takes the most that a rectangle of nearly square cells gives.
        seed: of a sobol or random sampling.
        file: CSV file of a list, with the header hit_y,hit_z in metres.
        irreducible: sample only the part of the unit cell that the symmetries of plate and shot leave over, and give
            each hit there with its images, as many in all as `count` holds, or one hit's.
    """

    sampling: Literal["sobol", "grid", "random", "list"] = "sobol"
    count: Annotated[int, Field(strict=True, ge=1, le=2**30)] | None = None
    seed: Annotated[int, Field(strict=True, ge=0)] = 0
    file: InputFile | None = None
    irreducible: Annotated[bool, Field(strict=True)] = False

    @model_validator(mode="after")
    def _is_complete(self) -> Self:
        needed, foreign = ("file", {"count", "seed", "irreducible"}) if self.sampling == "list" else ("count", {"file"})
        if getattr(self, needed) is None:
            raise ValueError(f'got sampling = "{self.sampling}" without {needed}, which it needs')
        for name in sorted(foreign):
            if getattr(self, name) != type(self).model_fields[name].default:
                raise ValueError(f'got {name} beside sampling = "{self.sampling}", which takes none')
        _ = self.listed
        return self

    @cached_property
    def listed(self) -> Array | None:
        """Hit points of the file [m], shape [hits, 2]; None where there is no file."""
        return None if self.file is None else read_table(self.file, ("hit_y", "hit_z"))

    def points(self, period: tuple[float, float]) -> tuple[Array, Array]:
        """Hit points (y, z) [m], both of shape [hits], over a unit cell centred on the origin.

        Hit k of a sobol or random sampling depends on the seed and k only, but for the scale.

        Args:
            period: extent of the unit cell along y and z [m].
        """
        if self.listed is not None:
            return self.listed[:, 0], self.listed[:, 1]
        assert self.count is not None  # validated
        match self.sampling:
            case "grid":
                unit = _grid(self.count, period[0] / period[1])
            case "random":
                unit = np.random.Generator(np.random.Philox(self.seed)).random((self.count, 2))
            case _:
                unit = _sobol(self.count, self.seed)
        return (unit[:, 0] - 0.5) * period[0], (unit[:, 1] - 0.5) * period[1]


def _sobol(count: int, seed: int) -> Array:
    """Points of the unit square, shape [count, 2]."""
    from scipy.stats.qmc import Sobol  # a second to import

    # The sequence is balanced at powers of two; any other count is the start of the next longer one.
    points: Array = Sobol(d=2, rng=seed).random_base2((count - 1).bit_length())[:count]
    return points


def _grid(count: int, aspect: float) -> Array:
    """Centres of at most `count` cells, nearly square for a y side of `aspect` z sides; shape [cells, 2]."""
    along_y = min(count, max(1, round(math.sqrt(count * aspect))))
    along_z = count // along_y
    y, z = ((np.arange(n) + 0.5) / n for n in (along_y, along_z))
    return np.stack(np.meshgrid(y, z, indexing="ij"), axis=-1).reshape(-1, 2)


@dataclass(frozen=True)
class Shots:
    """Shots as arrays, each of shape [shots], in SI and radians; `Impact` says what the angles are.

    Attributes:
        hit_y, hit_z: where the line of flight of the centre of mass crosses the front face [m].
        velocity: impact velocity [m/s].
        obliquity, azimuth: of the line of flight [rad].
        pitch, yaw: of the axis, beyond those of the line of flight [rad].
        spin: about the axis [rad/s].
    """

    hit_y: Array
    hit_z: Array
    velocity: Array
    obliquity: Array
    azimuth: Array
    pitch: Array
    yaw: Array
    spin: Array

    def __len__(self) -> int:
        """Number of shots."""
        return len(self.hit_y)

    def __getitem__(self, which: slice) -> Self:
        """The shots of a slice."""
        return type(self)(*(getattr(self, field.name)[which] for field in fields(self)))


def symmetries_used(impact: Impact, hits: Hits, plate: Plate) -> tuple[Symmetry, ...]:
    """Symmetries by which the hits are images of each other; the identity alone where none is asked for or there."""
    return symmetries(plate, impact) if hits.irreducible else (IDENTITY,)


def make_shots(impact: Impact, hits: Hits, plate: Plate) -> Shots:
    """Shots at the hit points over one unit cell of the plate, or over all of a plate smaller than that.

    With hits.irreducible each shot is followed by its images under `symmetries_used`, the first of which it is itself.
    """
    cell, group = plate.sampled_cell, symmetries_used(impact, hits, plate)
    if hits.count is not None:
        hits = hits.model_copy(update={"count": max(1, hits.count // len(group))})
    part = irreducible_part(group)
    extent_y, extent_z = (side * (high - low) for side, (low, high) in zip(cell, part, strict=True))
    middle_y, middle_z = (0.5 * side * (high + low) for side, (low, high) in zip(cell, part, strict=True))
    hit_y, hit_z = hits.points((extent_y, extent_z))
    images = np.array([symmetry.image(hit_y + middle_y, hit_z + middle_z, cell) for symmetry in group])
    hit_y, hit_z = images.transpose(1, 2, 0).reshape(2, -1)
    alike = {name: np.full(len(hit_y), value) for name, value in impact}
    return Shots(hit_y=hit_y, hit_z=hit_z, **alike)
