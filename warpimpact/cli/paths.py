"""The files that a person names: results told apart, and outputs refused before hours of computing what could not be
written after them."""

import tempfile
from collections.abc import Sequence
from pathlib import Path


def named(paths: Sequence[Path]) -> dict[str, Path]:
    """Results under names that tell them apart."""
    from warpimpact.results.files import ResultError

    if len(set(paths)) < len(paths):
        raise ResultError("the same result is given twice")
    stems = [path.stem for path in paths]
    return dict(zip(stems if len(set(stems)) == len(stems) else map(str, paths), paths, strict=True))


def check_output(path: Path, *, overwrite: bool) -> None:
    """Refuse a file that cannot be written, and one that is there unless it may be replaced."""
    from warpimpact.results.files import OutputError

    check_place(path)
    if path.exists() and not overwrite:
        raise OutputError(f"{path}: exists already; name another file or give --overwrite")


def check_picture(path: Path) -> None:
    """Refuse a picture that cannot be written; one that is there is replaced."""
    from warpimpact.results.files import OutputError

    if path.suffix not in (".png", ".pdf", ".svg"):
        raise OutputError(f"{path}: must end with .png, .pdf or .svg")
    check_place(path)


def check_place(path: Path) -> None:
    """Refuse a file that cannot be written."""
    from warpimpact.results.files import OutputError

    if path.is_dir():
        raise OutputError(f"{path}: is a folder, but the result is one file")
    check_folder(path.parent)


def check_folder(folder: Path) -> None:
    """Refuse a folder that cannot be written into."""
    from warpimpact.results.files import OutputError

    try:
        with tempfile.TemporaryFile(dir=folder):
            pass
    except OSError as error:
        raise OutputError(f"{folder}: cannot be written into ({error.strerror})") from None
