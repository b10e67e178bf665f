"""Directives whose tables follow from tests/benchmarks/results: of the benchmarks, and of the continuum."""

from __future__ import annotations

import sys
from collections.abc import Iterator

from from_the_code import CHECKOUT, FromTheCode, table
from sphinx.application import Sphinx

sys.path.append(str(CHECKOUT / "tests" / "benchmarks"))  # the module that knows the results


class BenchmarkTable(FromTheCode):
    """Every figure with its reference and its sample; then the machine and the date of each benchmark."""

    def lines(self) -> Iterator[str]:
        import page

        stored = page.results()
        for name in page.KNOWN:
            self.env.note_dependency(str(page.RESULTS / f"{name}.json"))
        head = ("what", "scene", "figure", "beside what", "sample")
        yield from table(head, [tuple(row) for row in page.rows(stored)])
        yield from (f"- {sentence}" for sentence in page.machines(stored))


class ContinuumTable(FromTheCode):
    """A table of the continuum beside the fast law; its argument is the name of one in continuum_tables.py."""

    required_arguments = 1

    def lines(self) -> Iterator[str]:
        import continuum_tables

        for file in continuum_tables.RESULTS.glob("continuum_*.csv"):
            self.env.note_dependency(str(file))
        head, rows = continuum_tables.TABLES[self.arguments[0]]()
        yield from table(head, rows)


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("benchmark-table", BenchmarkTable)
    app.add_directive("continuum-table", ContinuumTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
