"""The command compare: which of several plates protects better."""

import argparse
import sys
from contextlib import ExitStack
from pathlib import Path

from xarray import Dataset

from warpimpact.analysis.comparison import Comparison, compare, comparison_view, shared_hits, short_view, shot_by_shot
from warpimpact.analysis.inspection import range_note
from warpimpact.analysis.numbers import rows_of, text_of
from warpimpact.campaign.campaign import read_plates
from warpimpact.campaign.text import CampaignError
from warpimpact.plotting import comparison_figure, variable_maps, weight_figure
from warpimpact.results import files
from warpimpact.results import variables as v
from warpimpact.results.files import ResultError
from warpimpact.results.references import as_plates
from warpimpact.runs.computer import computer
from warpimpact.runs.run import run_to_file
from warpimpact.studies.sensitivity import plate_sensitivity, reversals

from .messages import warn
from .paths import PICTURES, check_folder, check_output, named
from .progress import Step, show_progress, show_run
from .run import failure_code


def compare_command(arguments: argparse.Namespace) -> int:
    is_campaign = arguments.files[0].suffix == ".toml"
    default = arguments.files[0].stem if is_campaign else "comparison"
    figure = arguments.output or Path(f"{default}.png")
    # The figure of a campaign belongs to it as its results do.
    by_weight = figure.with_stem(f"{figure.stem}_weight")
    tilts = figure.with_stem(f"{figure.stem}_tilt")
    for picture in (figure, by_weight, tilts):
        check_output(picture, *PICTURES, overwrite=arguments.overwrite or (is_campaign and arguments.output is None))
    if arguments.sensitivity and not is_campaign:
        raise files.ResultError(
            f"{arguments.files[0]}: --sensitivity computes the plates again. Give the campaign with their [[plate]]."
        )
    replaced = " (replaced)" if figure.exists() else ""
    paths = _plates_run(arguments, arguments.folder or figure.parent) if is_campaign else named(arguments.files)
    with ExitStack() as stack:
        datasets = [stack.enter_context(files.opened(path)) for path in paths.values()]
        plates = dict(zip(paths, datasets, strict=True))
        if len(plates) < 2 and not (references := as_plates(datasets[0])):
            raise files.ResultError(
                f"{arguments.files[0]}: got one result without references, but compare needs at least two plates"
            )
        plates |= references if len(plates) < 2 else {}
        code = max(failure_code(dataset, path) for dataset, path in zip(datasets, paths.values(), strict=True))
        outside = range_note(dict(zip(paths, datasets, strict=True)))
        if shared := shared_hits(dict(zip(paths, datasets, strict=True))):
            _print_models(arguments, shared, (figure, tilts))
            return code
        comparison = compare(list(plates.values()), list(plates), arguments.measure)
    print(text_of(comparison_view(comparison, outside) if arguments.every else short_view(comparison, outside)))
    if arguments.sensitivity:
        print(_sensitivity(arguments, comparison))
    comparison_figure(comparison, every=arguments.every).savefig(figure, dpi=150)
    print(f"{figure}{replaced}" + ("" if arguments.every else "; every measure with --all"))
    if (against_weight := weight_figure(comparison)) is not None:
        against_weight.savefig(by_weight, dpi=150)
        print(by_weight)
    return code


def _sensitivity(arguments: argparse.Namespace, comparison: Comparison) -> str:
    """The deciding measure of the plates with each change, and which changes turn their order over."""
    measure = comparison.deciding()
    if measure is None:
        raise ResultError(f"{arguments.files[0]}: no measure ranks these plates, so no change can turn them over")
    with show_progress(arguments) as show:
        table = plate_sensitivity(
            read_plates(arguments.files[0], count=arguments.count),
            measure.text,
            shifts={plate.Index: plate.numerics for plate in rows_of(comparison.scores[measure.text])},
            device=arguments.device,
            progress=lambda done, total: show(Step(done, total)),
        )
    by_value = ", by value alone" if measure.text in comparison.by_ratio else ""
    text = table.to_string(float_format="{:.4g}".format, na_rep="-")
    return f"\n{measure.title}{by_value}:\n{text}\n{reversals(table)}\n"


def _print_models(arguments: argparse.Namespace, shared: dict[str, Dataset], figures: tuple[Path, Path]) -> None:
    """Print how a map and a result by finite elements differ at the same shots; draw their maps of velocity and tilt
    side by side."""
    if arguments.measure:
        raise files.ResultError(
            f"{arguments.files[0]}: --measure is for plates, but these are the same shots at one plate by two models, "
            "which are compared hit by hit"
        )
    print(text_of(shot_by_shot(shared)))
    for path, variable in zip(figures, (v.RESIDUAL_VELOCITY, v.TILT), strict=True):
        variable_maps(shared, variable).savefig(path, dpi=150)
        print(path)


def _plates_run(arguments: argparse.Namespace, folder: Path) -> dict[str, Path]:
    """Result files of a campaign's plates by name. Missing ones are computed."""
    if len(arguments.files) > 1:
        raise CampaignError(
            f"{arguments.files[0]}: got a campaign and other files, but compare takes either one campaign or results"
        )
    check_folder(folder)
    campaigns = read_plates(arguments.files[0], count=arguments.count)
    paths = {name: folder / f"{name}.nc" for name in campaigns}
    with computer(arguments.device, workers=arguments.workers, scheduler=arguments.scheduler, warn=warn) as device:
        for name, campaign in campaigns.items():
            print(f"plate {name}", file=sys.stderr)
            is_there = paths[name].exists() and not arguments.overwrite
            options = {"resume": arguments.resume or is_there, "overwrite": arguments.overwrite}
            try:
                with show_run(arguments) as progress:
                    run_to_file(campaign, paths[name], device=device, progress=progress, warn=warn, **options)
            except files.OutputError as error:
                if not is_there:
                    raise
                remedy = "give --folder FOLDER for the results of this one, or --overwrite"
                raise files.OutputError(f"{paths[name]}: is the result of another campaign; {remedy}") from error
    return paths
