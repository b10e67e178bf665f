"""The commands run and continuum: hit maps by the fast law, and hits by finite elements."""

import argparse
from pathlib import Path

import numpy as np
from numpy.typing import NDArray
from pydantic import ValidationError

from warpimpact.analysis.inspection import answer
from warpimpact.analysis.numbers import text_of
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.elements import continuum_table
from warpimpact.campaign.inputs import campaign_in
from warpimpact.campaign.tables import ContinuumTable
from warpimpact.campaign.text import as_campaign_error
from warpimpact.errors import CampaignError, ResultError
from warpimpact.measures.hits import hit_numbers
from warpimpact.records import attributes as attr
from warpimpact.results import files
from warpimpact.runs.correct import add_elements
from warpimpact.runs.finite_elements import finite_elements_to_file
from warpimpact.runs.run import run_to_file
from warpimpact.scene.model import complaint
from warpimpact.scene.units import count_text
from warpimpact.solver.accuracy import spread_places
from warpimpact.studies.correction import USUAL_HITS, correction_offer

from .common import check_output, failure_code, output_store, run_options, with_elements


def run_command(arguments: argparse.Namespace) -> int:
    campaign = Campaign.from_toml(arguments.campaign, count=arguments.count)
    output = arguments.output or Path(arguments.campaign.stem + ".nc")
    check_output(arguments, output, ".nc", overwrite=True)  # the run decides on an earlier one
    campaign = with_elements(arguments, campaign)
    with run_options(arguments) as options, as_campaign_error(f"{arguments.campaign}: "):
        run_to_file(campaign, output_store(arguments, output), options=options)
    return _shown(output, "" if campaign.continuum.hits else correction_offer(campaign))


def _shown(output: Path, offer: str = "") -> int:
    """The exit code of a run, whose answer is printed, with an offer."""
    with files.opened(output) as dataset:
        print(text_of({"": answer(dataset, offer)}))
        hits, seconds = count_text(dataset.sizes["hit"], "hit"), dataset.attrs[attr.COMPUTE_TIME]
        print(f"{output}: {hits} in {seconds:.2g} s. Next: warpimpact inspect, plot or report {output}")
        return failure_code(dataset, output)


def continuum_command(arguments: argparse.Namespace) -> int:
    path = arguments.file
    if path.suffix == ".toml":
        if arguments.hit or arguments.continuum_hits:
            raise CampaignError(f"{path}: --hit and --hits are for a result; --count is for a campaign")
        return _chosen_hits(arguments, Campaign.from_toml(path, count=arguments.count), None)
    if arguments.count is not None:
        raise ResultError(f"{path}: --count is for a campaign; --hits is for a result")
    with files.opened(path) as result:
        if attr.LIMIT in result.attrs:
            raise ResultError(f"{path}: is a search of limits, but continuum takes a result of run")
        campaign, numbers = campaign_in(result, path.parent), hit_numbers(result.to_dataset())
    if arguments.hit or arguments.output:
        return _chosen_hits(arguments, campaign, _numbers(arguments, numbers))
    continuum_hits = arguments.continuum_hits or campaign.continuum.hits or USUAL_HITS
    campaign = campaign.computed_by(_table(arguments, campaign))
    with run_options(arguments) as options:
        add_elements(output_store(arguments, path), campaign, continuum_hits=continuum_hits, options=options)
    return _shown(path)


def _chosen_hits(arguments: argparse.Namespace, campaign: Campaign, numbers: tuple[int, ...] | None) -> int:
    """The exit code of hits by finite elements, which go into a result of their own; None is all hits."""
    output = arguments.output or Path(f"{arguments.file.stem}_continuum.nc")
    check_output(arguments, output, ".nc", overwrite=True)
    campaign = campaign.computed_by(_table(arguments, campaign))
    with run_options(arguments) as options, as_campaign_error(f"{arguments.file}: "):
        finite_elements_to_file(campaign, output_store(arguments, output), numbers=numbers, options=options)
    with files.opened(output) as dataset:
        print(text_of({"": [*answer(dataset), dataset.attrs[attr.CATALOGUE_NAMES]]}))
        computer = "core" if dataset.attrs[attr.DEVICE].startswith("cpu") else "GPU"
        print(f"{dataset.attrs[attr.COMPUTE_TIME]:.4g} s of a {computer}")
        print(f"written to {output}")
        return failure_code(dataset, output)


def _numbers(arguments: argparse.Namespace, numbers: NDArray[np.int64]) -> tuple[int, ...]:
    """Numbers of the hits of a result that are wanted: those given, or some of all that are spread over the map."""
    if unknown := sorted({*(arguments.hit or ())} - {*numbers.tolist()}):
        raise ResultError(f"--hit: got {unknown[0]}, but {arguments.file} has hits {numbers[0]} to {numbers[-1]}")
    places = spread_places(len(numbers), min(len(numbers), arguments.continuum_hits or len(numbers)))
    return tuple(sorted({*(arguments.hit or numbers[places].tolist())}))


def _table(arguments: argparse.Namespace, campaign: Campaign) -> ContinuumTable:
    """The settings for the hits: those of the campaign, overridden by the options."""
    settings = campaign.continuum.model_dump()
    if arguments.fidelity:
        settings["spacing"] = None
    options = {"materials": "material", "friction": "friction", "fidelity": "fidelity", "spacing": "element"}
    settings |= {key: value for key, name in options.items() if (value := getattr(arguments, name)) is not None}
    try:
        table = ContinuumTable.model_validate(settings)
    except ValidationError as error:
        problem = error.errors(include_url=False)[0]
        raise CampaignError(f"--{options[str(problem['loc'][0])]}: {complaint(problem)}") from None
    with as_campaign_error(f"{arguments.file}: "):
        return continuum_table(campaign.computed_by(table))
