"""The command continuum: hits by finite elements, of a campaign or of a result."""

import argparse
from pathlib import Path
from typing import Any

from pydantic import ValidationError

from warpimpact.analysis.inspection import summary_text
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.continuum_settings import FiniteElements
from warpimpact.campaign.text import CampaignError
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results.dataset import hit_numbers
from warpimpact.runs.finite_elements import continuum_to_file
from warpimpact.runs.replay import campaign_in
from warpimpact.scene.model import complaint
from warpimpact.solver.simulate import spread_places

from .paths import check_output
from .progress import Step, show_progress
from .run import computing, failure_code


def continuum_command(arguments: argparse.Namespace) -> int:
    campaign, hits = _campaign_and_hits(arguments)
    output = arguments.output or Path(f"{arguments.file.stem}_continuum.nc")
    check_output(output, ".nc", overwrite=True)
    campaign = campaign.computed_by(_elements(arguments, campaign))
    with show_progress(arguments) as show:
        try:
            continuum_to_file(
                campaign,
                output,
                hits=hits,
                progress=lambda done, resumed, total: show(Step(done, total, resumed)),
                **computing(arguments),
            )
        except ValueError as error:
            raise CampaignError(f"{arguments.file}: {error}") from None
    with files.opened(output) as dataset:
        print(summary_text(dataset))
        print(dataset.attrs[attr.CATALOGUE_NAMES])
        computer = "core" if dataset.attrs[attr.DEVICE].startswith("cpu") else "GPU"
        print(f"{dataset.attrs[attr.COMPUTE_TIME]:.4g} s of a {computer}")
        print(f"written to {output}")
        return failure_code(dataset, output)


def _campaign_and_hits(arguments: argparse.Namespace) -> "tuple[Campaign, tuple[int, ...] | None]":
    """The campaign, and the numbers of the hits; None for all hits."""
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
    named = campaign.plate.material
    given: dict[str, Any] = {"materials": (named,)} if named and not campaign.continuum.materials else {}
    options = {"materials": "material", "friction": "friction", "fidelity": "fidelity", "spacing": "element"}
    settings = {field: value for field, option in options.items() if (value := getattr(arguments, option)) is not None}
    if "fidelity" in settings:
        settings.setdefault("spacing", None)
    try:
        elements = FiniteElements.model_validate(campaign.continuum.model_dump() | given | settings)
        _ = elements.entries
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        raise CampaignError(f"--{options[str(problem['loc'][0])]}: {complaint(problem)}") from None
    except ValueError as error:
        raise CampaignError(f"{arguments.file}: {error}") from None
    return elements
