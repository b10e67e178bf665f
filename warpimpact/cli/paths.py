"""Checks of paths: results get different names, and an output that cannot be written is refused before the
computation."""

import argparse
import tempfile
from collections.abc import Sequence
from pathlib import Path


def named(paths: Sequence[Path]) -> dict[str, Path]:
    """Results by different names: the stems of the files if these differ, else the whole paths."""
    from warpimpact.results.files import ResultError

    if repeated := [path for path in paths if paths.count(path) > 1]:
        raise ResultError(f"{repeated[0]}: got this result {len(repeated)} times, but each result counts once")
    stems = [path.stem for path in paths]
    return dict(zip(stems if len(set(stems)) == len(stems) else map(str, paths), paths, strict=True))


def replaces(arguments: argparse.Namespace, output: Path) -> bool:
    """Whether the command may replace files beside a result: with --overwrite, and with --resume where the result is
    begun or complete."""
    from warpimpact.runs.parts import is_begun

    return arguments.overwrite or (arguments.resume and is_begun(output))


def check_output(path: Path, *, overwrite: bool) -> None:
    """Refuse a file that cannot be written, or that exists and must not be replaced."""
    from warpimpact.results.files import OutputError

    check_place(path)
    if path.exists() and not overwrite:
        raise OutputError(f"{path}: exists already; name another file or give --overwrite")


def check_picture(path: Path, *, overwrite: bool) -> None:
    """Refuse a picture that cannot be written, or that exists and must not be replaced."""
    check_suffix(path, "a picture", ".png", ".pdf", ".svg")
    check_output(path, overwrite=overwrite)


def check_result(path: Path, what: str) -> None:
    """Refuse a netCDF file that cannot be written, or with another suffix."""
    check_place(path)
    check_suffix(path, what, ".nc")


def check_suffix(path: Path, what: str, *suffixes: str) -> None:
    """Refuse a name whose suffix belongs to another format."""
    from warpimpact.results.files import OutputError

    if path.suffix.lower() not in suffixes:
        allowed = " or ".join([", ".join(suffixes[:-1]), suffixes[-1]] if len(suffixes) > 1 else suffixes)
        raise OutputError(f"{path}: the name of {what} must end in {allowed}")


def check_place(path: Path) -> None:
    """Refuse a file that cannot be written."""
    from warpimpact.results.files import OutputError

    if path.is_dir():
        raise OutputError(f"{path}: is a folder, but the output is one file")
    check_folder(path.parent)


def check_folder(folder: Path) -> None:
    """Refuse a folder in which no file can be written."""
    from warpimpact.results.files import OutputError

    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written into ({error.strerror})") from None
