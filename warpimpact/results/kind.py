"""What a kind of file is: its name, who writes and takes it, by what it is recognised, and what is checked of it."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any

from warpimpact.view.view import Section


@dataclass(frozen=True)
class Kind:
    """A kind of file.

    Attributes:
        name: what it is, with its article.
        use: which command takes it.
        marks: names of variables, groups and attributes, or of tables, one of which every such file has and no other.
        maker: the command that writes it; empty of a file that people write.
        misuse: says of a Dataset what its user must do otherwise, as a sentence; None if nothing.
        fault: says what keeps a Dataset, or the tree of a posterior, from being of this kind, as a phrase; None if
            nothing does.
        is_tree: whether it is read as a tree of its groups.
        view: what `warpimpact inspect` and `report` show of it; None where a room above this one has its view.
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
        """A sentence that a file is of this kind and not what is wanted, with what takes it."""
        written = f", as {self.maker} writes" if self.maker else ""
        return f"{path}: is {self.name}{written}, not {wanted}; {self.use}"

    def mistake(self, dataset: Any) -> str | None:
        """What is wrong with a file that was taken for one of this kind, to follow its name; None if nothing is."""
        if (sentence := self.misuse(dataset)) is not None:
            return sentence
        fault = self.fault(dataset)
        return None if fault is None else f"not {self.name} of warpimpact, or damaged: {fault}"
