"""Hit maps of hard bullet cores against perforated armour plates.

What a program needs is imported from here, figures from `warpimpact.plotting`, and less common shapes of holes and
cores from `warpimpact.scene`; other modules may change.
"""

from importlib import import_module
from importlib.metadata import version
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from . import plotting as plotting
    from .api import *  # noqa: F403
    from .api import __all__ as __all__

__version__ = version("warpimpact")


def __getattr__(name: str) -> Any:
    """Load a public name at its first use: `warpimpact --help` needs none, and their libraries take 2 to 8 seconds."""
    if name == "plotting":
        return import_module(".plotting", __name__)
    if name.startswith("__") and name != "__all__":
        raise AttributeError(name)
    return getattr(import_module(".api", __name__), name)


def __dir__() -> list[str]:
    return [*__getattr__("__all__"), "__version__", "plotting"]
