"""A page that is served in a thread of the test."""

import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from warpimpact.design.designs import DesignStore, read_designs

from ...options import CPU
from ..slotted import SLOTTED_PLATE

TOKEN = "a-token"


@contextmanager
def served(store: DesignStore) -> Iterator[str]:
    pytest.importorskip("uvicorn", reason="needs the extra design")
    from warpimpact.design.server import application, server_of

    with socket.create_server(("127.0.0.1", 0)) as own:
        port = own.getsockname()[1]
        server = server_of(application(store, token=TOKEN, options=CPU))
        thread = threading.Thread(target=server.run, kwargs={"sockets": [own]})
        thread.start()
        try:
            yield f"http://127.0.0.1:{port}/{TOKEN}/"
        finally:
            server.should_exit = True
            thread.join()


@pytest.fixture(scope="module")
def serve() -> Iterator[Callable[..., str]]:
    """A function that serves a page for campaign files, and returns its address."""
    with ExitStack() as stack:
        yield lambda *paths: stack.enter_context(served(DesignStore(read_designs(list(paths)))))


@pytest.fixture(scope="module")
def small(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The slotted plate with few hits."""
    path = tmp_path_factory.mktemp("design") / "small.toml"
    path.write_text(SLOTTED_PLATE.read_text().replace("count = 4096", "count = 1500").replace("\nhits = 12", ""))
    return path
