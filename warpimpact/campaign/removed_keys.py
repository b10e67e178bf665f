"""Keys that files of earlier versions have, and what to use instead."""

from collections.abc import Iterator
from typing import Any

REMOVED_KEYS: dict[str, str] = {
    "search.allow_untested": "leave it out; the front names designs outside the tested range",
    "output.layer_standoffs": "layer_tilt and layer_residual_velocity say how a core leaves each layer",
    "assumptions": "run warpimpact sensitivity CAMPAIGN.toml",
    "burst": "cracks and bulges decide several hits on one plate, and the model lacks them; compute single hits",
    "layer.degradation_depth": "leave it out: a layer weakens as a whole; give thick layers degradation = 1",
    "plate.degradation_depth": "leave it out: a plate weakens as a whole; give thick plates degradation = 1",
    "posterior": "use hits.file with the CSV file that `warpimpact identify` writes",
    "plate.pattern.shape = supershape": 'use shape = "slot", which protects no worse, or shape = "polygons"',
    "plate.pattern.shape = level_set": 'use shape = "slot", which protects no worse, or shape = "polygons"',
    "plate.pattern.cell_size": "leave it out: polygons are exact",
    "plate.pattern.smallest_feature": "leave it out, and round the corners of the polygons",
    "published": "put published limits into a comment; warpimpact catalogue shows those of its materials",
    "procedure.name = 3pod": "use langlie",
    "procedure.name = neyer": "use langlie",
    "directions": "sweep impact.obliquity and impact.azimuth",
    "requirement": "give proof.velocity and the core of the campaign",
    "search.most_hits": "use search.hits, which every design gets",
    "numerics.coarser": "A level sets all settings. Use numerics.level, or patches_axial, grid_spacing and travel.",
}
"""The sentence for each key, by its dotted path without numbers of list items; or for a value, as "key = value"."""


def check_removed(tables: dict[str, Any], name: str) -> None:
    """Refuse tables with a key that was removed.

    Raises:
        ValueError: names the file, the key and what to use instead.
    """
    for path, value in _entries(tables, ""):
        for key in (path, f"{path} = {value}") if isinstance(value, str) else (path,):
            if key in REMOVED_KEYS:
                raise ValueError(f"{name}: {key} was removed: {REMOVED_KEYS[key]}")


def _entries(value: Any, path: str) -> Iterator[tuple[str, Any]]:
    """Dotted paths and values of all keys; items of a list have the path of the list."""
    if isinstance(value, dict):
        for key, inner in value.items():
            place = f"{path}.{key}" if path else str(key)
            yield place, inner
            yield from _entries(inner, place)
    elif isinstance(value, list):
        for inner in value:
            yield from _entries(inner, path)
