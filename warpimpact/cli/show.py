"""The commands inspect, plot, plate, catalogue and validate: text and figures of what there is."""

import argparse
import re
from collections.abc import Callable
from pathlib import Path

from matplotlib.figure import Figure

from warpimpact.analysis.effectiveness import effectiveness_view, plate_numbers
from warpimpact.analysis.inspection import inspect_view
from warpimpact.analysis.numbers import text_of
from warpimpact.analysis.paper import check_scene, closest_table, paper_campaign, validation_table
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.plausible import doubted_holes
from warpimpact.campaign.text import CampaignError
from warpimpact.catalogue.catalogue import Catalogue
from warpimpact.catalogue.catalogue_view import catalogue_view, material_view, threat_view
from warpimpact.catalogue.entries import Material, Threat
from warpimpact.plotting import measure_map, plate_figure, save_maps, save_side_by_side, variable_map
from warpimpact.plotting.plate import core_figure
from warpimpact.report.one_file import view_of
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results.kinds import HIT_MAP
from warpimpact.runs.run import run

from .paths import PICTURES, check_folder, check_output, named


def inspect_command(arguments: argparse.Namespace) -> None:
    kind = files.kind_of(arguments.result)
    if kind is not HIT_MAP and not arguments.campaign:
        print(text_of(view_of(arguments.result, kind, arguments.measure)))
        return
    with files.opened(arguments.result) as dataset:
        if arguments.campaign:
            print(dataset.attrs[attr.CAMPAIGN])
        else:
            texts = arguments.measure
            print(text_of(effectiveness_view(dataset, texts) if texts else inspect_view(dataset)))


def plot_command(arguments: argparse.Namespace) -> None:
    datasets = {name: files.read(path) for name, path in named(arguments.results).items()}
    folder = arguments.folder or arguments.results[0].parent
    check_folder(folder)
    stem = "_".join(path.stem for path in arguments.results)
    dataset, *others = datasets.values()
    figures: dict[str, tuple[str | None, Callable[..., Figure]]] = {
        "--measure": (arguments.measure, measure_map),
        "--variable": (arguments.variable, variable_map),
    }
    for option, (quantity, draw) in figures.items():
        if quantity is None:
            continue
        if others:
            raise files.ResultError(f"{option}: got {len(datasets)} results, but it draws the map of one")
        try:
            figure = draw(dataset, quantity)
        except ValueError as error:
            raise files.ResultError(f"{option}: {error}") from None
        picture = folder / f"{stem}_{_file_name(quantity)}.png"
        check_output(picture, *PICTURES, overwrite=arguments.overwrite)
        figure.savefig(picture, dpi=150)
        print(picture)
        return
    overwrite = arguments.overwrite
    saved = (
        save_side_by_side(datasets, folder, stem, overwrite=overwrite)
        if others
        else save_maps(dataset, folder, stem, overwrite=overwrite)
    )
    for path in saved:
        print(path)


def _file_name(quantity: str) -> str:
    """A part of a file name for a measure, such as "P_tilt_130mm_above_30_deg"."""
    spoken = quantity.replace(">", " above ").replace("<", " below ")
    return "_".join(re.findall(r"[\w.]+", spoken))


def plate_command(arguments: argparse.Namespace) -> None:
    output = arguments.output or Path(arguments.campaign.stem + "_plate.png")
    check_output(output, *PICTURES, overwrite=arguments.overwrite)
    campaign = Campaign.from_toml(arguments.campaign)
    plate = campaign.plate
    plate_figure(campaign.target, campaign.core, campaign.title, campaign.impact).savefig(output, dpi=150)
    rows = {"thickness": f"{1e3 * plate.thickness:g} mm"}
    rows |= plate_numbers(plate.open_area, plate.ligament, campaign.target.weights)
    for place, layer in enumerate(campaign.layer, start=1):
        behind = f"{1e3 * layer.gap:g} mm behind the one before"
        rows[f"layer {place}"] = f"{1e3 * layer.thickness:g} mm, {behind}, {layer.open_area:.1%} open"
    lines = (f"{label:<17}  {text}" for label, text in rows.items())
    print(campaign.title, *lines, *doubted_holes(campaign.target), output, sep="\n")


def catalogue_command(arguments: argparse.Namespace) -> None:
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
        check_output(arguments.output, *PICTURES, overwrite=arguments.overwrite)
        core_figure(core, entry.name, entry.evidence).savefig(arguments.output, dpi=150)
        print(arguments.output)


def validate_command(arguments: argparse.Namespace) -> None:
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
