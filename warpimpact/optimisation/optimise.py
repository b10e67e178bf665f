"""From a design file to its front: search, fresh hits, file and campaigns."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from warpimpact.optimisation.confirm import Confirmed, check_references, confirm
from warpimpact.optimisation.design import Design, read_design
from warpimpact.optimisation.outcome import check_campaigns, to_dataset, write_campaigns
from warpimpact.optimisation.search import Follow, Searched, SearchProgress, search
from warpimpact.optimisation.searcher import check_installed
from warpimpact.results import attributes as attr
from warpimpact.results import files
from warpimpact.results.kinds import FRONT
from warpimpact.runs.choice import executor_for, opened
from warpimpact.runs.executor import Executor
from warpimpact.runs.parts import is_begun
from warpimpact.runs.questions import Question, answered
from warpimpact.runs.store import Store, content_of, stored

if TYPE_CHECKING:
    import xarray


def optimise(design: Design | str | Path, *, device: str = "auto", progress: Follow | None = None) -> xarray.Dataset:
    """Search the best designs, in memory.

    Args:
        design: the design, or its file.
        device: "auto" (CUDA if there is one, else the CPU), "cpu" or "cuda:0".

    Returns:
        The Dataset of results/front.py: every computed design, and the front by fresh hits.

    Raises:
        CampaignError: the file has a value that is not allowed, or no design keeps the constraints.
        DeviceError: the device is absent.
    """
    asked = design if isinstance(design, Design) else read_design(design)
    with executor_for(device) as executor:
        return _answered(asked, executor, progress)


def optimise_to_file(
    design: Design,
    output: Path,
    *,
    device: str | Executor = "auto",
    resume: bool = False,
    overwrite: bool = False,
    progress: Follow | None = None,
    tell: Callable[[str], object] = warnings.warn,
) -> list[Path]:
    """Search the best designs into a file, with a campaign file for each design of the front in `folder_of(output)`.
    Computed designs are on the disk at once, in `output`.parts.

    Args:
        resume: continue what is in `output`.parts; for a complete search, write the missing campaigns.
        overwrite: replace an existing result with its campaigns, and begin anew in place of an unfinished search.
        tell: called with a sentence for each damaged part, which is computed again, and for each changed campaign,
            which is kept.

    Returns:
        The campaign files.

    Raises:
        OutputError: a file cannot be written, must not be overwritten or belongs to another search.
        CampaignError: no design keeps the constraints.
        Interrupted: the user interrupted the search; what is saved can be resumed.
    """
    folder = folder_of(output)
    check_campaigns(folder, overwrite=overwrite or (resume and is_begun(output)))
    with opened(device) as computing:
        content = content_of(design.text, design.name, design.folder, computing.made_by)
        with stored(output, content, "search", resume=resume, overwrite=overwrite, tell=tell) as store:
            if store is not None:
                dataset = _answered(design, computing, progress, store)
                files.write(dataset.assign_attrs({attr.FINGERPRINT: store.parts.fingerprint}), output)
    return write_campaigns(design, files.read(output, FRONT), folder, overwrite=overwrite, tell=tell)


def folder_of(output: Path) -> Path:
    """Folder of the campaigns of the designs of a front."""
    return output.with_name(f"{output.stem}_designs")


def _answered(
    design: Design, executor: Executor, progress: Follow | None, store: Store | None = None
) -> xarray.Dataset:
    check_installed()
    check_references(design)
    searched, confirmed = answered(_searched(design, progress or (lambda now: None)), executor, store)
    return to_dataset(design, searched, confirmed, executor.made_by)


def _searched(design: Design, follow: Follow) -> Question[tuple[Searched, Confirmed]]:
    """The search and its front by fresh hits, as one question."""
    last: list[SearchProgress] = []

    def kept(now: SearchProgress) -> None:
        last[:] = [now]
        follow(now)

    def confirming(done: int, total: int, what: str) -> None:
        follow(replace(last[-1], done=done, total=total, resumed=0, what=what))

    searched = yield from search(design, kept)
    confirmed = yield from confirm(design, searched, confirming)
    return searched, confirmed
