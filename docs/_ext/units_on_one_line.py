"""Numbers stay on the line of their units."""

from __future__ import annotations

import re
from typing import Any

from docutils import nodes
from sphinx.application import Sphinx
from sphinx.transforms.post_transforms import SphinxPostTransform

NO_BREAK = "\N{NO-BREAK SPACE}"
_UNITS = r"m/s|mm[²³]?|cm|m|µm|°C?|%|k?g|kg/m[²³]|Nm?|k?J|[MG]?Pa|[nµm]?s|min|h|HV|K|[KMG]iB"
_BREAK = re.compile(rf"(?<=[\d,]) (?=(?:{_UNITS})(?![\w/°%]))")


def bound(text: str) -> str:
    """Text with a space that does not break between a number, or a comma, and a unit."""
    return _BREAK.sub(NO_BREAK, text)


class BoundUnits(SphinxPostTransform):
    """Binds units in the text of a page, not in its code and formulas."""

    default_priority = 800

    def run(self, **_: Any) -> None:
        for text in list(self.document.findall(nodes.Text)):
            parent = text.parent
            if not isinstance(parent, nodes.FixedTextElement | nodes.literal | nodes.math | nodes.raw | nodes.comment):
                parent.replace(text, nodes.Text(bound(str(text))))


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_post_transform(BoundUnits)
    return {"parallel_read_safe": True, "parallel_write_safe": True}
