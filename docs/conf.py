"""Sphinx: how the pages of this folder become one."""

import os
import sys
from importlib.metadata import version as version_of
from importlib.util import find_spec
from pathlib import Path

from jupyter_client import KernelManager
from sphinx.application import Sphinx

HERE = Path(__file__).parent
sys.path.insert(0, str(HERE / "_ext"))
# Tutorials call the command of the environment that builds them, and say no progress.
os.environ["PATH"] = os.pathsep.join([str(Path(sys.executable).parent), os.environ.get("PATH", "")])
os.environ["PYDEVD_DISABLE_FILE_VALIDATION"] = "1"
if "transport_encryption" in KernelManager.class_traits():  # else a kernel warns that its TCP is open
    KernelManager.transport_encryption.default_value = "auto"

project = "warpimpact"
author = "The warpimpact developers"
copyright = author
release = version_of("warpimpact")

extensions = [
    "myst_nb",
    "sphinx_design",
    "sphinx.ext.autodoc",
    "sphinx.ext.napoleon",
    "sphinx.ext.doctest",
    "sphinx.ext.mathjax",
    *(name for name in ["sphinx-mathjax-offline"] if find_spec(name)),  # formulas without a network, of the extra docs
    "from_the_code",
    "from_the_benchmarks",
    "units_on_one_line",
]
exclude_patterns = ["_build", "_ext"]
nitpicky = False
default_role = "code"

myst_enable_extensions = ["dollarmath", "amsmath", "colon_fence", "deflist", "fieldlist"]
myst_heading_anchors = 3
myst_dmath_double_inline = True

nb_execution_mode = "force"
nb_execution_raise_on_error = True
nb_execution_show_tb = True
nb_execution_timeout = 300
nb_execution_in_temp = True
nb_merge_streams = True
nb_output_stderr = "remove"
suppress_warnings = ["myst-nb.lexer"]  # of pages that are not executed, where their examples alone are checked

autodoc_typehints = "signature"
autodoc_member_order = "bysource"
autodoc_class_signature = "mixed"
napoleon_google_docstring = True
napoleon_numpy_docstring = False
napoleon_use_ivar = True
napoleon_use_rtype = False

html_theme = "pydata_sphinx_theme"
html_title = "warpimpact"
html_theme_options = {
    "show_toc_level": 2,
    "navigation_with_keys": False,
    "secondary_sidebar_items": ["page-toc"],
    "pygments_light_style": "default",
    "show_prev_next": True,
}
html_static_path = ["_static"]
html_css_files = ["pages.css"]
html_sidebars = {"*": []}  # pages at the top level have no others beside them; "*" matches no folder
html_sourcelink_suffix = ""
html_show_sourcelink = False


def setup(app: Sphinx) -> None:
    """Read pages in parallel: the extension that copies MathJax reads none, and does not say so."""
    app.connect("config-inited", _let_pages_be_read_in_parallel)


def _let_pages_be_read_in_parallel(app: Sphinx, _: object) -> None:
    if "sphinx-mathjax-offline" in app.extensions:
        app.extensions["sphinx-mathjax-offline"].parallel_read_safe = True
