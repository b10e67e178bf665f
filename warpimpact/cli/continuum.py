"""The command continuum: hits by finite elements, of a campaign or of a result."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING, Any

from .options import (
    Commands,
    add_command,
    add_computing,
    add_count,
    add_earlier,
    add_output,
    at_least,
)
from .paths import check_result
from .progress import Step, show_progress, warn
from .run import failure_code

if TYPE_CHECKING:
    from warpimpact.campaign.campaign import Campaign
    from warpimpact.campaign.continuum_settings import FiniteElements


def add_continuum(commands: Commands) -> None:
    parser = add_command(
        commands,
        "continuum",
        _continuum,
        summary="compute hits by finite elements",
        description="Compute hits of a campaign, or some of those of a result, by explicit finite elements of the "
        "target, which take seconds to minutes of a core each, and write a result as run does. A GPU computes hundreds "
        "at a time. It stands beside the fast law: compare takes both. Its materials have constants of their own "
        "(docs/continuum.md). Options come before the campaign's table [continuum].",
        example="continuum campaigns/slotted_plate.toml --count 4 --material ARMOX560T -o continuum.nc",
    )
    parser.add_argument("file", type=Path, metavar="FILE", help="a campaign, or a result of warpimpact run")
    add_output(parser, "RESULT.nc", "result file (default: the file's name with _continuum, in this folder)")
    add_count(parser)
    chosen = parser.add_mutually_exclusive_group()
    chosen.add_argument(
        "--hit",
        type=at_least(0),
        action="append",
        metavar="N",
        help="of a result: this hit; may be given several times",
    )
    chosen.add_argument(
        "--hits", type=at_least(1), metavar="N", help="of a result: number of hits, spread over the map"
    )
    parser.add_argument(
        "--material",
        action="append",
        metavar="NAME",
        help="material of the continuum, or a TOML file with its constants; given again for each layer behind "
        "(default: continuum.materials, or plate.material)",
    )
    parser.add_argument(
        "--friction",
        type=float,
        metavar="MU",
        help="between core and target (default: continuum.friction, which is 0 by default)",
    )
    parser.add_argument(
        "--fidelity",
        choices=("draft", "standard", "reference"),
        help="size of the elements (default: continuum.fidelity, which is draft by default)",
    )
    parser.add_argument(
        "--element", metavar="LENGTH", help='size of the elements, such as "0.5 mm", in place of a fidelity'
    )
    add_computing(parser)
    add_earlier(parser, "computation", "an existing result or an interrupted computation")


def _continuum(arguments: argparse.Namespace) -> int:
    from warpimpact.analysis.summary import summary_text
    from warpimpact.campaign.text import CampaignError
    from warpimpact.results import attributes as attr
    from warpimpact.results.netcdf import open_table
    from warpimpact.runs.executor import executor_for
    from warpimpact.runs.finite_elements import continuum_to_file

    campaign, hits = _asked(arguments)
    output = arguments.output or Path(f"{arguments.file.stem}_continuum.nc")
    check_result(output, "a result")
    campaign = campaign.computed_by(_elements(arguments, campaign))
    computing = executor_for(arguments.device, workers=arguments.workers, scheduler=arguments.scheduler, apart=True)
    with show_progress() as show, computing as executor:
        try:
            continuum_to_file(
                campaign,
                output,
                hits=hits,
                device=executor,
                resume=arguments.resume,
                overwrite=arguments.overwrite,
                progress=lambda done, resumed, total: show(Step(done, total, resumed)),
                tell=warn,
            )
        except ValueError as error:
            raise CampaignError(f"{arguments.file}: {error}") from None
    with open_table(output) as dataset:
        print(summary_text(dataset))
        print(dataset.attrs[attr.CATALOGUE_NAMES])
        computer = "core" if dataset.attrs[attr.DEVICE].startswith("cpu") else "GPU"
        print(f"{dataset.attrs[attr.COMPUTE_TIME]:.4g} s of a {computer}")
        print(f"written to {output}")
        return failure_code(dataset, output)


def _asked(arguments: argparse.Namespace) -> "tuple[Campaign, tuple[int, ...] | None]":
    """The campaign, and the numbers of the hits; None for all hits."""
    from warpimpact.campaign.campaign import Campaign
    from warpimpact.campaign.text import CampaignError
    from warpimpact.results import attributes as attr
    from warpimpact.results import files
    from warpimpact.results.dataset import hit_numbers
    from warpimpact.runs.replay import campaign_in
    from warpimpact.solver.simulate import spread_places

    if arguments.file.suffix == ".toml":
        if arguments.hit or arguments.hits:
            raise CampaignError(f"{arguments.file}: --hit and --hits are for a result; --count is for a campaign")
        return Campaign.from_toml(arguments.file, count=arguments.count), None
    result = files.read(arguments.file)
    if arguments.count is not None:
        raise files.ResultError(f"{arguments.file}: --count is for a campaign; --hits is for a result")
    if attr.LIMIT in result.attrs:
        raise files.ResultError(f"{arguments.file}: is a search of limits, but continuum takes a result of run")
    numbers = hit_numbers(result)
    if arguments.hit:
        for hit in arguments.hit:
            if hit not in numbers:
                raise files.ResultError(
                    f"--hit: got {hit}, but {arguments.file} has hits {numbers[0]} to {numbers[-1]}"
                )
        chosen = tuple(sorted(set(arguments.hit)))
    else:
        places = spread_places(len(numbers), min(len(numbers), arguments.hits or len(numbers)))
        chosen = tuple(sorted(int(number) for number in numbers[places]))
    return campaign_in(result, arguments.file.parent), chosen


def _elements(arguments: argparse.Namespace, campaign: "Campaign") -> "FiniteElements":
    """The settings for the hits: those of the campaign, overridden by the options."""
    from pydantic import ValidationError

    from warpimpact.campaign.continuum_settings import FiniteElements
    from warpimpact.campaign.text import CampaignError
    from warpimpact.scene.problems import complaint

    named = campaign.plate.material
    given: dict[str, Any] = {"materials": (named,)} if named and not campaign.continuum.materials else {}
    options = {"materials": "material", "friction": "friction", "fidelity": "fidelity", "spacing": "element"}
    told = {field: value for field, option in options.items() if (value := getattr(arguments, option)) is not None}
    if "fidelity" in told:
        told.setdefault("spacing", None)
    try:
        elements = FiniteElements.model_validate(campaign.continuum.model_dump() | given | told)
        _ = elements.entries
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        raise CampaignError(f"--{options[str(problem['loc'][0])]}: {complaint(problem)}") from None
    except ValueError as error:
        raise CampaignError(f"{arguments.file}: {error}") from None
    return elements
