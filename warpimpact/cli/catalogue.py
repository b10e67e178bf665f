"""The command catalogue: threats and materials by name, with what is known of them."""

import argparse
from pathlib import Path

from .options import Commands, add_command, add_output, add_overwrite
from .paths import check_picture


def add_catalogue(commands: Commands) -> None:
    parser = add_command(
        commands,
        "catalogue",
        _catalogue,
        summary="list threats and materials by name, or show one",
        description="List the threats and materials that a campaign may name, or show one: core drawn, masses, "
        "velocities of standards; strength, rows and range; what is known from where, and what is assumed.",
        example='catalogue ".30 AP M2" -o core.png',
    )
    parser.add_argument("name", nargs="?", metavar="NAME", help="threat or material (default: list all)")
    parser.add_argument("--file", type=Path, metavar="MINE.toml", help="entries of your own, as a campaign names them")
    add_output(parser, "CORE.png", "draw the core of a threat into this picture")
    add_overwrite(parser, "an existing picture")


def _catalogue(arguments: argparse.Namespace) -> None:
    from warpimpact.campaign.text import CampaignError
    from warpimpact.catalogue.catalogue import Catalogue
    from warpimpact.catalogue.catalogue_view import catalogue_view, material_view, threat_view
    from warpimpact.catalogue.entries import Material, Threat
    from warpimpact.view.view import text_of

    try:
        catalogue = Catalogue.of(arguments.file)
        entry = None if arguments.name is None else catalogue.entry(arguments.name)
    except ValueError as error:
        raise CampaignError(str(error)) from None
    core = entry.shape if isinstance(entry, Threat) else None
    if arguments.output and core is None:
        raise CampaignError("--output: only a threat whose core is known can be drawn")
    if entry is None:
        print(text_of(catalogue_view(catalogue)))
    else:
        is_own = isinstance(entry, Material) and catalogue.is_own(entry)
        view = threat_view(entry) if isinstance(entry, Threat) else material_view(entry, is_own=is_own)
        print(text_of(view))
    if arguments.output and core is not None and entry is not None:
        from warpimpact.plotting.plate import core_figure

        check_picture(arguments.output, overwrite=arguments.overwrite)
        core_figure(core, entry.name, entry.evidence).savefig(arguments.output, dpi=150)
        print(arguments.output)
