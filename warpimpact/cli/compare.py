"""The command compare: which of several plates protects better."""

import argparse
import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING

from .options import (
    Commands,
    add_command,
    add_computing,
    add_count,
    add_earlier,
    add_measures,
    add_output,
    executor_of,
)
from .paths import check_picture, named
from .progress import Step, show_progress, show_run, warn
from .run import failure_code

if TYPE_CHECKING:
    from xarray import Dataset

    from warpimpact.analysis.comparison_text import Comparison


def add_compare(commands: Commands) -> None:
    parser = add_command(
        commands,
        "compare",
        _compare,
        summary="compare plates: which protects better",
        description="Compare plates under the same shots: the measure that decides, ranks, differences with their "
        "intervals, and a figure; every other measure with --all. Of targets with layers, and of limits, a second "
        "figure, FIGURE_weight.png, shows them against their weight. A map and a result of continuum of the same shots "
        "are compared hit by hit, with their maps side by side. A campaign with several plates is run first: each "
        "plate gives NAME.nc in the folder of the figure. A plate whose result exists is not run again.",
        example="compare campaigns/two_plates.toml, or: warpimpact compare slotted.nc round.nc",
    )
    parser.add_argument(
        "files",
        type=Path,
        nargs="+",
        metavar="RESULT.nc",
        help="two or more results of warpimpact run; one, which is compared with its references; or one campaign with "
        "several [[plate]] tables",
    )
    add_output(
        parser,
        "FIGURE.png",
        "figure as PNG, PDF or SVG (default: comparison.png, or the campaign's name, in this folder)",
    )
    add_measures(parser)
    parser.add_argument(
        "--all",
        action="store_true",
        dest="every",
        help="print and draw every measure, every pair of plates, and what was compared how",
    )
    parser.add_argument(
        "--sensitivity",
        action="store_true",
        help="rank the plates of a campaign by the deciding measure with each change of what nobody measured, too",
    )
    add_computing(parser)
    add_count(parser)
    replaced = "an existing figure; of a campaign, compute all plates again"
    add_earlier(parser, "campaign", replaced, resume="continue an interrupted campaign")


def _compare(arguments: argparse.Namespace) -> int:
    from warpimpact.analysis.comparison import compare
    from warpimpact.analysis.comparison_text import comparison_view, short_view
    from warpimpact.analysis.shot_by_shot import shared_hits
    from warpimpact.analysis.summary import range_note
    from warpimpact.plotting import comparison_figure, weight_figure
    from warpimpact.results import files
    from warpimpact.results.references import as_plates
    from warpimpact.view.view import Section, text_of

    is_campaign = arguments.files[0].suffix == ".toml"
    default = arguments.files[0].stem if is_campaign else "comparison"
    figure = arguments.output or Path(f"{default}.png")
    # The figure of a campaign belongs to it as its results do.
    beside = figure.with_stem(f"{figure.stem}_weight")
    tilts = figure.with_stem(f"{figure.stem}_tilt")
    for picture in (figure, beside, tilts):
        check_picture(picture, overwrite=arguments.overwrite or (is_campaign and arguments.output is None))
    if arguments.sensitivity and not is_campaign:
        raise files.ResultError(
            f"{arguments.files[0]}: --sensitivity computes the plates again. Give the campaign with their [[plate]]."
        )
    replaced = " (replaced)" if figure.exists() else ""
    paths = _plates_run(arguments, figure.parent) if is_campaign else named(arguments.files)
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
    if arguments.every:
        print(text_of([*comparison_view(comparison), Section(outside)]))
    else:
        print(text_of([short_view(comparison, outside)]))
    if arguments.sensitivity:
        print(_sensitivity(arguments, comparison))
    comparison_figure(comparison, every=arguments.every).savefig(figure, dpi=150)
    print(f"{figure}{replaced}" + ("" if arguments.every else "; every measure with --all"))
    if (against_weight := weight_figure(comparison)) is not None:
        against_weight.savefig(beside, dpi=150)
        print(beside)
    return code


def _sensitivity(arguments: argparse.Namespace, comparison: "Comparison") -> str:
    """The deciding measure of the plates with each change, and which changes turn their order over."""
    from warpimpact.analysis.comparison_text import deciding
    from warpimpact.campaign.plates import read_plates
    from warpimpact.results.files import ResultError
    from warpimpact.studies.sensitivity import plate_sensitivity, reversals

    score = deciding(comparison)
    if score is None:
        raise ResultError(f"{arguments.files[0]}: no measure ranks these plates, so no change can turn them over")
    with show_progress() as show:
        table = plate_sensitivity(
            read_plates(arguments.files[0], count=arguments.count),
            score.name,
            shifts={plate.name: plate.score(score.name).numerics or 0.0 for plate in comparison.plates},
            device=arguments.device,
            progress=lambda done, total: show(Step(done, total)),
        )
    by_value = ", by value alone" if score.name in (comparison.at_equal_weight or ()) else ""
    text = table.to_string(float_format="{:.4g}".format, na_rep="-")
    return f"\n{score.measure.title}{by_value}:\n{text}\n{reversals(table)}\n"


def _print_models(arguments: argparse.Namespace, shared: "dict[str, Dataset]", figures: tuple[Path, Path]) -> None:
    """Print how a map and a result by finite elements differ at the same shots; draw their maps of velocity and tilt
    side by side."""
    from warpimpact.analysis.shot_by_shot import shot_by_shot
    from warpimpact.plotting import variable_maps
    from warpimpact.results import files
    from warpimpact.results import variables as v
    from warpimpact.view.view import text_of

    if arguments.measure:
        raise files.ResultError(
            f"{arguments.files[0]}: --measure is for plates, but these are the same shots at one plate by two models, "
            "which are compared hit by hit"
        )
    print(text_of([shot_by_shot(shared)]))
    for path, variable in zip(figures, (v.RESIDUAL_VELOCITY, v.TILT), strict=True):
        variable_maps(shared, variable).savefig(path, dpi=150)
        print(path)


def _plates_run(arguments: argparse.Namespace, folder: Path) -> dict[str, Path]:
    """Result files of a campaign's plates by name. Missing ones are computed."""
    from warpimpact.campaign.plates import read_plates
    from warpimpact.campaign.text import CampaignError
    from warpimpact.runs.run import run_to_file

    if len(arguments.files) > 1:
        raise CampaignError(
            f"{arguments.files[0]}: got a campaign and other files, but compare takes either one campaign or results"
        )
    campaigns = read_plates(arguments.files[0], count=arguments.count)
    paths = {name: folder / f"{name}.nc" for name in campaigns}
    with executor_of(arguments) as executor:
        for name, campaign in campaigns.items():
            print(f"plate {name}", file=sys.stderr)
            with show_run() as progress:
                run_to_file(
                    campaign,
                    paths[name],
                    device=executor,
                    resume=arguments.resume or (paths[name].exists() and not arguments.overwrite),
                    overwrite=arguments.overwrite,
                    progress=progress,
                    tell=warn,
                )
    return paths
