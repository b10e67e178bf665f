"""What a search asks for, computed or taken from the disk."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import numpy as np
from numpy.typing import NDArray

from warpimpact.optimisation.crew import Crew
from warpimpact.optimisation.design import Design
from warpimpact.optimisation.evaluate import Job, Said, Told
from warpimpact.runs.store import Store


class Work:
    """Computes what a search asks for, or takes it from the disk.

    Attributes:
        computed: jobs that were not on the disk.
    """

    def __init__(self, design: Design, crew: Crew, store: Store | None) -> None:
        self._design, self._crew, self._store = design, crew, store
        self._batch, self.computed = 0, 0

    def said(self, jobs: Sequence[Job], told: Told) -> list[Said]:
        """What jobs say; one batch."""
        if jobs:
            told(0)
        found = self._said(jobs, told)
        if jobs:
            told(len(jobs))
        return found

    def _said(self, jobs: Sequence[Job], told: Told) -> list[Said]:
        seal = _seal(jobs)
        stored = self._load(seal)
        if stored is None:
            found = self._crew.said(self._design, jobs, told)
            self.computed += len(jobs)
            arrays = {
                f"{name}_{k}": np.asarray(part) for k, one in enumerate(found) for name, part in one._asdict().items()
            }
            self._save(seal, arrays)
            return found
        return [
            Said(stored[f"values_{k}"], stored[f"places_{k}"], stored[f"draws_{k}"], float(stored[f"seconds_{k}"]))
            for k, _ in enumerate(jobs)
        ]

    def levels(self, jobs: Sequence[Job], told: Told) -> list[str]:
        """What the pilots of jobs find; one batch."""
        if not jobs:
            return []
        told(0)
        seal = _seal(jobs)
        stored = self._load(seal)
        if stored is None:
            found = self._crew.levels(self._design, jobs, told)
            self.computed += len(jobs)
            self._save(seal, {"levels": np.array(found)})
        else:
            found = [str(one) for one in stored["levels"]]
        told(len(jobs))
        return found

    def _load(self, seal: str) -> dict[str, NDArray[Any]] | None:
        batch, self._batch = self._batch, self._batch + 1
        stored = None if self._store is None else self._store.load(batch)
        return stored if stored is not None and str(stored.get("jobs")) == seal else None

    def _save(self, seal: str, arrays: dict[str, NDArray[Any]]) -> None:
        if self._store is not None:
            self._store.save(self._batch - 1, {"jobs": np.array(seal), **arrays})


def _seal(jobs: Sequence[Job]) -> str:
    return hashlib.sha256(json.dumps([asdict(job) for job in jobs], default=str).encode()).hexdigest()
