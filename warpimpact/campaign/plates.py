"""Reads a campaign file with several plates as one campaign per plate."""

import json
import re
from pathlib import Path
from typing import Any

from ..results.kinds import CAMPAIGN
from ..scene.units import quoted
from .campaign import Campaign
from .text import CampaignError, parsed, read_text

_PLATE_NAME = re.compile(r"\w[\w .+-]{,79}")
"""Names of plates; the result files get the same names."""


def read_plates(path: str | Path, *, count: int | None = None) -> dict[str, Campaign]:
    """Read a campaign file with several tables `[[plate]]`, each with a `name`; everything else is shared.

    Tables `[[plate.layer]]` stand behind one of the plates, before what tables `[[layer]]` put behind every plate.

    Args:
        path: the TOML file.
        count: number of hits, instead of the file's.

    Returns:
        Name of each plate → its campaign, in the order of the file.

    Raises:
        CampaignError: the file is missing, is not TOML, has only one plate, or contains an invalid value.
    """
    path = Path(path)
    shared = parsed(read_text(path), str(path), CAMPAIGN)
    plates, behind = shared.pop("plate", None), shared.pop("layer", None)
    if not isinstance(plates, list) or len(plates) < 2:
        raise CampaignError(f"{path}: plate: a comparison needs two or more tables [[plate]], each with a name")
    hits = shared.get("hits")
    if isinstance(hits, dict):
        shared["hits"] = {"irreducible": False} | hits  # the same hits for plates of different symmetry
    campaigns: dict[str, Campaign] = {}
    for place, plate in enumerate(plates):
        name = _name(plate, f"{path}: plate[{place}].name")
        if name in campaigns:
            raise CampaignError(f'{path}: plate[{place}].name: got "{name}" again, but each plate needs its own name')
        rest = {key: value for key, value in plate.items() if key not in ("name", "layer")}
        layers = _layers(plate.get("layer"), f"{path}: plate[{place}].layer") + _layers(behind, f"{path}: layer")
        title = {"title": f"{shared['title']}: {name}"} if isinstance(shared.get("title"), str) else {}
        campaigns[name] = Campaign.from_text(
            json.dumps(
                shared | title | {"plate": rest} | ({"layer": layers} if layers else {}),
                indent=1,
                ensure_ascii=False,
                default=str,
            ),
            name=f'{path}, plate "{name}"',
            folder=path.parent,
            count=count,
        )
    return campaigns


def _name(plate: Any, place: str) -> str:
    if not isinstance(plate, dict) or "name" not in plate:
        raise CampaignError(f"{place}: is missing, but must be given")
    name = plate["name"]
    if not isinstance(name, str) or not _PLATE_NAME.fullmatch(name):
        raise CampaignError(
            f"{place}: got {quoted(name)}, but a name begins with a letter or a digit and contains only letters, "
            "digits, blanks and the characters _ . + -, 80 at most"
        )
    return name


def _layers(tables: Any, place: str) -> list[Any]:
    if tables is None:
        return []
    if not isinstance(tables, list):
        raise CampaignError(f"{place}: got {quoted(tables)}, but it must be a list: tables [[layer]]")
    return tables
