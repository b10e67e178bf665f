"""Questions that are answered in rounds: the results of some jobs decide which jobs come next.

A question is a generator. It yields a `Round`, is sent the results of its jobs in their order, and returns its answer.
It knows neither who computes nor what is on the disk, so its answer has the same bits everywhere. A `Store` holds the
results of its jobs as batches on the disk, beside the file of the answer; a batch depends only on the content and on
earlier batches, so a resumed computation equals an undisturbed one.
"""

from __future__ import annotations

import json
import warnings
from collections.abc import Callable, Generator, Iterator, Mapping, Sequence
from contextlib import closing, contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from warpimpact.campaign.places import files_in
from warpimpact.campaign.text import parsed
from warpimpact.runs.executor import Executor, Job, completed
from warpimpact.runs.parts import Form, Parts, claimed, digest, telling


def content_of(text: str, name: str, folder: Path, made_by: Mapping[str, str]) -> dict[str, Any]:
    """What determines every bit of a result: the tables of a design file, the contents of the files that it
    names, versions and kind of device. `name` is that of the file in errors; names in it count from `folder`."""
    tables = json.loads(json.dumps(parsed(text, name), default=str))
    named = {file: folder / file for file in files_in(tables)}
    return {**tables, "files": {file: digest(path) for file, path in named.items() if path.is_file()}, **made_by}


@contextmanager
def stored(
    output: Path,
    content: Mapping[str, Any],
    kind: str,
    *,
    resume: bool,
    overwrite: bool,
    tell: Callable[[str], object] = warnings.warn,
) -> Iterator[Store | None]:
    """The `Store` of a computation while it runs; None if its result is already complete. The store is emptied when the
    result is written. If the computation ends before, the store can be resumed.

    Raises:
        OutputError: something there must be neither resumed nor overwritten, another computation is at work, or the
            disk is full; the message says what is saved.
        Interrupted: the user interrupted the computation; the message says what is saved.
    """
    with claimed(output):
        store = Store(output, content, kind, tell)
        if not store.parts.begin(resume=resume, overwrite=overwrite):
            yield None
            return
        with telling(store.parts.kept):
            yield store
        store.parts.discard()


class Store:
    """Batches of one computation as `Parts`, in a folder that is `claimed`."""

    def __init__(
        self, output: Path, content: Mapping[str, Any], kind: str, tell: Callable[[str], object] = warnings.warn
    ) -> None:
        def counted(count: int) -> str:
            return f"{count} batch{'' if count == 1 else 'es'}"

        self.parts = Parts(output, content, kind, Form("batch", ".npz"), counted, tell)

    def load(self, batch: int) -> dict[str, NDArray[Any]] | None:
        """The results of a batch; None if it was not computed.

        Raises:
            OutputError: its file is gone or was damaged.
        """
        if batch not in self.parts.saved:
            return None
        with np.load(self.parts.path(batch), allow_pickle=False) as file:
            return dict(file)

    def save(self, batch: int, arrays: Mapping[str, NDArray[Any]]) -> None:
        """Put a batch on the disk.

        Raises:
            OutputError: the batch cannot be written.
        """

        def write(path: Path) -> None:
            with path.open("wb") as file:
                np.savez(file, allow_pickle=False, **arrays)

        self.parts.save(batch, write)


Arrays = dict[str, NDArray[Any]]
"""Result of a job."""
Answer = TypeVar("Answer")


@dataclass(frozen=True)
class Round:
    """Jobs that are computed together.

    Attributes:
        jobs: jobs. Each reports the share that is done, from 0 to 1, and returns `Arrays`.
        keys: for each job, what determines its result beside the content of the store.
        report: called with the number of jobs done, with the reported shares of running ones, and of those that an
            earlier call had computed.
    """

    jobs: Sequence[Job]
    keys: Sequence[str]
    report: Callable[[float, int], object] = lambda done, resumed: None


Question = Generator[Round, list[Arrays], Answer]


def answered(question: Question[Answer], executor: Executor, store: Store | None = None) -> Answer:
    """Answer a question.

    Args:
        store: holds results of an earlier call, and takes each new result at once.

    Raises:
        OutputError: a result cannot be stored.
        Exception: the error of the question, or of a job.
    """
    first = 0
    try:
        jobs = next(question)
        while True:
            results = results_of(jobs, executor, store, first)
            first += len(jobs.jobs)
            jobs = question.send(results)
    except StopIteration as end:
        answer: Answer = end.value
        return answer


def results_of(asked: Round, executor: Executor, store: Store | None, first: int = 0) -> list[Arrays]:
    """The results of a round. Its first job is number `first` of its question."""
    results: dict[int, Arrays] = {}
    for place, key in enumerate(asked.keys):
        if store is not None and (saved := store.load(first + place)) is not None and str(saved.pop("key", "")) == key:
            results[place] = saved
    resumed = len(results)

    asked.report(resumed, resumed)
    jobs = iter([(place, job) for place, job in enumerate(asked.jobs) if place not in results])
    with closing(
        completed(executor, jobs, lambda: asked.report(len(results) + sum(executor.reports()), resumed))
    ) as computed:
        for place, arrays in computed:
            if store is not None:
                store.save(first + place, {"key": np.array(asked.keys[place]), **arrays})
            results[place] = arrays
            asked.report(len(results), resumed)
    return [results[place] for place in range(len(asked.jobs))]
