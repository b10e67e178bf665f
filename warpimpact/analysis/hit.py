"""What a person wants to know first of a single hit that was computed again."""

from __future__ import annotations

import xarray

from warpimpact.kernels.status import Status

_AGREEMENT = {
    "bit-identical": "The end is bit-identical to the stored outcome.",
    "within rounding": "The end equals the stored outcome within rounding, as it does after another device.",
    "different": "The end DIFFERS from the stored outcome, which another version of warpimpact must have computed.",
}


def hit_text(history: xarray.Dataset) -> str:
    """How a replayed hit ended, as a few lines."""
    place = ", ".join(f"{axis} = {float(history[f'hit_{axis}']) * 1e3:.3f} mm" for axis in "yz")
    lines = [
        f"hit {history.attrs['hit']} at {place}",
        Status(int(history["status"])).sentence,
        f"{'residual velocity':<20}{float(history['residual_velocity']):>8.1f} m/s",
    ]
    lines += [
        f"{f'tilt at {float(tilt.standoff) * 1e3:g} mm':<20}{float(tilt):>8.1f} °"
        for tilt in history["tilt"]
        if tilt.notnull()
    ]
    return "\n".join([*lines, _AGREEMENT[history.attrs["agreement"]]])
