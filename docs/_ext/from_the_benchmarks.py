"""Directives of the benchmark page: its table follows from tests/benchmarks/results."""

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

        found = page.results()
        for name in page.KNOWN:
            self.env.note_dependency(str(page.RESULTS / f"{name}.json"))
        head = ("what", "scene", "figure", "beside what", "sample")
        yield from table(head, [tuple(row) for row in page.rows(found)])
        yield from (f"- {sentence}" for sentence in page.machines(found))


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("benchmark-table", BenchmarkTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
