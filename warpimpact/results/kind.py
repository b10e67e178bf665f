"""Kinds of files: name, maker, user, marks by which a file is recognised, and checks."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

from warpimpact.view.view import Section


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes:
        name: name with its article.
        use: the command that takes it.
        marks: names of variables, groups, attributes or tables. Every file of this kind, and no other, has one of them.
        maker: the command that writes it; empty if people write it.
        misuse: returns a sentence about what the user of a Dataset must do otherwise; None if nothing.
        fault: returns a phrase about what keeps a Dataset, or the tree of a posterior, from being of this kind; None if
            nothing does.
        is_tree: whether it is read as a tree of its groups.
        view: what `warpimpact inspect` and `report` show of it; None where a higher room has its view.
    """

    name: str
    use: str
    marks: Collection[str] = ()
    maker: str = ""
    misuse: Callable[[Any], str | None] = lambda dataset: None
    fault: Callable[[Any], str | None] = lambda dataset: None
    is_tree: bool = False
    view: Callable[[Any], list[Section]] | None = None

    def told(self, path: object, wanted: str) -> str:
        """A sentence that a file is of this kind and not the wanted one, with the command that takes it."""
        written = f", as {self.maker} writes" if self.maker else ""
        return f"{path}: is {self.name}{written}, not {wanted}; {self.use}"

    def mistake(self, dataset: Any) -> str | None:
        """What is wrong with a file that was taken for one of this kind, to follow its name; None if nothing is."""
        if (sentence := self.misuse(dataset)) is not None:
            return sentence
        fault = self.fault(dataset)
        return None if fault is None else f"not {self.name} of warpimpact, or damaged: {fault}"
