"""The commands inspect, plot, plate, catalogue, validate, replay, export and report: what there is, for people."""

import argparse
import re
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

from warpimpact.analysis.effectiveness import effectiveness_view, plate_numbers
from warpimpact.analysis.inspection import inspect_view
from warpimpact.analysis.numbers import text_of
from warpimpact.analysis.paper import check_scene, closest_table, paper_campaign, validation_table
from warpimpact.campaign.campaign import Campaign
from warpimpact.catalogue.catalogue import Catalogue
from warpimpact.catalogue.catalogue_view import catalogue_view, material_view, threat_view
from warpimpact.catalogue.entries import Material, Threat
from warpimpact.errors import CampaignError, OutputError, ResultError
from warpimpact.export.drawing import SUFFIXES, write_drawing
from warpimpact.export.paraview import write_vtk
from warpimpact.export.spreadsheet import write_csv
from warpimpact.measures.references import law_of
from warpimpact.plotting import measure_map, plate_figure, save_maps, save_side_by_side, variable_map
from warpimpact.plotting.plate import core_figure
from warpimpact.plotting.trajectory import FIGURES, save_animation, save_figures, writer_for
from warpimpact.records import attributes as attr
from warpimpact.records.kinds import HISTORY, HIT_MAP
from warpimpact.report.report import file_page, report_page, view_of
from warpimpact.results import files
from warpimpact.results.history import hit_view
from warpimpact.runs.options import RunProgress
from warpimpact.runs.replay import replay
from warpimpact.runs.run import run

from .common import PICTURES, check_folder, check_output, named, run_options, show_progress, write_text


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
    folder, overwrite = arguments.folder or arguments.results[0].parent, arguments.overwrite
    check_folder(folder)
    stem, dataset = "_".join(path.stem for path in arguments.results), next(iter(datasets.values()))
    if quantity := arguments.measure or arguments.variable:
        option, draw = ("--measure", measure_map) if arguments.measure else ("--variable", variable_map)
        if len(datasets) > 1:
            raise ResultError(f"{option}: got {len(datasets)} results, but it draws the map of one")
        words = re.findall(r"[\w.]+", quantity.replace(">", " above ").replace("<", " below "))
        picture = folder / f"{stem}_{'_'.join(words)}.png"
        check_output(arguments, picture, overwrite=overwrite)
        try:
            draw(dataset, quantity).savefig(picture, dpi=150)
        except ValueError as error:
            raise ResultError(f"{option}: {error}") from None
        print(picture)
    elif len(datasets) > 1:
        print(*save_side_by_side(datasets, folder, stem, every=arguments.every, overwrite=overwrite), sep="\n")
    else:
        print(*save_maps(dataset, folder, stem, every=arguments.every, overwrite=overwrite), sep="\n")


def plate_command(arguments: argparse.Namespace) -> None:
    output = arguments.output or Path(arguments.campaign.stem + "_plate.png")
    check_output(arguments, output, *PICTURES)
    campaign = Campaign.from_toml(arguments.campaign)
    plate = campaign.plate
    plate_figure(campaign.target, campaign.core, campaign.title, campaign.impact).savefig(output, dpi=150)
    rows = {"thickness": f"{1e3 * plate.thickness:g} mm"}
    rows |= plate_numbers(plate.open_area, plate.ligament, campaign.target.weights)
    for place, layer in enumerate(campaign.layer, start=1):
        behind = f"{1e3 * layer.gap:g} mm behind the one before"
        rows[f"layer {place}"] = f"{1e3 * layer.thickness:g} mm, {behind}, {layer.open_area:.1%} open"
    lines = (f"{label:<17}  {text}" for label, text in rows.items())
    print(campaign.title, *lines, output, sep="\n")


def catalogue_command(arguments: argparse.Namespace) -> None:
    try:
        catalogue = Catalogue.of(arguments.file)
        entry = None if arguments.name is None else catalogue.entry(arguments.name)
    except ValueError as error:
        raise CampaignError(str(error)) from None
    if isinstance(entry, Threat):
        view = threat_view(entry)
    elif isinstance(entry, Material):
        view = material_view(entry, is_own=catalogue.is_own(entry))
    else:
        view = catalogue_view(catalogue)
    core = entry.shape if isinstance(entry, Threat) else None
    if arguments.output and core is None:
        raise CampaignError("--output: only a threat whose core is known can be drawn")
    print(text_of(view))
    if arguments.output and isinstance(entry, Threat) and core is not None:
        check_output(arguments, arguments.output, *PICTURES)
        core_figure(core, entry.name, entry.evidence).savefig(arguments.output, dpi=150)
        print(arguments.output)


def validate_command(arguments: argparse.Namespace) -> None:
    path = arguments.campaign or paper_campaign()
    if path.suffix == ".nc":
        result = files.read(path)
        try:
            print(closest_table(result.to_dataset(), path.parent))
        except ResultError as error:
            raise ResultError(f"{path}: {error}") from None
        return
    campaign = Campaign.from_toml(path)
    check_scene(campaign, str(path))
    with run_options(arguments) as options:
        result = run(campaign, options=options)
    print(validation_table(law_of(result).to_dataset()))


def replay_command(arguments: argparse.Namespace) -> None:
    path, film = arguments.result, arguments.animation
    output = arguments.output or path.with_name(f"{path.stem}_hit{arguments.hit}.nc")
    check_output(arguments, output, ".nc")
    for figure in FIGURES:
        check_output(arguments, output.with_name(f"{output.stem}_{figure.__name__}.png"))
    if film:
        writer_for(film)
        check_output(arguments, film)
    with suggest_campaign_folder():
        folder = arguments.campaign_folder or path.parent
        history = replay(files.read(path), arguments.hit, folder=folder, snapshots=arguments.snapshots)
    files.write(history, output)
    print(text_of(hit_view(history)))
    for written in (output, *save_figures(history, output.parent, output.stem)):
        print(written)
    if film:
        save_animation(history, film)
        print(film)


def export_command(arguments: argparse.Namespace) -> None:
    path, output = arguments.file, arguments.output
    if path.suffix == ".toml":
        output = output or path.with_suffix(".svg")
        check_output(arguments, output, *SUFFIXES)
        print(*write_drawing(Campaign.from_toml(path).plate, output), output, sep="\n")
        return
    with files.opened(path, HIT_MAP, HISTORY) as dataset:
        if "time" not in dataset.variables:  # a map of hits
            output = output or path.with_suffix(".csv")
            check_output(arguments, output, ".csv")
            write_csv(dataset, output)
            print(output)
            return
        if output is not None:
            raise OutputError(f"{output}: a history is written as a folder; name a new one with --folder")
        folder = arguments.folder or path.with_name(f"{path.stem}_vtk")
        if folder.exists():
            raise OutputError(f"{folder}: exists already; name a new folder with --folder")
        print(*write_vtk(dataset.load().to_dataset(), folder), sep="\n")


def report_command(arguments: argparse.Namespace) -> None:
    paths = arguments.results
    output = arguments.output or paths[0].with_suffix(".html")
    check_output(arguments, output, ".html")
    for kind in {*map(files.kind_of, paths)} - {HIT_MAP}:
        if len(paths) > 1:
            raise ResultError(f"got {len(paths)} files, one of which is {kind.name}, which is reported alone")
        write_text(file_page(paths[0], kind, arguments.campaign_folder or paths[0].parent), output)
        print(output)
        return
    by_name = named(paths)
    with ExitStack() as stack:
        datasets = {name: stack.enter_context(files.opened(path)) for name, path in by_name.items()}
        show = stack.enter_context(show_progress(arguments))
        with suggest_campaign_folder(", or --trajectories 0, which needs none of them"):
            page = report_page(
                datasets,
                folders={name: arguments.campaign_folder or path.parent for name, path in by_name.items()},
                trajectories=arguments.trajectories,
                progress=lambda done, total: show(RunProgress(done, total)),
            )
    write_text(page, output)
    print(output)


@contextmanager
def suggest_campaign_folder(more: str = "") -> Iterator[None]:
    """Add the option that may help to an error of the campaign in a result; `more` follows it."""
    try:
        yield
    except CampaignError as error:
        raise CampaignError(f"{error}; give the folder of the campaign's files with --campaign-folder{more}") from None
