"""A report of a posterior: one HTML file with its numbers and figures, which works without a network."""

from __future__ import annotations

from base64 import b64encode
from html import escape
from io import BytesIO
from pathlib import Path

import xarray
from matplotlib.figure import Figure

from warpimpact.identification.posterior_view import posterior_view
from warpimpact.plotting.posterior import hits_figure, measured_figure, pairs_figure
from warpimpact.results import attributes as attr
from warpimpact.results import posterior_file
from warpimpact.results.files import aside
from warpimpact.view.view import html_of

_FIGURES = {
    "Parameters, in pairs": pairs_figure,
    "Measured and computed": measured_figure,
    "Where the shots hit": hits_figure,
}
_STYLE = (
    "body{font:16px sans-serif;max-width:70rem;margin:2rem auto;padding:0 1rem}img{max-width:100%}pre{overflow:auto}"
)


def write_posterior_report(tree: xarray.DataTree, path: Path) -> None:
    """Write the report of a posterior, whole or not at all.

    Raises:
        OutputError: the file cannot be written.
    """
    told = tree.attrs
    title = escape(str(told[attr.TITLE]))
    drawn = "".join(
        f"<h2>{name}</h2><img alt='{name}' src='{_picture(draw(tree))}'>" for name, draw in _FIGURES.items()
    )
    made = escape(f"{told[attr.HISTORY]}, version {told[attr.WARPIMPACT_VERSION]}, on {told[attr.DEVICE]}")
    page = (
        "<!DOCTYPE html><html lang='en'><head><meta charset='utf-8'>"
        "<meta http-equiv='Content-Security-Policy' "
        "content=\"default-src 'none'; img-src data:; style-src 'unsafe-inline'\">"
        f"<title>{title}</title><style>{_STYLE}</style></head><body><h1>{title}</h1>"
        f"{html_of(posterior_view(tree), 'h2')}{drawn}"
        f"<h2>The fit</h2><pre>{escape(str(told[posterior_file.FIT]))}</pre><p>{made}</p></body></html>\n"
    )
    with aside(path) as file:
        file.write_text(page, encoding="utf-8")


def _picture(figure: Figure) -> str:
    """A figure as the address of an image that holds itself."""
    buffer = BytesIO()
    figure.savefig(buffer, format="png", dpi=110)
    return f"data:image/png;base64,{b64encode(buffer.getvalue()).decode()}"
