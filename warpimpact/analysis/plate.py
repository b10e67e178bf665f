"""The few numbers that tell one perforated plate from another."""

from __future__ import annotations

import math


def plate_numbers(open_area: float, ligament: float, areal_density: float, resolution: float = 0.0) -> dict[str, str]:
    """Numbers of a plate as a person reads them, by their names.

    Args:
        open_area: share of holes.
        ligament: the smallest one [m]; inf where there is none, which is then left out.
        areal_density: [kg/m²].
        resolution: of the ligament [m].
    """
    numbers = {"open area": f"{open_area:.1%}"}
    if math.isfinite(ligament):
        numbers["smallest ligament"] = f"{1e3 * ligament:.2f} mm"
        if resolution:
            numbers["smallest ligament"] += f" (resolved to {1e3 * resolution:g} mm)"
    return numbers | {"areal density": f"{areal_density:.1f} kg/m²"}
