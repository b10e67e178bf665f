"""The command compare: which of several plates protects better."""

import argparse
from contextlib import ExitStack, suppress
from dataclasses import replace
from pathlib import Path

import xarray

from warpimpact.analysis.comparison import Comparison, deciding_measure
from warpimpact.analysis.inspection import range_note
from warpimpact.analysis.numbers import rows_of, text_of
from warpimpact.analysis.plates_by_impact import compare_by_impact, every_view, impact_view
from warpimpact.analysis.same_shots import shared_hits, shot_by_shot
from warpimpact.campaign.campaign import read_plates
from warpimpact.errors import CampaignError, FileExists, OutputError, ResultError
from warpimpact.measures.references import Result, as_dataset, as_plates, law_of
from warpimpact.plotting import impact_figure, variable_maps
from warpimpact.records import variables as v
from warpimpact.records.kinds import SWEEP
from warpimpact.results import files
from warpimpact.runs.run import run_to_file
from warpimpact.scene.units import count_text
from warpimpact.studies.sensitivity import as_text, plate_sensitivity, reversals
from warpimpact.studies.sweep import plates_of_points

from .common import PICTURES, check_folder, check_output, failure_code, named, output_store, run_options, with_elements


def compare_command(arguments: argparse.Namespace) -> int:
    first, is_campaign = arguments.files[0], arguments.files[0].suffix == ".toml"
    figure = arguments.output or Path(f"{first.stem if is_campaign else 'comparison'}.png")
    tilts = figure.with_stem(f"{figure.stem}_tilt")
    for picture in (figure, tilts):  # the figure of a campaign belongs to it as its results do
        check_output(
            arguments, picture, *PICTURES, overwrite=arguments.overwrite or (is_campaign and arguments.output is None)
        )
    if arguments.sensitivity and not is_campaign:
        raise ResultError(f"{first}: --sensitivity computes the plates again. Give the campaign with their [[plate]].")
    paths = _plates_run(arguments, arguments.folder or figure.parent) if is_campaign else named(arguments.files)
    names = [*paths]
    if len(paths) == 1 and not is_campaign and files.kind_of(first) is SWEEP:
        names, paths = plates_of_points(first)
    with ExitStack() as stack:
        results: dict[str, Result] = {name: stack.enter_context(files.opened(path)) for name, path in paths.items()}
        plates = [*results.values()]
        references = as_plates(plates[0]) if len(plates) == 1 else {}
        names, plates = [*names, *references], [*plates, *references.values()]
        if len(plates) < 2:
            raise ResultError(f"{first}: got one result without references, but compare needs at least two plates")
        code = max(failure_code(dataset, paths[name]) for name, dataset in results.items())
        outside = range_note(results.values())
        if shared := shared_hits({name: as_dataset(law_of(result)) for name, result in results.items()}):
            _print_models(arguments, shared, (figure, tilts))
            return code
        comparisons = compare_by_impact(plates, names, arguments.measure, references=[*references])
    every = arguments.every or bool(arguments.measure and deciding_measure(*comparisons.values()) is None)
    print(text_of((every_view if every else impact_view)(comparisons, outside)))
    if arguments.sensitivity and len(comparisons) == 1:
        print(_sensitivity(arguments, {name: files.read(path) for name, path in paths.items()}, *comparisons.values()))
    impact_figure(comparisons, every=every).savefig(figure, dpi=150)
    print(figure if every else f"{figure}; every measure with --all --overwrite")
    return code


def _sensitivity(arguments: argparse.Namespace, answers: dict[str, Result], comparison: Comparison) -> str:
    """The deciding measure of the plates with each change, and which changes turn their order over."""
    measure = deciding_measure(comparison)
    if measure is None:
        raise ResultError(
            f"{arguments.files[0]}: no measure ranks these plates, so --sensitivity cannot change their order"
        )
    with run_options(arguments) as options:
        table = plate_sensitivity(
            read_plates(arguments.files[0], count=arguments.count),
            measure.text,
            answers=answers,
            shifts={plate.Index: plate.numerics for plate in rows_of(comparison.scores[measure.text])},
            options=options,
        )
    numbers = as_text(table.drop(columns="best")).join(table["best"])
    hits = count_text(table.attrs["hits"], "hit")
    return f"\n{measure.title}, by {hits}:\n{numbers.rename_axis(None).to_string()}\n{reversals(table)}\n"


def _print_models(arguments: argparse.Namespace, shared: dict[str, xarray.Dataset], figures: tuple[Path, Path]) -> None:
    """Print how a map and a result by finite elements differ at the same shots; draw their maps of velocity and tilt
    side by side."""
    if arguments.measure:
        raise ResultError(f"{arguments.files[0]}: --measure is for plates; two models of one are compared hit by hit")
    print(text_of(shot_by_shot(shared)))
    for path, variable in zip(figures, (v.RESIDUAL_VELOCITY, v.TILT), strict=True):
        variable_maps(shared, variable).savefig(path, dpi=150)
        print(path)


def _plates_run(arguments: argparse.Namespace, folder: Path) -> dict[str, Path]:
    """Result files of a campaign's plates by name. Missing ones are computed."""
    if len(arguments.files) > 1:
        raise CampaignError(f"{arguments.files[0]}: got other files, too, but compare takes one campaign or results")
    campaigns = read_plates(arguments.files[0], count=arguments.count)
    with suppress(OSError):
        folder.mkdir(exist_ok=True)
    check_folder(folder)
    paths = {name: folder / f"{name}.nc" for name in campaigns}
    with run_options(arguments) as given, given.opened() as options:
        for name, campaign in campaigns.items():
            store = output_store(arguments, paths[name])
            store = replace(store, resume=store.resume or (paths[name].exists() and not store.overwrite))
            try:
                run_to_file(with_elements(arguments, campaign), store, options=options.at(f"plate {name}"))
            except FileExists as error:
                remedy = "give --folder FOLDER for the results of this one, or --overwrite"
                raise OutputError(f"{paths[name]}: has other hits or another campaign; {remedy}") from error
    return paths
