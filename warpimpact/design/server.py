"""The server of the page: on this machine alone, behind a token, to a browser that shows this page and no other."""

from __future__ import annotations

import asyncio
import secrets
import socket
import traceback
import warnings
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from functools import partial
from typing import Any, TypeVar

import uvicorn
from pydantic import ValidationError
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import ClientDisconnect, Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import BaseRoute, Mount, Route
from starlette.staticfiles import StaticFiles

from warpimpact.design.answers import THIS_DESIGN, Answers, Query
from warpimpact.design.designs import DesignStore, as_json, stages
from warpimpact.errors import CampaignError, DeviceError, Implausible, ResultError, TooLong
from warpimpact.records import attributes as attr
from warpimpact.runs.options import RunOptions
from warpimpact.scene.model import sentence
from warpimpact.solver.device import Cancel, Cancelled

Result = TypeVar("Result")

_HEADERS = {
    "content-security-policy": "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; "
    "img-src 'self' data: blob:; connect-src 'self'; base-uri 'none'; form-action 'none'; frame-ancestors 'none'",
    "cross-origin-resource-policy": "same-origin",
    "cross-origin-opener-policy": "same-origin",
    "referrer-policy": "no-referrer",
    "x-content-type-options": "nosniff",
    "cache-control": "no-store",
}
_MOST_BYTES = 2**20
"""Most bytes of a request."""
_FILES = StaticFiles(
    packages=[("warpimpact.report", "static"), ("warpimpact.design", "static"), ("plotly", "package_data")]
)
"""Scripts and styles of the page."""
_USER_ERRORS = (CampaignError, ResultError, DeviceError, TooLong, MemoryError)
"""Errors that the page shows as a sentence."""


class JobQueue:
    """Computes for any number of pages, one job at a time.

    An urgent job puts off a running one that refines a map, which begins again later.
    """

    def __init__(self) -> None:
        self._turn, self._calm = asyncio.Lock(), asyncio.Event()
        self._calm.set()  # no urgent job waits or runs
        self._urgent, self._refining = 0, Cancel()

    async def compute(self, work: Callable[[Cancel], Result], *, refines: bool = False) -> Result:
        """Return or raise what `work` does. If the awaiting task is cancelled, so is the work.

        Args:
            work: called in a thread with the token that cancels it.
            refines: whether it lets urgent work go first.
        """
        job = asyncio.ensure_future(self._refine(work) if refines else self._hurry(work))
        try:
            return await asyncio.shield(job)  # a response may be cancelled repeatedly
        finally:
            job.cancel()

    async def _hurry(self, work: Callable[[Cancel], Result]) -> Result:
        self._urgent += 1
        self._calm.clear()
        self._refining.cancel()
        try:
            async with self._turn:
                return await _in_thread(work, Cancel())
        finally:
            self._urgent -= 1
            if not self._urgent:
                self._calm.set()

    async def _refine(self, work: Callable[[Cancel], Result]) -> Result:
        while True:
            await self._calm.wait()
            async with self._turn:
                if self._calm.is_set():
                    self._refining = Cancel()
                    with suppress(Cancelled):  # put off
                        return await _in_thread(work, self._refining)


async def _in_thread(work: Callable[[Cancel], Result], cancel: Cancel) -> Result:
    """Return or raise what `work` does in a thread, which has ended then."""
    thread = asyncio.ensure_future(asyncio.to_thread(work, cancel))
    try:
        return await asyncio.shield(thread)
    finally:
        cancel.cancel()
        await asyncio.wait({thread})
        thread.exception()  # asyncio reports one that nobody takes


def application(store: DesignStore, *, token: str, options: RunOptions) -> Starlette:
    """The page and its queries as an ASGI application.

    Another page in the same browser can send requests to this machine, and a name server can give this machine another
    name. Neither knows the token, which begins every path, and neither has this host or this origin.
    """
    answers, jobs = Answers(store, options), JobQueue()

    async def page(request: Request) -> Response:
        return HTMLResponse(answers.page(version=attr.versions()[attr.WARPIMPACT_VERSION]))

    async def start(request: Request) -> Response:
        return PlainTextResponse(as_json({"designs": store.designs}), media_type="application/json")

    once = (answers.change, answers.open, answers.trajectory, answers.figure, answers.report)
    posts = {"compute": partial(_compute, answers, jobs), **{one.__name__: partial(_once, one, jobs) for one in once}}
    routes: list[BaseRoute] = [Route("/", page), Mount("/files", _FILES), Route("/start", start)]
    routes += [Route(f"/{name}", partial(_stream, of), methods=["POST"]) for name, of in posts.items()]
    return Starlette(
        routes=[Mount(f"/{token}", routes=routes)],
        middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=["127.0.0.1", "localhost"])],
        exception_handlers={404: _missing},
    )


async def _compute(answers: Answers, jobs: JobQueue, query: Query) -> AsyncIterator[Any]:
    """Give the plate of a design at once, then maps and numbers of each stage."""
    designs = answers.designs(query)
    yield await run_in_threadpool(answers.plate, designs[THIS_DESIGN])
    by_name = {name: stages(answers.store, design, query.level) for name, design in designs.items()}
    total = designs[THIS_DESIGN].campaign.hits.count or 0
    names = list(by_name[THIS_DESIGN])
    for stage, following in zip(names, [*names[1:], ""], strict=True):
        at_stage = {name: others.get(stage, others["full"]) for name, others in by_name.items()}
        refines = stage != "first"
        try:
            yield await jobs.compute(partial(answers.maps, stage, following, at_stage, total), refines=refines)
            yield await jobs.compute(partial(answers.numbers, at_stage), refines=refines)
        except _USER_ERRORS as error:
            if stage != "elements":
                raise
            yield {"kind": "kept", "sentence": f"By the fast law alone. {error}"}


async def _once(answer: Callable[[Query, Cancel], Any], jobs: JobQueue, query: Query) -> AsyncIterator[Any]:
    yield await jobs.compute(partial(answer, query))


async def _stream(answer: Callable[[Query], AsyncIterator[Any]], request: Request) -> Response:
    """Answer with a line of JSON for each value, or for an error. Closing the connection cancels the work."""
    if request.headers.get("origin") != f"http://{request.headers['host']}":
        raise HTTPException(403, "Only the page itself may request this.")
    body = b""
    try:
        async for chunk in request.stream():
            body += chunk
            if len(body) > _MOST_BYTES:
                return JSONResponse(_refusal(CampaignError(f"got a request of more than {_MOST_BYTES} bytes")))
    except ClientDisconnect:
        return Response(status_code=499)

    async def lines() -> AsyncIterator[str]:
        try:
            async for value in answer(Query.model_validate_json(body)):
                yield as_json(value) + "\n"
        except Exception as error:
            known = CampaignError(sentence(error, {})) if isinstance(error, ValidationError) else error
            yield as_json(_refusal(known)) + "\n"

    return StreamingResponse(lines(), media_type="application/x-ndjson")


def _refusal(error: Exception) -> dict[str, str]:
    """The sentence for an error on the page. The details of a bug go to the terminal."""
    if isinstance(error, _USER_ERRORS):
        return {"kind": "refused", "sentence": str(error) or "not enough memory"}
    traceback.print_exception(error)
    bug = f"{type(error).__name__}: {str(error)[:200]}"
    return {"kind": "refused", "sentence": f"This is a bug of warpimpact; the terminal has its details. {bug}"}


async def _missing(request: Request, error: Exception) -> Response:
    return PlainTextResponse(
        "There is nothing at this address. Each start of warpimpact design has another token and prints its address; "
        "warpimpact design 'ADDRESS' opens the design of an old one.",
        status_code=404,
    )


def server_of(app: Starlette) -> uvicorn.Server:
    """The server of the page."""
    return uvicorn.Server(
        uvicorn.Config(
            app,
            headers=list(_HEADERS.items()),
            ws="none",
            log_level="critical",
            access_log=False,
            lifespan="off",
            timeout_graceful_shutdown=1,
        )
    )


def serve(store: DesignStore, *, port: int = 0, options: RunOptions, ready: Callable[[str], object]) -> None:
    """Serve the page until a signal ends it.

    Args:
        ready: called with the address of the page.

    Raises:
        OSError: the port is taken.
    """
    with socket.create_server(("127.0.0.1", port)) as listening:
        token, port = secrets.token_urlsafe(18), listening.getsockname()[1]
        server = server_of(application(store, token=token, options=options))
        ready(f"http://127.0.0.1:{port}/{token}/")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Implausible)  # the page shows these
            server.run(sockets=[listening])
