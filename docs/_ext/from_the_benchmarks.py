"""Directives whose tables follow from stored results of tests: benchmarks, the continuum, limit velocities."""

from __future__ import annotations

import sys
from collections.abc import Iterator

from from_the_code import CHECKOUT, FromTheCode, table
from sphinx.application import Sphinx

sys.path += [str(CHECKOUT / "tests" / "benchmarks"), str(CHECKOUT)]  # modules that know the results


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


class ValidationTable(FromTheCode):
    """A table of predicted limit velocities; its argument is "users" or the name of one in limit_velocities.py."""

    required_arguments = 1

    def lines(self) -> Iterator[str]:
        from tests.validation.limit_users import USERS, users_table
        from tests.validation.limit_velocities import SUMMARY, tables

        for file in (USERS, SUMMARY):
            self.env.note_dependency(str(file))
        head, rows = (tables() | {"users": users_table()})[self.arguments[0]]
        yield from table(head, rows)


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_directive("benchmark-table", BenchmarkTable)
    app.add_directive("continuum-table", ContinuumTable)
    app.add_directive("validation-table", ValidationTable)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
