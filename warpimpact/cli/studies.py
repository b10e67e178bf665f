"""The commands limit, sweep, sensitivity, test, optimise and identify: many runs, one answer."""

import argparse
import sys
from contextlib import AbstractContextManager
from dataclasses import asdict
from pathlib import Path
from typing import Any

import pandas as pd

from warpimpact.analysis.estimates import measures_of_runs
from warpimpact.analysis.inspection import range_note
from warpimpact.analysis.numbers import text_of
from warpimpact.campaign.campaign import Campaign
from warpimpact.campaign.text import CampaignError
from warpimpact.firing.plan import read_test
from warpimpact.firing.simulate import firing_view, response_of, simulate_test
from warpimpact.firing.v50 import read_shots, v50
from warpimpact.identification.computed_shots import fit_of_result
from warpimpact.identification.fit import read_fit
from warpimpact.identification.identify import identify
from warpimpact.identification.posterior import material_draws, posterior_view
from warpimpact.optimisation.design import read_design
from warpimpact.optimisation.front import folder_of, front_view
from warpimpact.optimisation.optimise import optimise
from warpimpact.plotting.front import front_figure
from warpimpact.plotting.posterior import FIGURES
from warpimpact.plotting.studies import firing_figure, limit_figure, sensitivity_figure, shots_figure, sweep_figure
from warpimpact.results import files, front
from warpimpact.results.kinds import SWEEP
from warpimpact.results.posterior_file import INTERRUPTED
from warpimpact.runs.computer import Computer, computer
from warpimpact.scene.units import PositiveLength, PositiveSpeed, quantity
from warpimpact.studies.limit import check_measures, limit_to_file, warning_of
from warpimpact.studies.limit_view import limit_view
from warpimpact.studies.sensitivity import largest_move, sensitivity
from warpimpact.studies.sweep import folder_of as points_of
from warpimpact.studies.sweep import read_sweep, run_sweep, sweep_view

from .messages import say, warn
from .paths import PICTURES, check_output, replaces, write_text
from .progress import Step, show_progress, show_run
from .run import computing, failure_code


def limit_command(arguments: argparse.Namespace) -> int:
    needs_velocity = arguments.quantity != "velocity"
    campaign = Campaign.from_toml(arguments.campaign, count=arguments.count, needs_velocity=needs_velocity)
    output = arguments.output or Path(arguments.campaign.stem + "_limit.nc")
    picture = output.with_suffix(".png")
    check_output(output, ".nc", overwrite=True)
    check_output(picture, *PICTURES, overwrite=replaces(arguments, output))
    check_measures(arguments.measure, arguments.quantity)
    if sentence := warning_of(campaign, arguments.quantity):
        warn(sentence)
    with show_run(arguments) as progress:
        limit_to_file(
            campaign,
            output,
            arguments.quantity,
            tolerance=_tolerance(arguments),
            layer=arguments.layer,
            progress=progress,
            **computing(arguments),
        )
    dataset = files.read(output)
    print(text_of(limit_view(dataset, arguments.measure)))
    for line in range_note({"": dataset}, str(output)):
        print(line)
    limit_figure(dataset).savefig(picture, dpi=150)
    print(f"written to {output}, figure in {picture}")
    return failure_code(dataset, output)


def _tolerance(arguments: argparse.Namespace) -> float | None:
    """The tolerance in SI; None where none is given."""
    if arguments.tolerance is None:
        return None
    kind: Any = PositiveSpeed if arguments.quantity == "velocity" else PositiveLength
    try:
        tolerance: float = quantity(kind)(arguments.tolerance)
    except ValueError as error:
        raise CampaignError(f"--tolerance: {error}") from None
    if not tolerance > 0.0:
        raise CampaignError(f'--tolerance: got "{arguments.tolerance}", but it must be greater than 0')
    return tolerance


def sweep_command(arguments: argparse.Namespace) -> None:
    sweep = read_sweep(arguments.campaign, count=arguments.count)
    measures_of_runs(arguments.measure, sweep.campaigns)
    output = arguments.output or Path(arguments.campaign.stem + ".nc")
    picture = output.with_suffix(".png")
    check_output(output, ".nc", overwrite=True)
    check_output(picture, *PICTURES, overwrite=replaces(arguments, output))

    with (
        show_run(arguments) as follow,
        computer(arguments.device, workers=arguments.workers, scheduler=arguments.scheduler, warn=warn) as device,
    ):

        def named(name: str) -> Any:
            print(f"point {name}", file=sys.stderr)
            return follow

        run_sweep(
            sweep,
            output,
            device=device,
            resume=arguments.resume,
            overwrite=arguments.overwrite,
            progress=named,
            warn=warn,
        )
    dataset = files.read(output, SWEEP)
    print(text_of(sweep_view(dataset, arguments.measure)))
    sweep_figure(dataset, arguments.measure).savefig(picture, dpi=150)
    for written in (output, points_of(output), picture):
        print(written)


def sensitivity_command(arguments: argparse.Namespace) -> None:
    campaign = Campaign.from_toml(arguments.campaign)
    output = arguments.output or Path(f"{arguments.campaign.stem}_sensitivity.csv")
    picture = output.with_suffix(".png")
    check_output(output, ".csv", overwrite=arguments.overwrite)
    check_output(picture, *PICTURES, overwrite=arguments.overwrite)
    with show_progress(arguments) as show:
        table = sensitivity(
            campaign,
            hits=arguments.hits,
            measures=arguments.measure,
            device=arguments.device,
            progress=lambda done, total: show(Step(done, total)),
        )
    print(table.to_string(float_format="{:.4g}".format, na_rep="-"))
    print(largest_move(table))
    write_text(table.to_csv(), output)
    sensitivity_figure(table, campaign.title, arguments.hits).savefig(picture, dpi=150)
    print(f"written to {output}, figure in {picture}")


def test_command(arguments: argparse.Namespace) -> None:
    if arguments.test.suffix.lower() == ".csv":
        _evaluate(arguments)
    else:
        _simulate(arguments)


def _evaluate(arguments: argparse.Namespace) -> None:
    output = arguments.output or Path(f"{arguments.test.stem}_v50.csv")
    picture = output.with_suffix(".png")
    check_output(output, ".csv", overwrite=arguments.overwrite)
    check_output(picture, overwrite=arguments.overwrite)
    shots = read_shots(arguments.test)
    result = v50(*shots)
    print(result)
    write_text(pd.Series(asdict(result), name="value").to_csv(index_label="number"), output)
    shots_figure(shots, result, arguments.test.stem).savefig(picture, dpi=150)
    print(f"written to {output}, figure in {picture}")


def _simulate(arguments: argparse.Namespace) -> None:
    test = read_test(arguments.test)
    output = arguments.output or Path(arguments.test.stem + ".nc")
    picture, resume, overwrite = output.with_suffix(".png"), arguments.resume, arguments.overwrite
    check_output(output, ".nc", overwrite=overwrite or resume)
    check_output(picture, overwrite=overwrite or resume)
    with show_run(arguments) as progress:
        response = response_of(test, output, count=arguments.count, progress=progress, **computing(arguments))
    dataset = simulate_test(test, response)
    files.write(dataset, output)
    print(text_of(firing_view(dataset)))
    firing_figure(dataset).savefig(picture, dpi=150)
    print(f"written to {output}, figure in {picture}")


NONE_WITHIN_BOUNDS = 4
"""Exit code where no computed design keeps the bounds."""


def optimise_command(arguments: argparse.Namespace) -> int:
    design = read_design(arguments.design)
    output = arguments.output or Path(arguments.design.stem + ".nc")
    check_output(output, ".nc", overwrite=True)
    picture = output.with_suffix(".png")
    check_output(picture, overwrite=replaces(arguments, output))
    with show_progress(arguments, "design") as show, _computer_of(arguments) as machine:
        dataset = optimise(
            design,
            output,
            device=machine,
            resume=arguments.resume,
            overwrite=arguments.overwrite,
            progress=lambda done, total, text: show(Step(done, total, text=text)),
            warn=warn,
        )
    print(text_of(front_view(dataset)))
    front_figure(dataset, design.folder).savefig(picture, dpi=150)
    campaigns = f", campaigns in {folder_of(output)}" if dataset.sizes["front"] else ""
    print(f"written to {output}, figure in {picture}{campaigns}")
    return 0 if dataset.attrs[front.OUTCOME] == front.FEASIBLE else NONE_WITHIN_BOUNDS


def _computer_of(arguments: argparse.Namespace) -> AbstractContextManager[Computer]:
    """Return the computer for --device, --workers and --scheduler."""
    return computer(arguments.device, workers=arguments.workers, scheduler=arguments.scheduler, warn=warn)


def identify_command(arguments: argparse.Namespace) -> int:
    by_elements = arguments.fit.suffix == ".nc"
    fit = fit_of_result(arguments.fit) if by_elements else read_fit(arguments.fit)
    output = arguments.output or Path(f"{arguments.fit.stem}_fit.nc" if by_elements else f"{arguments.fit.stem}.nc")
    pictures = {output.with_name(f"{output.stem}_{name}.png"): draw for name, draw in FIGURES.items()}
    table = output.with_suffix(".csv")
    check_output(output, ".nc", overwrite=arguments.overwrite)
    for path in (table, *pictures):
        check_output(path, overwrite=arguments.overwrite)
    if fit.warning:
        warn(fit.warning)
    sampling = fit.file.sampling
    say(f"computes at most {sampling.sets} sets of parameters, {sampling.hits} hits of each shot")
    with show_progress(arguments, "set") as show, _computer_of(arguments) as machine:
        progress = lambda done, total, text: show(Step(done, total, text=text))  # noqa: E731
        posterior = identify(fit, device=machine, progress=progress)
    files.write(posterior, output)
    print(text_of(posterior_view(posterior)))
    print(f"written to {output}")
    if len(draws := material_draws(fit, posterior)):
        write_text(draws.to_csv(index=False), table)
        print(f"draws of the material for hits.file in {table}")
    for picture, draw in pictures.items():
        draw(posterior).savefig(picture, dpi=150)
        print(picture)
    return 130 if posterior.attrs[INTERRUPTED] else 0
