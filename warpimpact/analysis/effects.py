"""What every shot says of how well a plate protects: defined, cited, one number per shot."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np
import xarray
from numpy.typing import NDArray
from pydantic import TypeAdapter

from warpimpact.analysis.summary import slices
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v
from warpimpact.results.dataset import failed, passed
from warpimpact.results.files import ResultError
from warpimpact.scene import AnyCore, Core

Array = NDArray[np.float64]

_NEEDED = (v.STATUS, v.IMPACT_VELOCITY, v.RESIDUAL_VELOCITY, v.TILT, v.MASS)


@dataclass(frozen=True)
class Effect:
    """What is measured of each shot.

    Attributes:
        name: for programs.
        label: for people.
        units: "1", or "J mm-2".
        definition: one sentence.
        source: where it comes from.
        higher_is_better: for whoever is behind the plate.
        kind: "mean" of any numbers, larger where it is worse, or "share" of numbers 0 and 1.
        values: of a hit map, NaN where a shot does not count.
    """

    name: str
    label: str
    units: str
    definition: str
    source: str
    higher_is_better: bool
    kind: str
    values: Callable[[xarray.Dataset], Array]

    def over(self, dataset: xarray.Dataset) -> Array:
        """Values of all shots, shape [hits]; of an open file a slice is in memory at a time."""
        needed = [name for name in _NEEDED if name in dataset]
        return np.concatenate([self.values(part) for part in slices(dataset[needed].drop_vars(v.HIT, errors="ignore"))])


def effects(dataset: xarray.Dataset, *, angle: float, standoff: float | None) -> Iterator[Effect]:
    """All there are for a result.

    Args:
        angle: inclination beyond which a core counts as tilted [rad].
        standoff: distance behind the rear face [m]; the largest of the result if None.

    Raises:
        ResultError: the result has no such stand-off.
    """
    standoff, degrees = _at_standoff(dataset, standoff), math.degrees(angle)
    at = f"{standoff * 1e3:g} mm"
    yield Effect(
        name="residual_energy_fraction",
        label="residual energy fraction",
        units="1",
        definition="Kinetic energy of translation behind the plate as a fraction of that on impact, (v_r/v_0)²; 0 for "
        "a core that was arrested or ricocheted.",
        source="R. F. Recht, T. W. Ipson, Journal of Applied Mechanics 30 (1963) 384",
        higher_is_better=False,
        kind="mean",
        values=_energy_fraction,
    )
    if attr.CORE in dataset.attrs:
        yield Effect(
            name="residual_energy_density",
            label=f"proxy: energy per presented area at {at}",
            units="J mm-2",
            definition="Kinetic energy of translation behind the plate over the area of the core's silhouette along "
            f"the line of fire {at} behind it, nose or base first alike; 0 for a core that was arrested or "
            "ricocheted. A proxy of how deep the core goes into what follows, which takes resistance times area from "
            "it per depth.",
            source="G. Ben-Dor, A. Dubinsky, T. Elperin, Applied Mechanics Reviews 58 (2005) 355; the silhouette of "
            "a convex body is Cauchy's",
            higher_is_better=False,
            kind="mean",
            values=_energy_density(TypeAdapter[Core](AnyCore).validate_json(dataset.attrs[attr.CORE]), standoff),
        )
    yield Effect(
        name="tilted_share",
        label=f"P(inclined > {degrees:g}° at {at}, or stopped)",
        units="1",
        definition=f"Share of the shots that {at} behind the plate are inclined to the line of fire by more than "
        f"{degrees:g}°, tilt beyond 90° counted back from 180°, or that do not get there because they were arrested "
        "or ricocheted.",
        source="Numerical and experimental investigation of asymmetrical contact between a steel plate and "
        "armour-piercing projectiles: what protects is mostly the distortion of the trajectory",
        higher_is_better=True,
        kind="share",
        values=_is_tilted(degrees, standoff),
    )
    yield Effect(
        name="stopped_share",
        label="P(stopped)",
        units="1",
        definition="Share of the shots that do not pass the plate: arrested in it, or ricocheted off it.",
        source="partial penetration as in MIL-STD-662F, V50 Ballistic Test for Armor",
        higher_is_better=True,
        kind="share",
        values=lambda part: np.where(failed(part), np.nan, ~passed(part)),
    )


def _at_standoff(dataset: xarray.Dataset, standoff: float | None) -> float:
    """The stand-off of a result that is meant [m]."""
    distances = dataset[v.STANDOFF].values
    if standoff is None:
        return float(distances[-1])
    nearest = float(distances[np.argmin(np.abs(distances - standoff))])
    if not np.isclose(nearest, standoff, rtol=1e-9, atol=0.0):
        known = ", ".join(f"{distance * 1e3:g} mm" for distance in distances)
        raise ResultError(f"standoff: got {standoff * 1e3:g} mm, but the result has {known}")
    return nearest


def _of_passed(part: xarray.Dataset, values: Array, otherwise: float) -> Array:
    """Values of the cores that passed the plate, something else of those that did not, NaN of failed computations."""
    return np.where(failed(part), np.nan, np.where(passed(part), values, otherwise))


def _energy_fraction(part: xarray.Dataset) -> Array:
    fraction = (part[v.RESIDUAL_VELOCITY].values.astype(float) / part[v.IMPACT_VELOCITY].values) ** 2
    return _of_passed(part, fraction, 0.0)


def _inclination(part: xarray.Dataset, standoff: float) -> Array:
    """Between axis and line of fire, nose or base first alike [degree], shape [hits]."""
    tilt = part[v.TILT].sel(standoff=standoff, method="nearest").values.astype(float)
    return np.asarray(np.minimum(tilt, 180.0 - tilt))


def _energy_density(core: Core, standoff: float) -> Callable[[xarray.Dataset], Array]:
    """Of a core, whose silhouette is tabulated: a quarter of a degree errs by 1e-5."""
    table = np.linspace(0.0, 90.0, 361)
    silhouette = core.presented_area(np.radians(table)) * 1e6

    def values(part: xarray.Dataset) -> Array:
        mass = part[v.MASS].values if v.MASS in part else core.mass_properties.mass
        energy = 0.5 * mass * part[v.RESIDUAL_VELOCITY].values.astype(float) ** 2
        return _of_passed(part, energy / np.interp(_inclination(part, standoff), table, silhouette), 0.0)

    return values


def _is_tilted(degrees: float, standoff: float) -> Callable[[xarray.Dataset], Array]:
    def values(part: xarray.Dataset) -> Array:
        inclination = _inclination(part, standoff)
        return _of_passed(part, np.where(np.isnan(inclination), np.nan, inclination > degrees), 1.0)

    return values
