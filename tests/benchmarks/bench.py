"""Common parts of the benchmarks: the checkout, the scene, the clock, the machine."""

from __future__ import annotations

import json
import os
import platform
import sys
import time
from collections.abc import Callable
from datetime import UTC, datetime
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

CHECKOUT = Path(__file__).resolve().parents[2]
sys.path.append(str(CHECKOUT))  # an installed warpimpact comes first; without one the checkout will do

import warpimpact  # noqa: E402

if find_spec("warpimpact.kernels") is None:
    warpimpact.__path__.append(str(CHECKOUT))  # kernels/ and campaigns/ install inside the package

from warpimpact import Campaign  # noqa: E402
from warpimpact.scene import Core, Hits, Record, Scene, Shots, make_shots  # noqa: E402

Array = NDArray[np.float64]
CAMPAIGN = CHECKOUT / "campaigns" / "slotted_plate.toml"
RESULTS = Path(__file__).resolve().parent / "results"


SCENES = {"slotted plate": "slotted_plate", "round holes": "round_holes", "ogive with a shank": "ogive_core"}
"""Campaigns by the name of their scene."""


def campaign_of(file: str) -> Campaign:
    """A campaign of the checkout."""
    return Campaign.from_toml(CHECKOUT / "campaigns" / f"{file}.toml")


def scene_of(campaign: Campaign) -> Scene:
    """The scene of a campaign with its last stand-off alone, as the peers have it."""
    record = Record(standoffs=campaign.output.standoffs[-1:])
    return Scene(core=campaign.core, target=campaign.plate, interaction=campaign.interaction, record=record)


def shots_of(campaign: Any, count: int) -> Shots:
    """A campaign's shots at the first `count` Sobol points of its seed."""
    return make_shots(campaign.impact, Hits(count=count, seed=campaign.hits.seed), campaign.plate)


def copied(shots: Shots, copies: int) -> Shots:
    """The shots, repeated `copies` times."""
    return Shots(**{name: np.tile(values, copies) for name, values in shots.columns.items()})


def launch_state(core: Core, shots: Shots) -> tuple[Array, Array, Array]:
    """Line of flight, axis, and position of the centre of mass relative to the hit [m], each of shape [shots, 3], when
    the foremost point is at the front face (docs/model.md §1)."""
    sine = np.sin(shots.obliquity)
    flight = np.stack([np.cos(shots.obliquity), sine * np.cos(shots.azimuth), sine * np.sin(shots.azimuth)], axis=1)
    yaw = np.arctan2(flight[:, 1], flight[:, 0]) + shots.yaw
    pitch = np.arctan2(flight[:, 2], flight[:, 0]) + shots.pitch
    axis = np.stack([np.ones(len(shots)), np.tan(yaw), np.tan(pitch)], axis=1)
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    s = np.linspace(0.0, core.length, 4097)
    ahead = core.mass_properties.centre_of_mass - s
    across = np.sqrt(np.maximum(0.0, 1.0 - axis[:, :1] ** 2))
    foremost = (ahead * axis[:, :1] + core.radius(s) * across).max(axis=1)
    return flight, axis, -(foremost / flight[:, 0])[:, None] * flight


def tilt_behind(
    core: Core, thickness: float, standoff: float, flight: Array, state: tuple[Array, Array, Array, Array]
) -> Array:
    """Tilt [rad], shape [shots], when the centre of mass has passed a stand-off [m] in torque-free flight.

    Args:
        state: position, axis, velocity, angular momentum after contact, each of shape [shots, 3].
    """
    position, axis, velocity, momentum = state
    time_of_flight = (thickness + standoff - position[:, 0]) / velocity[:, 0]
    size = np.maximum(np.linalg.norm(momentum, axis=1, keepdims=True), 1e-30)
    about = momentum / size
    angle = size * time_of_flight[:, None] / core.mass_properties.inertia_transverse
    along = (about * axis).sum(axis=1, keepdims=True) * about
    then = along + np.cos(angle) * (axis - along) + np.sin(angle) * np.cross(about, axis)
    return np.arctan2(np.linalg.norm(np.cross(then, flight), axis=1), (then * flight).sum(axis=1))


def spent(work: Callable[[], Any]) -> tuple[Any, float]:
    """What a call gives, and its processor time [s]."""
    begin = time.process_time()
    found = work()
    return found, time.process_time() - begin


def seconds(work: Callable[[], Any]) -> float:
    """How long one call takes [s]."""
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def cores() -> int:
    """Cores this process may use."""
    return len(os.sched_getaffinity(0))


def machine() -> dict[str, str | int]:
    """The machine on which the figures were measured, and the date."""
    names = [line.split(":", 1)[1].strip() for line in _cpuinfo() if line.startswith("model name")]
    return {
        "processor": names[0] if names else platform.processor(),
        "cores": cores(),
        "python": platform.python_version(),
        "date": f"{datetime.now(UTC):%Y-%m-%d}",
    }


def _cpuinfo() -> list[str]:
    path = Path("/proc/cpuinfo")
    return path.read_text().splitlines() if path.exists() else []


def store(name: str, values: dict[str, Any], figure: Any = None) -> None:
    """Write results/NAME.json and, for a figure, results/NAME.png; print the paths."""
    RESULTS.mkdir(exist_ok=True)
    path = RESULTS / f"{name}.json"
    path.write_text(json.dumps(values, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
    print(path)
    if figure is not None:
        figure.savefig(path.with_suffix(".png"), dpi=130)
        print(path.with_suffix(".png"))
