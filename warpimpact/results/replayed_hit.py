"""The file of a replayed hit: what is shown of it."""

from __future__ import annotations

import pandas as pd
import xarray

from warpimpact.kernels.status import Status
from warpimpact.results import attributes as attr
from warpimpact.results import variables as v

_AGREEMENT = {
    "bit-identical": "The end is bit-identical to the stored outcome.",
    "within rounding": "The end equals the stored outcome within rounding, as expected of another device.",
    "different": "The end DIFFERS from the stored outcome; probably another version of warpimpact computed it.",
}


def hit_view(history: xarray.Dataset) -> dict[str, list[str | pd.DataFrame]]:
    """Where a replayed hit was, how it ended, whether the core broke, and whether it agrees with the stored outcome."""
    place = ", ".join(f"{axis} = {float(history[v.HIT_POINT[axis]]) * 1e3:.3f} mm" for axis in "yz")
    tilts = [tilt for tilt in history[v.TILT] if tilt.notnull()]
    numbers = {
        "residual velocity": f"{float(history[v.RESIDUAL_VELOCITY]):.1f} m/s",
        **{f"tilt at {float(tilt.standoff) * 1e3:g} mm": f"{float(tilt):.1f} °" for tilt in tilts},
    }
    table = pd.DataFrame({"": numbers})
    broken = []
    if v.BROKEN in history:
        time, section = float(history[v.BROKEN_TIME]) * 1e6, float(history[v.BROKEN_SECTION]) * 1e3
        where = f"after {time:.1f} µs, {section:.1f} mm behind the nose. The computed core goes on as one body."
        passed = f"The bending stress passed the core's strength {where}"
        broken = [passed if history[v.BROKEN] else "The bending stress stayed below the core's strength."]
    end, agreement = Status(int(history[v.STATUS])).sentence, _AGREEMENT[history.attrs[attr.AGREEMENT]]
    return {f"hit {history.attrs[attr.HIT]} at {place}": [end, table, *broken, agreement]}
