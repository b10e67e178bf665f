"""Paths of a command: names of results, and outputs that are refused before anything is computed."""

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path

from warpimpact.results.files import OutputError, ResultError, aside
from warpimpact.runs.chunks import is_begun

PICTURES = (".png", ".pdf", ".svg")
"""Formats of figures."""


def named(paths: Sequence[Path]) -> dict[str, Path]:
    """Return results by different names: the stems of the files if these differ, else the whole paths."""
    if repeated := [path for path in paths if paths.count(path) > 1]:
        raise ResultError(f"{repeated[0]}: got this result {len(repeated)} times, but each result counts once")
    stems = [path.stem for path in paths]
    return dict(zip(stems if len(set(stems)) == len(stems) else map(str, paths), paths, strict=True))


def replaces(arguments: argparse.Namespace, output: Path) -> bool:
    """Whether the command may replace the figures of a result.

    It may with --overwrite, and with --resume where the result is begun or complete.
    """
    return arguments.overwrite or (arguments.resume and is_begun(output))


def check_output(path: Path, *suffixes: str, overwrite: bool) -> None:
    """Refuse a file that cannot be written, has another suffix, or exists and must not be replaced."""
    if path.is_dir():
        raise OutputError(f"{path}: is a folder, but the output is one file")
    if suffixes and path.suffix.lower() not in suffixes:
        *others, last = suffixes
        raise OutputError(f"{path}: the name must end in {', '.join(others) + ' or ' if others else ''}{last}")
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


def write_text(text: str, path: Path) -> None:
    """Write a text, whole or not at all."""
    with aside(path) as file:
        file.write_text(text, encoding="utf-8")
