"""Figure of a core to scale: its profile, its centre of mass, and its evidence."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np
from matplotlib.figure import Figure

from warpimpact.plotting.heading import add_heading, note_lines

if TYPE_CHECKING:
    from warpimpact.scene import Core

_MM, _G = 1e3, 1e3
_PROFILE_STATIONS = 801
_WIDTH = 7.5  # of the figure [inch]


def core_figure(core: Core, title: str, evidence: str) -> Figure:
    """Draw a core in its section, nose to the left, with its evidence below."""
    lines = note_lines(_WIDTH, "", [evidence])
    s = np.linspace(0.0, core.length, _PROFILE_STATIONS)
    r = core.radius(s)
    height = 0.95 * _WIDTH * 2.0 * core.max_radius / core.length + 1.1 + 0.2 * len(lines)
    figure = Figure(figsize=(_WIDTH, height), layout="constrained")
    axes = figure.subplots()
    outline_s, outline_r = np.concatenate([s, s[::-1]]), np.concatenate([r, -r[::-1]])
    axes.fill(outline_s * _MM, outline_r * _MM, facecolor="0.8", edgecolor="black", linewidth=1.0)
    properties = core.mass_properties
    axes.plot(properties.centre_of_mass * _MM, 0.0, "+", color="#D55E00", ms=12, mew=2)
    axes.annotate(
        "centre of mass", (properties.centre_of_mass * _MM, 0.0), (10.0, 0.0), textcoords="offset points", va="center"
    )
    axes.set(aspect="equal", xlabel="behind the nose [mm]", ylabel="radius [mm]")
    numbers = f"{core.length * _MM:.4g} mm, \u2300 {2 * core.max_radius * _MM:.4g} mm, {properties.mass * _G:.4g} g"
    add_heading(figure, f"{title}: {numbers}", evidence)
    return figure
