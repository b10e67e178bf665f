"""Words for what a pilot is asked for and finds."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from decimal import ROUND_CEILING, Context


def hits_text(share: float) -> str:
    """So many of the hits."""
    return f"{100.0 * share:.3g} % of the hits"


def errors_text(velocity: float, tilt: float, depth: float = math.nan, status: float = math.nan) -> str:
    """Errors of residual velocity [m/s] and tilt [degree]; of depth [m] and of the status, where there is one."""
    parts = [f"{upper_digits(velocity)} m/s", f"{upper_digits(tilt)} deg"]
    if not math.isnan(depth):
        parts.append(f"{upper_digits(1e3 * depth)} mm of depth")
    if status > 0.0:
        parts.append(f"the status of {100.0 * status:.2g} % of the hits")
    return _listed(parts)


def _listed(parts: Sequence[str]) -> str:
    return " and ".join([", ".join(parts[:-1]), parts[-1]] if len(parts) > 1 else parts)


def limit_error_text(error: float, quantity: str) -> str:
    """Error of a limit velocity [m/s] or of a limit thickness [m]."""
    return f"{upper_digits(error)} m/s" if quantity == "velocity" else f"{upper_digits(1e3 * error)} mm"


def upper_digits(error: float) -> str:
    """An error rounded up to two digits, so that one above a bound never reads as if it were at the bound."""
    up = Context(prec=2, rounding=ROUND_CEILING).create_decimal(f"{error:.9g}")  # nine digits: noise does not count
    return f"{float(up):g}"


def accuracy_text(asked: Mapping[str, float], *, layered: bool) -> str:
    """What is asked for, by the names of `Accuracy`: SI. What is not there is not asked for."""

    def bound(name: str, unit: str, factor: float = 1.0) -> str:
        share = asked.get(f"{name}_share", 0.0) if layered else 0.0
        return f"{factor * asked[name]:g} {unit}" + (f" + {100.0 * share:g} %" if share else "")

    parts = [bound("residual_velocity", "m/s")] if "residual_velocity" in asked else []
    parts += [bound("tilt", "deg", math.degrees(1.0))] if "tilt" in asked else []
    if layered and "depth" in asked:
        parts.append(f"{1e3 * asked['depth']:g} mm of depth")
    stated = f"{_listed(parts)} for {hits_text(asked['share'])}"
    if layered and asked.get("status_share", 1.0) < 1.0:
        stated += f", another status for at most {100.0 * asked['status_share']:g} %"
    return stated
