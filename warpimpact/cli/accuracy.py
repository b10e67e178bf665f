"""The commands study and validate: how accurate the results are."""

import argparse
from pathlib import Path

from .mistakes import memory_told
from .options import Commands, add_campaign, add_command, add_device, add_output, add_overwrite, at_least
from .paths import check_output, check_suffix
from .progress import show_count


def add_study(commands: Commands) -> None:
    parser = add_command(
        commands,
        "study",
        _study,
        summary="measure error and speed of the numerics on a campaign",
        description="Measure error and speed of the numerics, coarse to fine, against a converged answer. Write a "
        "netCDF file and a figure of the same name. This takes minutes.",
        example="study campaigns/slotted_plate.toml --hits 128",
    )
    add_campaign(parser)
    add_output(parser, "STUDY.nc", "study file (default: the campaign's name with _study, in this folder)")
    parser.add_argument(
        "--hits",
        type=at_least(1),
        default=512,
        metavar="N",
        help="number of hits, spread over the campaign's cell (default: 512)",
    )
    add_device(parser)
    add_overwrite(parser, "an existing study")


def _study(arguments: argparse.Namespace) -> None:
    from warpimpact.campaign.campaign import Campaign
    from warpimpact.plotting import study_figure
    from warpimpact.results import files
    from warpimpact.studies.accuracy import study
    from warpimpact.studies.accuracy_text import study_text

    campaign = Campaign.from_toml(arguments.campaign)
    output = arguments.output or Path(arguments.campaign.stem + "_study.nc")
    picture = output.with_suffix(".png")
    check_suffix(output, "a study", ".nc")
    for written in (output, picture):
        check_output(written, overwrite=arguments.overwrite)
    with memory_told(arguments.campaign), show_count() as progress:
        dataset = study(campaign, hits=arguments.hits, device=arguments.device, progress=progress)
    files.write(dataset, output)
    print(study_text(dataset))
    study_figure(dataset).savefig(picture, dpi=150)
    for written in (output, picture):
        print(written)


def add_validate(commands: Commands) -> None:
    parser = add_command(
        commands,
        "validate",
        _validate,
        summary="compute the published shots and compare",
        description="Compute the paper's two shots. Compare them with the paper's model, its experiment and LS-DYNA.",
        example="validate",
    )
    parser.add_argument(
        "campaign",
        type=Path,
        nargs="?",
        metavar="CAMPAIGN.toml",
        help="the paper's scene with two hits; lattice and numerics may differ (default: the example paper_shots)",
    )
    add_device(parser)


def _validate(arguments: argparse.Namespace) -> None:
    from warpimpact.analysis.paper import check_scene, paper_campaign, validation_table
    from warpimpact.campaign.campaign import Campaign
    from warpimpact.runs.run import run

    path = arguments.campaign or paper_campaign()
    campaign = Campaign.from_toml(path)
    check_scene(campaign, str(path))
    print(validation_table(run(campaign, device=arguments.device)))
