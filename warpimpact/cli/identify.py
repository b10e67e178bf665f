"""The command identify: parameters with their uncertainty from measured shots."""

import argparse
from pathlib import Path
from typing import TYPE_CHECKING

from .mistakes import say
from .options import Commands, add_command, add_computing, add_output, add_overwrite
from .paths import check_output, check_picture, check_result
from .progress import Step, show_progress, warn

if TYPE_CHECKING:
    from warpimpact.identification.identify import FitProgress

PROCESSES = 16
"""Most processes of a fit, unless the user gives a number; each takes some 0.4 GB."""
WORTHWHILE = 2.0
"""Seconds of computing after which processes are started. A process needs as long until it computes."""


def add_identify(commands: Commands) -> None:
    parser = add_command(
        commands,
        "identify",
        _identify,
        summary="find parameters with their uncertainty from measured shots",
        description="Find the parameters of plate, interaction and core that agree with measured shots, each with its "
        "uncertainty. Unknown hit points are integrated out. Write the posterior as a netCDF file, the draws "
        " of the material as a CSV file that hits.file takes, and figures into the same folder. Print which "
        "parameters the shots determine, and whether the computation has converged.",
        example="identify campaigns/fits/paper_fit.toml -o paper_fit.nc",
    )
    parser.add_argument(
        "fit",
        type=Path,
        metavar="FIT",
        help="fit file: scene, measured shots, and priors of what is unknown; or a result of warpimpact continuum, "
        "whose hits then count as measured shots",
    )
    add_output(parser, "POSTERIOR.nc", "file of the posterior (default: the fit's name, in this folder)")
    add_computing(parser)
    add_overwrite(parser, "an existing posterior")


def _identify(arguments: argparse.Namespace) -> int:
    from warpimpact.identification.computed_shots import fit_of_result
    from warpimpact.identification.fit_file import read_fit
    from warpimpact.identification.identify import identify
    from warpimpact.identification.posterior import material_draws, posterior_view
    from warpimpact.plotting.posterior import FIGURES
    from warpimpact.results import files
    from warpimpact.results.posterior_file import INTERRUPTED
    from warpimpact.runs.executor import executor_for
    from warpimpact.solver.device import cores, find_device
    from warpimpact.view.view import text_of

    by_elements = arguments.fit.suffix == ".nc"
    fit = fit_of_result(arguments.fit) if by_elements else read_fit(arguments.fit)
    output = arguments.output or Path(f"{arguments.fit.stem}_fit.nc" if by_elements else f"{arguments.fit.stem}.nc")
    check_result(output, "a posterior")
    check_output(output, overwrite=arguments.overwrite)
    pictures = {output.with_name(f"{output.stem}_{name}.png"): draw for name, draw in FIGURES.items()}
    table = output.with_suffix(".csv")
    check_output(table, overwrite=arguments.overwrite)
    for picture in pictures:
        check_picture(picture, overwrite=arguments.overwrite)
    for sentence in fit.warnings:
        warn(sentence)
    device, workers, scheduler = arguments.device, arguments.workers, arguments.scheduler
    after = 0.0
    if workers is None and scheduler is None and find_device(device).is_cpu:
        workers, after = min(cores(), PROCESSES), WORTHWHILE
    say(f"computes at most {fit.sampling.sets} sets of parameters, {fit.sampling.hits} hits of each shot")
    with (
        show_progress("set") as show,
        executor_for(device, workers=workers, scheduler=scheduler, apart=True, after=after) as executor,
    ):
        posterior = identify(
            fit,
            device=executor,
            progress=lambda now: show(Step(now.done, now.total, text=_running(now))),
        )
    files.write(posterior, output)
    print(text_of(posterior_view(posterior)))
    print(f"written to {output}")
    if len(draws := material_draws(fit, posterior)):
        draws.to_csv(table, index=False)
        print(f"draws of the material for hits.file in {table}")
    for picture, draw in pictures.items():
        draw(posterior).savefig(picture, dpi=150)
        print(picture)
    return 130 if posterior.attrs[INTERRUPTED] else 0


def _running(now: "FitProgress") -> str:
    effective = "" if now.effective != now.effective else f", effective sample size {now.effective:.0f}"
    return f"smallest misfit {now.misfit:.3g}{effective}"
