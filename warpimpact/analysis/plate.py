"""Characteristic numbers of a perforated plate: open area, smallest ligament, areal density."""

from __future__ import annotations

import math


def plate_numbers(open_area: float, ligament: float, areal_density: float, resolution: float = 0.0) -> dict[str, str]:
    """Numbers of a plate as text with units, by name.

    Args:
        open_area: share of holes.
        ligament: the smallest one [m]; inf if there is none, and then it is left out.
        areal_density: [kg/m²].
        resolution: resolution of the ligament [m]; 0 if it is exact.
    """
    numbers = {"open area": f"{open_area:.1%}"}
    if math.isfinite(ligament):
        numbers["smallest ligament"] = f"{1e3 * ligament:.2f} mm"
        if resolution:
            numbers["smallest ligament"] += f" (resolved to {1e3 * resolution:g} mm)"
    return numbers | {"areal density": f"{areal_density:.1f} kg/m²"}
