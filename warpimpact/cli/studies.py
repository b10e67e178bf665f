"""The commands limit, sweep, sensitivity, test, optimise and identify: many runs, one answer."""

import argparse
from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

import pandas as pd

from warpimpact.analysis.inspection import range_note
from warpimpact.analysis.numbers import text_of
from warpimpact.campaign.campaign import Campaign, measures_of_runs
from warpimpact.campaign.text import as_campaign_error
from warpimpact.firing.simulate import firing_view, read_test, response_of, simulate_test
from warpimpact.firing.v50 import read_shots, v50
from warpimpact.identification.fit import fit_of_result, read_fit
from warpimpact.identification.identify import identify, material_draws, most_sets, posterior_view
from warpimpact.optimisation.design import read_design
from warpimpact.optimisation.front import FEASIBLE, designs_folder, front_view
from warpimpact.optimisation.optimise import optimise
from warpimpact.plotting.comparison import front_figure
from warpimpact.plotting.studies import (
    firing_figure,
    hits_figure,
    limit_figure,
    pairs_figure,
    sensitivity_figure,
    shots_figure,
    sweep_figure,
)
from warpimpact.records.kinds import SWEEP
from warpimpact.results import files
from warpimpact.runs.compute import limit_of
from warpimpact.runs.run import run_to_file
from warpimpact.scene.units import PositiveLength, PositiveSpeed, count_text, quantity
from warpimpact.studies.limit import check_measures, limit_view
from warpimpact.studies.sensitivity import as_text, largest_move, sensitivity
from warpimpact.studies.sweep import points_folder, read_sweep, run_sweep, sweep_view

from .common import (
    check_output,
    continuum_hits,
    failure_code,
    output_store,
    outputs,
    run_options,
    save_figure,
    with_elements,
    write_text,
)
from .messages import say, warn


def limit_command(arguments: argparse.Namespace) -> int:
    needs_velocity = arguments.quantity != "velocity"
    campaign = Campaign.from_toml(arguments.campaign, count=arguments.count, needs_velocity=needs_velocity)
    output, picture = outputs(arguments, f"{arguments.campaign.stem}_limit")
    kind: Any = PositiveLength if needs_velocity else PositiveSpeed
    with as_campaign_error("--tolerance: "):
        tolerance = None if arguments.tolerance is None else quantity(kind)(arguments.tolerance)
        if tolerance is not None and not tolerance > 0.0:
            raise ValueError(f'got "{arguments.tolerance}", but it must be greater than 0')
    check_measures(arguments.measure, arguments.quantity)
    if (arguments.quantity, 0) in campaign.scatter.given:
        warn(f"a limit {arguments.quantity} does not depend on its scatter, which says where the searches begin")
    with run_options(arguments) as options:
        with as_campaign_error(file=str(arguments.campaign)):
            limit = limit_of(campaign, arguments.quantity, tolerance, arguments.layer)
        run_to_file(campaign, output_store(arguments, output), limit=limit, options=options)
    dataset = files.read(output)
    print(text_of(limit_view(dataset, arguments.measure)))
    for line in range_note([dataset], str(output)):
        print(line)
    save_figure(limit_figure(dataset), picture, output)
    return failure_code(dataset, output)


def sweep_command(arguments: argparse.Namespace) -> None:
    sweep = read_sweep(arguments.campaign, count=arguments.count)
    measures_of_runs(arguments.measure, sweep.campaigns)
    points = {name: with_elements(arguments, campaign) for name, campaign in sweep.campaigns.items()}
    output, picture = outputs(arguments, arguments.campaign.stem)
    with run_options(arguments) as options:
        run_sweep(replace(sweep, campaigns=points), output_store(arguments, output), options=options)
    dataset = files.read(output, SWEEP)
    print(text_of(sweep_view(dataset, arguments.measure)))
    sweep_figure(dataset, arguments.measure).savefig(picture, dpi=150)
    for written in (output, points_folder(output), picture):
        print(written)


def sensitivity_command(arguments: argparse.Namespace) -> None:
    campaign = Campaign.from_toml(arguments.campaign)
    output, picture = outputs(arguments, f"{arguments.campaign.stem}_sensitivity", ".csv")
    with run_options(arguments) as options:
        table = sensitivity(campaign, hits=arguments.hits, measures=arguments.measure, options=options)
    print(as_text(table).rename_axis(None).to_string())
    print(largest_move(table))
    if table.attrs["note"]:
        print(table.attrs["note"])
    write_text(table.to_csv(), output)
    save_figure(sensitivity_figure(table, campaign.title, arguments.hits), picture, output)


def test_command(arguments: argparse.Namespace) -> None:
    if arguments.test.suffix.lower() == ".csv":
        output, picture = outputs(arguments, f"{arguments.test.stem}_v50", ".csv")
        shots = read_shots(arguments.test)
        result = v50(*shots)
        print(result)
        write_text(pd.Series(asdict(result), name="value").to_csv(index_label="number"), output)
        save_figure(shots_figure(shots, result, arguments.test.stem), picture, output)
        return
    test = read_test(arguments.test)
    output, picture = outputs(arguments, arguments.test.stem)
    with run_options(arguments) as options:
        response = response_of(test, output_store(arguments, output), count=arguments.count, options=options)
    dataset = simulate_test(test, response)
    files.write(dataset, output)
    print(text_of(firing_view(dataset)))
    save_figure(firing_figure(dataset), picture, output)


NONE_WITHIN_BOUNDS = 4
"""Exit code where no computed design meets the bounds."""


def optimise_command(arguments: argparse.Namespace) -> int:
    design = read_design(arguments.design)
    design = design.with_continuum_hits(continuum_hits(arguments, design.continuum_hits))
    output, picture = outputs(arguments, arguments.design.stem)
    with run_options(arguments, "design") as options:
        dataset = optimise(design, output_store(arguments, output), options=options)
    print(text_of(front_view(dataset)))
    save_figure(front_figure(dataset, design.folder), picture, output)
    if dataset.sizes["front"]:
        print(f"campaigns in {designs_folder(output)}")
    return 0 if dataset.outcome == FEASIBLE else NONE_WITHIN_BOUNDS


def identify_command(arguments: argparse.Namespace) -> int:
    by_elements = arguments.fit.suffix == ".nc"
    fit = fit_of_result(arguments.fit) if by_elements else read_fit(arguments.fit)
    output = arguments.output or Path(f"{arguments.fit.stem}_fit.nc" if by_elements else f"{arguments.fit.stem}.nc")
    figures = {"pairs": pairs_figure, "hits": hits_figure}
    pictures = {output.with_name(f"{output.stem}_{name}.png"): draw for name, draw in figures.items()}
    table = output.with_suffix(".csv")
    for path, suffixes in {output: [".nc"], **{path: [] for path in (table, *pictures)}}.items():
        check_output(arguments, path, *suffixes)
    hits = count_text(fit.file.sampling.hits, "hit")
    say(f"computes at most {count_text(most_sets(fit), 'set')} of parameters, {hits} of each shot")
    with run_options(arguments, "set") as options:
        posterior = identify(fit, options=options)
    files.write(posterior, output)
    print(text_of(posterior_view(posterior)))
    print(f"written to {output}")
    if len(draws := material_draws(fit, posterior)):
        write_text(draws.to_csv(index=False), table)
        print(f"draws of the material for hits.file in {table}")
    for picture, draw in pictures.items():
        draw(posterior).savefig(picture, dpi=150)
        print(picture)
    return 130 if posterior.attrs["interrupted"] else 0
