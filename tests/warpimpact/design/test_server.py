"""Whom the page answers, what it reads, which job goes first, and when its work ends."""

import asyncio
import http.client
import json
import os
import re
import socket
import stat
import subprocess
import sys
import threading
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any, get_args
from urllib.parse import urlsplit

import pytest
import xarray

from warpimpact.catalogue.catalogue import Catalogue
from warpimpact.catalogue.entries import Threat
from warpimpact.design import designs as page
from warpimpact.design.designs import SHAPES, DesignStore, apply_change, read_designs, stages
from warpimpact.design.server import JobQueue
from warpimpact.errors import CampaignError
from warpimpact.records import attributes as attr
from warpimpact.results import files
from warpimpact.scene import AnyPattern
from warpimpact.scene.input_files import input_file
from warpimpact.scene.model import Model
from warpimpact.solver import marching as solver
from warpimpact.solver.device import Cancel

CAMPAIGNS = Path(__file__).parents[3] / "campaigns"


def posted(address: str, path: str, text: str | None, **headers: str) -> http.client.HTTPConnection:
    """A connection with a request of the page itself, unless headers say otherwise."""
    place = urlsplit(address)
    connection = http.client.HTTPConnection(place.hostname, place.port, timeout=600)
    sent = {"Host": place.netloc, "Origin": f"http://{place.netloc}"} | headers
    sent = {name: value for name, value in sent.items() if value}
    connection.request("GET" if text is None else "POST", f"{place.path}{path}", text, sent)
    return connection


def request(address: str, path: str = "", body: Any = None, **headers: str) -> tuple[int, str]:
    """Status and text of an answer."""
    text = body if body is None or isinstance(body, str) else json.dumps(body)
    response = posted(address, path, text, **headers).getresponse()
    return response.status, response.read().decode()


def compute(address: str, design: Any) -> list[dict[str, Any]]:
    status, text = request(address, "compute", {"design": design})
    assert status == 200
    return [json.loads(line) for line in text.splitlines()]


def tables_of(path: Path) -> dict[str, Any]:
    return tomllib.loads(path.read_text())


@pytest.fixture(scope="module")
def address(serve: Callable[..., str], small: Path) -> str:
    return serve(small)


def test_every_shape_of_a_hole_is_offered() -> None:
    patterns, *_ = get_args(AnyPattern)
    shapes = {shape for one in get_args(patterns) for shape in get_args(one.model_fields["shape"].annotation)}
    assert set(SHAPES) == shapes - {"polygons"}


@pytest.mark.parametrize(
    ("given", "path", "status"),
    [
        ({}, "", 200),
        ({"Host": "evil.example"}, "", 400),
        ({"Origin": "http://evil.example", "body": {}}, "compute", 403),
        ({"Origin": "", "body": {}}, "compute", 403),
        ({"body": {}}, "compute", 200),
        ({}, "files/plotly.min.js", 200),
        ({}, "files/server.py", 404),
    ],
)
def test_it_answers_its_own_page_alone(address: str, given: dict[str, Any], path: str, status: int) -> None:
    assert request(address, path, **given)[0] == status


def test_the_browser_is_opened_on_a_file_that_only_its_owner_reads(small: Path, tmp_path: Path) -> None:
    """The words with which a program is started are seen by every user of the machine."""
    script, words, home = tmp_path / "browser", tmp_path / "words", tmp_path / "home"
    script.write_text(f'#!/bin/sh\necho "$@" > {words}.new && mv {words}.new {words}\n')
    script.chmod(0o700)
    home.mkdir()
    command = [sys.executable, "-m", "warpimpact", "design", str(small), "--device", "cpu"]
    environment = os.environ | {"HOME": str(home), "BROWSER": f"{script} %s"}
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True, env=environment) as process:
        try:
            assert process.stdout is not None
            address = process.stdout.readline().strip()
            while not words.exists() and process.poll() is None:
                time.sleep(0.05)
            (file,) = home.glob("*.html")
            assert words.read_text().strip() == file.as_uri()
            assert len(urlsplit(address).path) > 20
            assert stat.S_IMODE(file.stat().st_mode) == 0o600
            assert f"url={address}" in file.read_text()
        finally:
            process.terminate()
            process.wait()
    assert not file.exists()


@pytest.mark.parametrize(
    ("body", "sentence"),
    [
        ("[" * 100_000, "got"),
        ('{"design": ' + '{"a": ' * 10_000, "got"),
        ("{" + " " * 2**20 + "}", "more than 1048576 bytes"),
        ({"design": 3}, "it must be a table"),
        ({"design": {"title": None}}, "got null"),
        ({"design": {}, "level": 99}, "level: got 99"),
        ({"design": {"catalogue": "/etc/passwd"}}, 'catalogue: got "/etc/passwd", but a page reads only files that'),
    ],
)
def test_what_makes_no_sense_is_refused_in_a_sentence(address: str, body: Any, sentence: str) -> None:
    status, text = request(address, "compute", body)
    assert status == 200
    assert json.loads(text)["kind"] == "refused"
    assert sentence in json.loads(text)["sentence"]


def test_who_leaves_amid_a_request_is_no_bug(address: str, capfd: pytest.CaptureFixture[str]) -> None:
    place = urlsplit(address)
    head = f"POST {place.path}compute HTTP/1.1\r\nHost: {place.netloc}\r\nOrigin: http://{place.netloc}\r\n"
    with socket.create_connection((str(place.hostname), int(place.port or 0))) as connection:
        connection.sendall(f'{head}Content-Length: 1000\r\n\r\n{{"design": '.encode())
        time.sleep(0.2)
    assert request(address)[0] == 200
    assert capfd.readouterr() == ("", "")


def test_every_key_that_names_a_file_is_known() -> None:
    def models(base: type[Model]) -> list[type[Model]]:
        return [base, *(inner for one in base.__subclasses__() for inner in models(one))]

    named = {
        name
        for model in models(Model)
        if model.__module__.startswith(("warpimpact.campaign", "warpimpact.scene"))  # others are no campaigns
        for name, field in model.model_fields.items()
        if any(getattr(mark, "func", None) is input_file for mark in field.metadata) or "Path" in str(field.annotation)
    }
    assert {"file", "catalogue"} <= named <= set(page.FILE_KEYS)


def test_a_page_reads_the_files_of_its_campaigns(small: Path, tmp_path: Path) -> None:
    path, (hits, other) = tmp_path / "listed.toml", (tmp_path / "hits.csv", tmp_path / "other.csv")
    for file in (hits, other):
        file.write_text("hit_y,hit_z\n0,0\n0.001,0.002\n")
    text = small.read_text().replace('sampling = "sobol" ', 'sampling = "list"\nfile = "hits.csv" #')
    path.write_text(text.replace("count = 1500", "#"))
    store = DesignStore(read_designs([path]))
    tables = store.designs["listed"]
    assert tables["hits"]["file"] == str(hits)
    assert list(stages(store, store.checked(tables), 0)) == ["first", "draft", "full"]
    tables["hits"]["file"] = str(other)
    with pytest.raises(CampaignError, match="a page reads only files that the campaigns name"):
        store.checked(tables)


def test_behind_a_base_no_stage_bounds_single_hits() -> None:
    store = DesignStore(read_designs([CAMPAIGNS / "addon.toml"]))
    for name, stage in stages(store, store.checked(store.designs["addon"]), 0).items():
        numerics = stage.campaign.numerics
        assert (name == "first") == (numerics.explicit is not None)
        assert name == "first" or numerics.required_at(2).bounds_answer


def test_stages_go_from_few_hits_to_the_campaign(address: str, small: Path) -> None:
    plate, *lines = compute(address, tables_of(small))
    assert [line["kind"] for line in lines] == ["maps", "numbers"] * 3
    computed = lines[::2]
    assert plate["plate"]["numbers"]["open area"] == "34.8%"
    assert [(line["stage"], line["hits"]) for line in computed] == [("first", 256), ("draft", 1024), ("full", 1500)]
    sentences = ("is not known", "within the tolerance of draft", "within the tolerance of standard")
    assert [words in line["numerics"] for words, line in zip(sentences, computed, strict=True)] == [True] * 3


@pytest.mark.usefixtures("coarse_elements")
def test_elements_follow_the_fast_answer(serve: Callable[..., str], small: Path, tmp_path: Path) -> None:
    path = tmp_path / "aluminium.toml"
    thin = small.read_text().replace("count = 1500", "count = 96").replace('thickness = "4 mm"', 'thickness = "2.4 mm"')
    elements = 'materials = ["AA6082-T6"]\nspacing = "0.6 mm"\nhits = 6'
    path.write_text(re.sub("materials = .*", elements, thin))
    address, design = serve(path), tables_of(path)
    maps = [line for line in compute(address, design) if line["kind"] == "maps"]
    assert [(line["stage"], line["following"]) for line in maps[-2:]] == [("full", "elements"), ("elements", "")]
    assert [len(line["data"]["results"][0]["elements"]) for line in maps[-2:]] == [0, 6]
    status, text = request(address, "report", {"design": design, "stage": "elements"})
    assert status == 200
    assert "6 hits by elements" in json.loads(text)["html"]


def test_elements_that_a_campaign_cannot_have_are_named(small: Path) -> None:
    store = DesignStore(read_designs([small]))
    wanted = store.checked(store.designs["small"] | {"continuum": {"hits": 6}})
    assert list(stages(store, wanted, 0)) == ["first", "draft", "full"]
    assert "plate.material: not given" in page.elements_refusal(wanted.campaign)


def test_who_leaves_ends_the_work(address: str, small: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    tables = tables_of(small)
    tables["hits"]["count"] = 2**18
    running, march = list[Cancel](), solver.march

    def marching(memory: Any, worker: Any, progress: Any) -> Any:
        running.append(worker.cancel)
        outcomes = march(memory, worker, progress)
        running.remove(worker.cancel)
        return outcomes

    monkeypatch.setattr(solver, "march", marching)
    connection = posted(address, "compute", json.dumps({"design": tables}))
    response = connection.getresponse()
    for _ in range(5):  # plate; maps and numbers of two stages
        response.readline()
    while (last := next(iter(running), None)) is None:  # of the last stage, which takes minutes
        time.sleep(0.01)
    response.close()
    connection.close()
    compute(address, tables | {"title": "another", "hits": tables["hits"] | {"count": 256}})
    assert last.cancelled


@pytest.mark.parametrize("shape", SHAPES)
def test_another_shape_is_a_valid_plate_of_the_same_open_area(small: Path, shape: str) -> None:
    store = DesignStore(read_designs([small]))
    design = store.checked(store.designs["small"])
    campaign = store.checked(apply_change(design, store, "shape", 0, shape)).campaign
    assert campaign.plate.open_area == pytest.approx(0.0 if shape == "none" else 0.348, abs=0.06)


def test_threats_materials_and_layers_can_be_chosen(small: Path) -> None:
    store = DesignStore(read_designs([small]))
    design = store.checked(store.designs["small"])
    named = [("threat", ".30 AP M2"), ("material", "AA2060-T8"), ("add layer", "")]
    for what, name in [*named, ("threat", ""), ("material", "")]:
        before = design.campaign
        design = store.checked(apply_change(design, store, what, 0, name))
        if not name and what != "add layer":  # own values are those of the catalogue
            assert design.campaign.core.mass_properties == before.core.mass_properties
            assert design.campaign.impact == before.impact
        if what == "material" and not name:
            assert design.campaign.plate.resistance == pytest.approx(before.plate.resistance, rel=1e-5)
    assert design.campaign.core.mass == pytest.approx(5.3e-3)
    assert len(design.campaign.layer) == 1
    assert design.campaign.impact.velocity == Catalogue().all(Threat)[".30 AP M2"].velocities[0].value
    assert store.checked(apply_change(design, store, "remove layer", 1, "")).campaign.layer == ()


def test_a_page_has_every_design_of_its_files(
    small: Path, make_result: Callable[..., Any], searched: xarray.Dataset, tmp_path: Path
) -> None:
    text, search, result = small.read_text(), tmp_path / "front.nc", tmp_path / "slotted.nc"
    names, texts = ["design_00.toml", "design_01.toml"], [text, text.replace("4 mm", "5 mm")]
    variables = {"front_file": ("front", names), "front_campaign": ("front", texts)}
    files.write(searched.isel(front=[0, 0]).assign(variables), search)
    files.write(make_result().assign_attrs({attr.CAMPAIGN: text}), result)
    designs = read_designs([CAMPAIGNS / "two_plates.toml", search, result])
    assert list(designs) == ["slots", "round holes", "design_00", "design_01", "slotted"]
    assert [one["plate"]["thickness"] for one in designs.values()] == ["4 mm", "4 mm", "4 mm", "5 mm", "4 mm"]


def wait(cancel: Cancel, event: threading.Event) -> None:
    """Work until an event or until it is cancelled."""
    while not event.wait(0.001):
        cancel.check()


def test_an_urgent_job_puts_off_one_that_refines_which_then_ends() -> None:
    order, go = list[str](), threading.Event()

    def refine(cancel: Cancel) -> str:
        order.append("refine")
        wait(cancel, go)
        return "done"

    def urgent(_: Cancel) -> str:
        order.append("urgent")
        go.set()
        return "at once"

    async def both() -> list[str]:
        jobs = JobQueue()
        slow = asyncio.ensure_future(jobs.compute(refine, refines=True))
        while not order:
            await asyncio.sleep(0.001)
        return [await jobs.compute(urgent), await slow]

    assert asyncio.run(both()) == ["at once", "done"]
    assert order == ["refine", "urgent", "refine"]


@pytest.mark.parametrize("refines", [False, True])
def test_what_nobody_awaits_ends(refines: bool) -> None:
    begun, ended = list[str](), list[str]()

    def endless(cancel: Cancel) -> None:
        begun.append("endless")
        try:
            wait(cancel, threading.Event())
        finally:
            ended.append("endless")
            raise ZeroDivisionError  # an error that nobody awaits stops no queue

    async def left() -> None:
        jobs = JobQueue()
        job, waiting = (asyncio.ensure_future(jobs.compute(endless, refines=refines)) for _ in range(2))
        while not begun:
            await asyncio.sleep(0.001)
        for one in (job, waiting):
            one.cancel()
        await jobs.compute(lambda _: None)

    asyncio.run(left())
    assert begun == ended == ["endless"]
