"""The commands inspect, plot, plate, catalogue and validate: text and figures of what there is."""

import argparse
import re
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from warpimpact.results import attributes as attr

from .options import (
    Commands,
    add_campaign,
    add_command,
    add_device,
    add_measures,
    add_output,
    add_overwrite,
    add_result,
    add_results,
)
from .paths import check_folder, check_picture, named

if TYPE_CHECKING:
    from matplotlib.figure import Figure


def add_inspect(commands: Commands) -> None:
    parser = add_command(
        commands,
        "inspect",
        _inspect,
        summary="print what a result contains",
        description="Print the origin of a result, its numbers with their intervals, and the shots that failed. Of a "
        "sweep, a posterior, a search, a firing test or a replayed hit print what the command that wrote it prints.",
        example="inspect slotted.nc",
    )
    add_result(parser)
    add_measures(parser)
    parser.add_argument("--campaign", action="store_true", help="print only the campaign that the result contains")


def _inspect(arguments: argparse.Namespace) -> None:
    from warpimpact.analysis.effectiveness import effectiveness_text
    from warpimpact.analysis.inspection import inspect_text
    from warpimpact.report.one_file import view_of
    from warpimpact.results import files
    from warpimpact.results.kinds import HIT_MAP
    from warpimpact.view.view import text_of

    kind = files.kind_of(arguments.result)
    if kind is not HIT_MAP and not arguments.campaign:
        print(text_of(view_of(arguments.result, kind, arguments.measure)))
        return
    with files.opened(arguments.result) as dataset:
        if arguments.campaign:
            print(dataset.attrs[attr.CAMPAIGN])
        else:
            print(effectiveness_text(dataset, arguments.measure) if arguments.measure else inspect_text(dataset))


def add_plot(commands: Commands) -> None:
    parser = add_command(
        commands,
        "plot",
        _plot,
        summary="draw maps of a result, or of several results side by side",
        description="Draw the figures of a result as PNG files: maps, marginal distributions, residual velocity "
        "against tilt, and maps of uncertainty where shots scatter or an error was estimated. For several results: "
        "maps side by side with the same colour scale.",
        example="plot slotted.nc -o maps",
    )
    add_results(parser)
    add_output(parser, "FOLDER", "existing folder (default: the folder of the result)")
    add_overwrite(parser, "existing pictures")
    only = parser.add_mutually_exclusive_group()
    only.add_argument(
        "--measure",
        metavar="TEXT",
        help='draw only the map of this measure, such as "P(tilt@130mm > 30 deg)"; takes one result',
    )
    only.add_argument(
        "--variable", metavar="NAME", help="draw only the map of this variable, such as edge_distance; takes one result"
    )


def _plot(arguments: argparse.Namespace) -> None:
    from warpimpact.plotting import measure_map, save_beside, save_maps, variable_map
    from warpimpact.results import files

    datasets = {name: files.read(path) for name, path in named(arguments.results).items()}
    folder = arguments.output or arguments.results[0].parent
    check_folder(folder)
    stem = "_".join(path.stem for path in arguments.results)
    dataset, *others = datasets.values()
    asked: dict[str, tuple[str | None, Callable[..., Figure]]] = {
        "--measure": (arguments.measure, measure_map),
        "--variable": (arguments.variable, variable_map),
    }
    for option, (quantity, draw) in asked.items():
        if quantity is None:
            continue
        if others:
            raise files.ResultError(f"{option}: got {len(datasets)} results, but it draws the map of one")
        try:
            figure = draw(dataset, quantity)
        except ValueError as error:
            raise files.ResultError(f"{option}: {error}") from None
        picture = folder / f"{stem}_{_file_name(quantity)}.png"
        check_picture(picture, overwrite=arguments.overwrite)
        figure.savefig(picture, dpi=150)
        print(picture)
        return
    overwrite = arguments.overwrite
    saved = (
        save_beside(datasets, folder, stem, overwrite=overwrite)
        if others
        else save_maps(dataset, folder, stem, overwrite=overwrite)
    )
    for path in saved:
        print(path)


def _file_name(quantity: str) -> str:
    """A part of a file name for a measure, such as "P_tilt_130mm_above_30_deg"."""
    spoken = quantity.replace(">", " above ").replace("<", " below ")
    return "_".join(re.findall(r"[\w.]+", spoken))


def add_plate(commands: Commands) -> None:
    parser = add_command(
        commands,
        "plate",
        _plate,
        summary="draw the plate of a campaign to scale",
        description="Draw the plate of a campaign to scale, with the largest section of the core. Print open area, "
        "smallest ligament and areal density. No shot is computed.",
        example="plate campaigns/slotted_plate.toml",
    )
    add_campaign(parser)
    add_output(parser, "PLATE.png", "picture file (default: the campaign's name with _plate, in this folder)")
    add_overwrite(parser, "an existing picture")


def _plate(arguments: argparse.Namespace) -> None:
    from warpimpact.analysis.plate_text import plate_numbers
    from warpimpact.campaign.campaign import Campaign
    from warpimpact.campaign.plausible import doubted_holes
    from warpimpact.plotting import plate_figure
    from warpimpact.view.view import Section, labelled, text_of

    output = arguments.output or Path(arguments.campaign.stem + "_plate.png")
    check_picture(output, overwrite=arguments.overwrite)
    campaign = Campaign.from_toml(arguments.campaign)
    plate = campaign.plate
    plate_figure(campaign.target, campaign.core, campaign.title, campaign.impact).savefig(output, dpi=150)
    rows = [("thickness", f"{1e3 * plate.thickness:g} mm")]
    rows += plate_numbers(plate.open_area, plate.ligament, campaign.target.weights).items()
    for place, layer in enumerate(campaign.layer, start=1):
        behind = f"{1e3 * layer.gap:g} mm behind the one before"
        rows.append((f"layer {place}", f"{1e3 * layer.thickness:g} mm, {behind}, {layer.open_area:.1%} open"))
    print(text_of([Section([labelled(rows), *doubted_holes(campaign.target)], campaign.title)]))
    print(output)


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


def add_validate(commands: Commands) -> None:
    parser = add_command(
        commands,
        "validate",
        _validate,
        summary="compute the published shots and compare",
        description="Compute the paper's two shots. Compare them with the paper's model, its experiment and LS-DYNA. "
        "Of a result, tell the hits that come closest to the two shots.",
        example="validate",
    )
    parser.add_argument(
        "campaign",
        type=Path,
        nargs="?",
        metavar="CAMPAIGN.toml|RESULT.nc",
        help="the paper's scene with two hits; lattice and numerics may differ (default: the example paper_shots); or "
        "a result of warpimpact run",
    )
    add_device(parser)


def _validate(arguments: argparse.Namespace) -> None:
    from warpimpact.analysis.paper import check_scene, closest_table, paper_campaign, validation_table
    from warpimpact.campaign.campaign import Campaign
    from warpimpact.results import files
    from warpimpact.runs.run import run

    path = arguments.campaign or paper_campaign()
    if path.suffix == ".nc":
        try:
            print(closest_table(files.read(path)))
        except files.ResultError as error:
            raise files.ResultError(f"{path}: {str(error).removeprefix(f'{path}: ')}") from None
        return
    campaign = Campaign.from_toml(path)
    check_scene(campaign, str(path))
    print(validation_table(run(campaign, device=arguments.device)))
