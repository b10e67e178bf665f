"""The server of the page: on this machine alone, behind a token, to a browser that shows this page and no other."""

from __future__ import annotations

import asyncio
import heapq
import secrets
import socket
import traceback
import warnings
from collections.abc import AsyncGenerator, AsyncIterator, Awaitable, Callable
from contextlib import aclosing
from functools import cache, partial
from importlib.resources import files
from itertools import count
from typing import Any, TypeVar

import uvicorn
from plotly.offline import get_plotlyjs
from starlette.applications import Starlette
from starlette.concurrency import run_in_threadpool
from starlette.exceptions import HTTPException
from starlette.middleware import Middleware
from starlette.middleware.trustedhost import TrustedHostMiddleware
from starlette.requests import Request
from starlette.responses import HTMLResponse, JSONResponse, PlainTextResponse, Response, StreamingResponse
from starlette.routing import Mount, Route

import warpimpact
from warpimpact.campaign.text import CampaignError, parsed
from warpimpact.design.answers import Answers, named
from warpimpact.design.designs import Shelf, Tables, ValidDesign, as_json, changed, stages
from warpimpact.results.files import ResultError
from warpimpact.scene.bounds import Implausible
from warpimpact.scene.units import quoted
from warpimpact.solver.device import DeviceError
from warpimpact.solver.resolution import TooManySteps
from warpimpact.solver.worker import Cancel, Cancelled

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
_MOST_PINS = 5
_FILES = {
    "report": ("page.css", "drawing.js"),
    "design": ("design.css", "plate.js", "controls.js", "address.js", "design.js"),
}
"""Files of the page, by the rooms that have them."""
_MISTAKES = (CampaignError, ResultError, DeviceError, TooManySteps, MemoryError)
"""Errors that the page shows as a sentence."""
_FIRST, _CLICK, _REFINE = 0, 1, 2
"""Urgencies: the first map after a change, a click of the user, and the later stages."""
_LINES = "application/x-ndjson"
_PLOTLY = cache(get_plotlyjs)
_STAGES = {"first": _FIRST, "draft": _REFINE, "full": _REFINE}


class JobQueue:
    """Computes for any number of pages, one job at a time.

    A new job puts off a less urgent running one, which begins again later. So a page that refines its map does not keep
    another one waiting.
    """

    def __init__(self) -> None:
        self._waiting: list[tuple[int, int, asyncio.Future[None], Cancel]] = []
        self._running: tuple[int, int, asyncio.Future[None], Cancel] | None = None
        self._numbers = count()

    async def compute(self, urgency: int, work: Callable[[Cancel], Result]) -> Result:
        """Return or raise what `work` does. If the awaiting task is cancelled, so is the work.

        Args:
            urgency: 0 is the most urgent.
            work: called with the token that cancels it, in a thread.
        """
        number = next(self._numbers)
        while True:
            job = (urgency, number, asyncio.get_running_loop().create_future(), Cancel())
            heapq.heappush(self._waiting, job)
            if self._running is not None and self._running[0] > urgency:
                self._running[-1].cancel()
            self._start_next()
            try:
                return await self._in_turn(job, work)
            except Cancelled:  # put off
                pass
            finally:
                if self._running is job:
                    self._running = None
                self._start_next()

    @staticmethod
    async def _in_turn(job: tuple[int, int, asyncio.Future[None], Cancel], work: Callable[[Cancel], Result]) -> Result:
        _, _, turn, cancel = job
        await turn
        thread = asyncio.ensure_future(asyncio.to_thread(work, cancel))
        try:
            return await asyncio.shield(thread)
        except asyncio.CancelledError:
            cancel.cancel()
            await asyncio.wait({thread})
            thread.exception()  # nobody waits for it
            raise

    def _start_next(self) -> None:
        while self._waiting and self._running is None:
            job = heapq.heappop(self._waiting)
            if not job[2].cancelled():
                self._running = job
                job[2].set_result(None)


def application(
    shelf: Shelf, *, token: str, device: str = "auto", entered: Callable[[], object] = lambda: None
) -> Starlette:
    """The page and its requests as an ASGI application.

    Another page in the same browser can send requests to this machine, and a name server can give this machine another
    name. Neither knows the token, and neither has this host or this origin.

    Args:
        token: first part of every path.
        entered: called whenever a browser gets the page.
    """
    pages = _Pages(Answers(shelf, device), JobQueue(), entered)
    routes = [
        Route("/", pages.page),
        Route("/files/{name}", _file),
        Route("/start", pages.start),
        Route("/compute", pages.compute, methods=["POST"]),
    ]
    answers = (pages.change, pages.open, pages.trajectory, pages.figure, pages.report)
    routes += [Route(f"/{one.__name__}", partial(_answered, one), methods=["POST"]) for one in answers]
    return Starlette(
        routes=[Mount(f"/{token}", routes=routes)],
        middleware=[Middleware(TrustedHostMiddleware, allowed_hosts=["127.0.0.1", "localhost"])],
        exception_handlers={404: _nothing_there},
    )


class _Pages:
    """Handlers of the paths of the page. They keep no state of a single browser."""

    def __init__(self, answers: Answers, jobs: JobQueue, entered: Callable[[], object]) -> None:
        self._answers, self._jobs, self._shelf, self._entered = answers, jobs, answers.shelf, entered

    async def page(self, request: Request) -> Response:
        self._entered()
        return HTMLResponse(self._answers.page(version=warpimpact.__version__))

    async def start(self, request: Request) -> Response:
        return PlainTextResponse(as_json({"designs": self._shelf.designs}), media_type="application/json")

    async def compute(self, request: Request) -> Response:
        """Answer with the plate of a design at once, then with its maps from few hits to all of them, a line of JSON
        each. Closing the connection cancels the work."""
        _check_origin(request)
        try:
            asked = await _asked(request)
            level = _whole(asked, "level", 0, 9)
            design, others = self._designs(asked)
        except Exception as error:
            return PlainTextResponse(_refused(error), media_type=_LINES)

        async def lines() -> AsyncIterator[str]:
            try:
                async with aclosing(self._lines(design, others, level)) as lines:
                    async for line in lines:
                        yield await run_in_threadpool(as_json, line) + "\n"
            except Exception as error:
                yield _refused(error)

        return StreamingResponse(lines(), media_type=_LINES)

    async def _lines(
        self, design: ValidDesign, others: list[tuple[str, ValidDesign]], level: int
    ) -> AsyncGenerator[Any]:
        """The plate, and maps and numbers of each stage. The first map is computed
        while the plate is drawn."""
        full = named(design, others)
        every = [dict(stages(self._shelf, other, level)) for _, other in others]
        plate = True
        for name, stage_design in stages(self._shelf, design, level):
            at = [
                (label, by_stage.get(name, by_stage["full"]))
                for (label, _), by_stage in zip(others, every, strict=True)
            ]
            designs = named(stage_design, at)
            maps = asyncio.ensure_future(
                self._jobs.compute(_STAGES[name], partial(self._answers.maps, name, designs, full, level))
            )
            try:
                if plate:
                    yield await run_in_threadpool(self._answers.plate, design)
                    plate = False
                told = await maps
                level = level if told["level"] is None else told["level"]
                yield told
            finally:
                maps.cancel()
            yield await self._jobs.compute(_STAGES[name], partial(self._answers.numbers, designs))

    async def change(self, asked: Tables) -> Any:
        design, _ = self._designs(asked)
        layer, what, value = _whole(asked, "layer", 0, 64), str(asked.get("what", "")), str(asked.get("value", ""))
        return await run_in_threadpool(changed, design, self._shelf, what, layer, value)

    async def open(self, asked: Tables) -> Any:
        """The tables of a campaign file that the browser has read."""
        text = str(asked.get("text", ""))
        return self._shelf.checked(parsed(text, str(asked.get("name", "file"))[:80])).tables

    async def trajectory(self, asked: Tables) -> Any:
        design, _ = self._designs(asked)
        return await self._jobs.compute(_CLICK, partial(self._answers.trajectory, design, *_hit(asked)))

    async def figure(self, asked: Tables) -> Any:
        design, _ = self._designs(asked)
        name = str(asked.get("figure", ""))
        return await self._jobs.compute(_CLICK, partial(self._answers.figure, design, *_hit(asked), name))

    async def report(self, asked: Tables) -> Any:
        designs = named(*self._designs(asked))
        return {"html": await self._jobs.compute(_CLICK, partial(self._answers.report, designs))}

    def _designs(self, asked: Tables) -> tuple[ValidDesign, list[tuple[str, ValidDesign]]]:
        """The design in a request, and the designs to compare with."""
        pins = asked.get("pins", [])
        if not isinstance(pins, list) or len(pins) > _MOST_PINS or not all(isinstance(pin, dict) for pin in pins):
            raise CampaignError(f"pins: got {quoted(pins)}, but it must be a list of at most {_MOST_PINS} designs")
        others = [(str(pin.get("name", ""))[:80], self._shelf.checked(pin.get("design", {}))) for pin in pins]
        return self._shelf.checked(asked.get("design", {})), others


async def _file(request: Request) -> Response:
    name = request.path_params["name"]
    if name == "plotly.js":
        return Response(_PLOTLY(), media_type="text/javascript")
    room = next((room for room, names in _FILES.items() if name in names), None)
    if room is None:
        raise HTTPException(404)
    text = files(f"warpimpact.{room}").joinpath(name).read_text(encoding="utf-8")
    return Response(text, media_type="text/css" if name.endswith("css") else "text/javascript")


async def _nothing_there(request: Request, error: Exception) -> Response:
    return PlainTextResponse(
        "There is nothing at this address. Each start of warpimpact design has another token and prints its address; "
        "warpimpact design 'ADDRESS' opens the design of an old one.",
        status_code=404,
    )


def _check_origin(request: Request) -> None:
    if request.headers.get("origin") != f"http://{request.headers['host']}":
        raise HTTPException(403, "Only the page itself may request this.")


async def _asked(request: Request) -> Tables:
    """The content of a request as tables.

    Raises:
        CampaignError: it is no JSON, too long or nested too deep.
    """
    body = b""
    async for chunk in request.stream():
        body += chunk
        if len(body) > _MOST_BYTES:
            raise CampaignError(f"got a request of more than {_MOST_BYTES} bytes")
    try:
        text = body.decode()
    except UnicodeDecodeError:
        raise CampaignError("got a request that is no text") from None
    if not text.startswith("{"):
        raise CampaignError("got a request that is no JSON object")
    return parsed(text, "request")


async def _answered(answer: Callable[[Tables], Awaitable[Any]], request: Request) -> Response:
    """The answer as JSON, or a sentence for a mistake. Closing the connection cancels the work."""
    _check_origin(request)
    try:
        asked = await _asked(request)
        work, gone = asyncio.ensure_future(answer(asked)), asyncio.ensure_future(_gone(request))
        try:
            await asyncio.wait({work, gone}, return_when=asyncio.FIRST_COMPLETED)
            if not work.done():
                return PlainTextResponse("", status_code=499)
            return PlainTextResponse(as_json(work.result()), media_type="application/json")
        finally:
            gone.cancel()
            work.cancel()
    except Exception as error:
        return JSONResponse({"sentence": _sentence(error)}, status_code=422)


async def _gone(request: Request) -> None:
    """Return when the connection of a request is closed."""
    while (await request.receive())["type"] != "http.disconnect":
        pass


def _refused(error: Exception) -> str:
    return as_json({"kind": "refused", "sentence": _sentence(error)}) + "\n"


def _sentence(error: Exception) -> str:
    """The sentence for an error on the page. The details of a bug go to the terminal."""
    if isinstance(error, _MISTAKES):
        return str(error).removeprefix("design: ") or "not enough memory"
    traceback.print_exception(error)
    return f"This is a bug of warpimpact; the terminal has its details. {type(error).__name__}: {str(error)[:200]}"


def _whole(asked: Tables, key: str, least: int, most: int) -> int:
    """A whole number in a request; `least` if it is not given."""
    value = asked.get(key, least)
    if not isinstance(value, int) or isinstance(value, bool) or not least <= value <= most:
        raise CampaignError(f"{key}: got {quoted(value)}, but it must be a whole number from {least} to {most}")
    return value


def _hit(asked: Tables) -> tuple[int, str, int]:
    """Level, stage and number of the hit in a request."""
    return _whole(asked, "level", 0, 9), str(asked.get("stage", "full")), _whole(asked, "hit", 0, 2**30)


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


def serve(
    shelf: Shelf,
    *,
    port: int = 0,
    device: str = "auto",
    ready: Callable[[str], object],
    entered: Callable[[], object] = lambda: None,
) -> None:
    """Serve the page until a signal ends it.

    Args:
        ready: called with the address of the page.
        entered: called whenever a browser gets the page.

    Raises:
        OSError: the port is taken.
    """
    with socket.create_server(("127.0.0.1", port)) as listening:
        token, port = secrets.token_urlsafe(18), listening.getsockname()[1]
        server = server_of(application(shelf, token=token, device=device, entered=entered))
        ready(f"http://127.0.0.1:{port}/{token}/")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", Implausible)  # the page shows these
            server.run(sockets=[listening])
