"""The command validate: the published shots beside measured and computed values by others."""

import argparse
from pathlib import Path

from .options import Commands, add_command, add_device


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
