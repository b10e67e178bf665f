"""Designs that are small enough to search in a second."""

from pathlib import Path

from warpimpact.optimisation.design import Design, design_from

CORE = """
title = "a plate"
core = { shape = "polynomial", coefficients = [3.0e-4, 0.24, -5.29], length = "27.86 mm", mass = "4 g" }
[impact]
velocity = "825 m/s"
[numerics]
level = 0
[output]
standoffs = ["50 mm", "130 mm"]
[plate]
thickness = "4 mm"
resistance = "2600 MPa"
"""
HOLES = """
[plate.pattern]
shape = "circle"
diameter = "5 mm"
spacing = ["8 mm", "8 mm"]
"""
WEIGHT_AND_ENERGY = """
[[objectives]]
measure = "areal_density"
[[objectives]]
measure = "mean(residual_energy_fraction)"
"""
SEARCH = """[search]
designs = 12
population = 6
hits = 64
confirm_hits = 64
"""


def design(*parts: str, folder: Path = Path()) -> Design:
    """A design of a plate with these tables behind it."""
    return design_from("\n".join([CORE, *parts]), "design.toml", folder)
