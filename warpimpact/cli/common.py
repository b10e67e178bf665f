"""What several commands share: names of results, outputs that are refused early, what computes, exit codes."""

import argparse
import tempfile
from collections.abc import Sequence
from contextlib import AbstractContextManager
from pathlib import Path
from typing import Any

import xarray
from matplotlib.figure import Figure

from warpimpact.results import attributes as attr
from warpimpact.results.dataset import failed
from warpimpact.results.files import OutputError, ResultError, aside
from warpimpact.runs.chunks import is_begun
from warpimpact.runs.computer import Computer, computer

from .messages import say, warn

PICTURES = (".png", ".pdf", ".svg")
"""Formats of figures."""


def named(paths: Sequence[Path]) -> dict[str, Path]:
    """Return results by different names: the stems of the files if these differ, else the whole paths."""
    if repeated := [path for path in paths if paths.count(path) > 1]:
        raise ResultError(f"{repeated[0]}: got this result {len(repeated)} times, but each result counts once")
    stems = [path.stem for path in paths]
    return dict(zip(stems if len(set(stems)) == len(stems) else map(str, paths), paths, strict=True))


def check_output(path: Path, *suffixes: str, overwrite: bool) -> None:
    """Refuse a file that cannot be written, has another suffix, or exists and must not be replaced."""
    if path.is_dir():
        raise OutputError(f"{path}: is a folder, but the output is one file")
    if suffixes and path.suffix.lower() not in suffixes:
        raise OutputError(f"{path}: the name must end in {' or '.join(suffixes)}")
    check_folder(path.parent)
    if path.exists() and not overwrite:
        raise OutputError(f"{path}: exists already; name another file or give --overwrite")


def check_folder(folder: Path) -> None:
    """Refuse a folder in which no file can be written."""
    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written into ({error.strerror})") from None


def outputs(arguments: argparse.Namespace, stem: str, suffix: str = ".nc") -> tuple[Path, Path]:
    """Return the result of a command and its figure, which may be replaced with --overwrite.

    So they may with --resume where the result is begun or complete.
    """
    output = arguments.output or Path(stem + suffix)
    replaces = arguments.overwrite or (getattr(arguments, "resume", False) and is_begun(output))
    for path, ending in ((output, suffix), (output.with_suffix(".png"), ".png")):
        check_output(path, ending, overwrite=replaces)
    return output, output.with_suffix(".png")


def save_figure(figure: Figure, picture: Path, output: Path) -> None:
    """Save the figure of a result and say where both are."""
    figure.savefig(picture, dpi=150)
    print(f"written to {output}, figure in {picture}")


def write_text(text: str, path: Path) -> None:
    """Write a text, whole or not at all."""
    with aside(path) as file:
        file.write_text(text, encoding="utf-8")


def computer_of(arguments: argparse.Namespace) -> AbstractContextManager[Computer]:
    """Return the computer for --device, --workers and --scheduler."""
    return computer(arguments.device, workers=arguments.workers, scheduler=arguments.scheduler, warn=warn)


def computing(arguments: argparse.Namespace) -> dict[str, Any]:
    """The options of a computation into a file, as `run_to_file` takes them."""
    names = ("device", "workers", "scheduler", "resume", "overwrite")
    return {name: getattr(arguments, name) for name in names} | {"warn": warn}


def failure_code(dataset: xarray.Dataset, path: Path) -> int:
    """Return 3, with a message, if more shots failed than the campaign allows; else 0."""
    share, allowed = float(failed(dataset).mean()), dataset.attrs[attr.FAILED_SHARE]
    if share <= allowed:
        return 0
    say(
        f"{share:.3g} of the shots failed, more than output.failed_share = {allowed:g}; "
        f"warpimpact inspect {path} lists them"
    )
    return 3
