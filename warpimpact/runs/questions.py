"""Questions that are answered in rounds: the results of some jobs decide which jobs come next.

A question is a generator. It yields a `Round`, is sent the results of its jobs in their order, and returns its answer.
It knows neither who computes nor what is on the disk, so its answer has the same bits everywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from contextlib import closing
from dataclasses import dataclass, fields
from typing import Any, NamedTuple, TypeVar, cast

import numpy as np
from numpy.typing import NDArray

from warpimpact.runs.executor import Executor, Job, completed
from warpimpact.runs.store import Store

Arrays = dict[str, NDArray[Any]]
"""Result of a job."""
Answer = TypeVar("Answer")


class RoundProgress(NamedTuple):
    """The progress of a round.

    Attributes:
        done: number of jobs done, with the reported shares of running ones.
        resumed: jobs that an earlier call had computed.
        results: results of the jobs done, by their places in the round.
    """

    done: float
    resumed: int
    results: dict[int, Arrays]


@dataclass(frozen=True)
class Round:
    """Jobs that are computed together.

    Attributes:
        jobs: jobs. Each reports the share that is done, from 0 to 1, and returns `Arrays`.
        keys: for each job, what determines its result beside the content of the store.
        tell: called with the progress of the round.
    """

    jobs: Sequence[Job]
    keys: Sequence[str]
    tell: Callable[[RoundProgress], object] = lambda now: None


Part = TypeVar("Part")


def packed(parts: Sequence[Any]) -> Arrays:
    """Dataclasses of arrays and numbers as the result of a job."""
    return {f"{name}_{k}": np.asarray(value) for k, part in enumerate(parts) for name, value in vars(part).items()}


def unpacked(kind: type[Part], arrays: Arrays) -> list[Part]:
    """The dataclasses of one kind that are `packed` in the result of a job."""
    names = [field.name for field in fields(cast("Any", kind))]
    return [kind(**{name: arrays[f"{name}_{k}"] for name in names}) for k in range(len(arrays) // len(names))]


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
        asked = next(question)
        while True:
            results = _results(asked, first, executor, store)
            first += len(asked.jobs)
            asked = question.send(results)
    except StopIteration as end:
        answer: Answer = end.value
        return answer


def _results(asked: Round, first: int, executor: Executor, store: Store | None) -> list[Arrays]:
    """The results of a round. Its first job is number `first` of its question."""
    results: dict[int, Arrays] = {}
    for place, key in enumerate(asked.keys):
        if store is not None and (saved := store.load(first + place)) is not None and str(saved.pop("key", "")) == key:
            results[place] = saved
    resumed = len(results)

    def tell(under_way: float = 0.0) -> None:
        asked.tell(RoundProgress(len(results) + under_way, resumed, results))

    tell()
    jobs = iter([(place, job) for place, job in enumerate(asked.jobs) if place not in results])
    with closing(completed(executor, jobs, lambda: tell(sum(executor.reports())))) as computed:
        for place, arrays in computed:
            if store is not None:
                store.save(first + place, {"key": np.array(asked.keys[place]), **arrays})
            results[place] = arrays
            tell()
    return [results[place] for place in range(len(asked.jobs))]
