"""Results made by hand: shots and outcomes whose values a test knows."""

import json
import shutil
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import netCDF4
import numpy as np
import pytest
import xarray
from matplotlib.figure import Figure

from warpimpact import Plate, Record, Scene
from warpimpact.continuum import one_hit
from warpimpact.kernels.status import Status
from warpimpact.measures import draws
from warpimpact.measures.references import with_nodes
from warpimpact.records.kinds import HIT_MAP
from warpimpact.records.outcomes import Outcomes
from warpimpact.records.variables import SHOT_VARIABLES
from warpimpact.results.dataset import to_dataset
from warpimpact.runs import compute, store
from warpimpact.scene import AnyPattern, ConeCore, SquarePattern

from ..verification.scenes import shots_at

STANDOFFS = np.array([0.05, 0.13])
PERIOD = (16e-3, 8e-3)
SQUARE_HOLE = SquarePattern(side=4e-3, spacing=PERIOD)
CYLINDER = ConeCore(diameter="6 mm", length="20 mm", cone_length="1 nm", mass="4 g")

FEW_DRAWS = 16
"""Draws of an answer in tests."""
ResultMaker = Callable[..., xarray.Dataset]


def scattered_hits(count: int) -> np.ndarray:
    """Hit points over the unit cell [m], shape (count, 2)."""
    return (np.random.default_rng(5).random((count, 2)) - 0.5) * PERIOD


def outcomes_of(status: np.ndarray) -> Outcomes:
    """Outcomes that differ from hit to hit; NaN where a status has no value."""
    n = len(status)
    ramp = np.linspace(0.1, 1.0, n)
    moves = np.isin(status, [Status.PERFORATED, Status.UNTOUCHED, Status.RICOCHETED])
    behind = np.isin(status, [Status.PERFORATED, Status.UNTOUCHED])[:, None]
    angles = np.where(behind, ramp[:, None] * [0.5, 1.5], np.nan)
    return Outcomes(
        status=status.astype(np.int8),
        residual_velocity=np.where(moves, 700.0 + 100.0 * ramp, 0.0),
        deflection=np.where(moves, 0.1 * ramp, np.nan),
        angular_velocity=np.stack([0.0 * ramp, 1e3 * ramp, -2e3 * ramp], axis=-1),
        energy_loss=400.0 * ramp,
        contact_duration=5e-5 * ramp,
        tilt=angles,
        pitch=angles - 0.2,
        yaw=0.2 - angles,
        total_yaw=angles,
        exit_velocity=np.stack([600.0 * ramp, 10.0 * ramp, -20.0 * ramp], axis=-1),
        exit_axis=np.stack([1.0 + 0.0 * ramp, 0.0 * ramp, 0.0 * ramp], axis=-1),
        exit_position=np.stack([0.02 + 0.0 * ramp, 1e-3 * ramp, -1e-3 * ramp], axis=-1),
    )


@pytest.fixture
def make_result() -> ResultMaker:
    """A function of status (or of a count of perforating hits) that builds the Dataset."""

    def make(
        status: Any = 4, hits: np.ndarray | None = None, pattern: AnyPattern = SQUARE_HOLE, double: bool = False
    ) -> xarray.Dataset:
        status = np.zeros(status, np.int8) if np.ndim(status) == 0 else np.asarray(status)
        hits = scattered_hits(len(status)) if hits is None else hits
        plate = Plate(thickness=4e-3, resistance=2.6e9, pattern=pattern)
        scene = Scene(core=CYLINDER, target=plate, record=Record(standoffs=tuple(STANDOFFS)))
        return to_dataset(
            scene,
            shots_at(*hits.T, obliquity=30.0, azimuth=90.0, pitch=-1.0, yaw=2.0, spin=1.7e4),
            outcomes_of(status),
            period=PERIOD,
            attributes={
                "title": "a test",
                "history": "2026-01-01T00:00:00Z",
                "campaign": json.dumps({"plate": plate.model_dump(mode="json")}),
                "seed": 7,
            },
            double=double,
        )

    return make


def plate_result(
    velocity: np.ndarray,
    tilt: np.ndarray | float = 0.0,
    status: np.ndarray | int = Status.PERFORATED,
    **message: object,
) -> xarray.Dataset:
    """What measures and comparisons take of a result: cylinders of 1000 m/s with these residual velocities [m/s], tilts
    at 130 mm [degree] and ends."""
    hits = len(velocity)
    columns = {name: np.zeros(hits) for name in SHOT_VARIABLES} | {
        "status": np.full(hits, status, dtype=np.int8),
        "impact_velocity": np.full(hits, 1000.0),
        "residual_velocity": velocity,
        "mass": np.full(hits, CYLINDER.mass_properties.mass),
    }
    tilts = np.stack([np.zeros(hits), np.broadcast_to(tilt, hits)], axis=1)
    places, angles = np.linspace(-0.5, 0.5, hits), np.linspace(0.0, 90.0, 361)
    areas = "inclination", CYLINDER.presented_area(np.radians(angles))
    return xarray.Dataset(
        {name: ("hit", values) for name, values in columns.items()} | {"tilt": (("hit", "standoff"), tilts)},
        {
            "standoff": STANDOFFS,
            "hit_y": ("hit", places * PERIOD[0]),
            "hit_z": ("hit", places * PERIOD[1]),
            "inclination": angles,
            "presented_area": areas,
        },
        {
            "warpimpact_kind": HIT_MAP.mark,
            "standoff_point": "nose",
            "plate_period": PERIOD,
            "areal_density": 23.55,
            "open_area": 0.25,
            "numerics_given": '{"fidelity": "draft", "time_step": null}',
        }
        | message,
    )


def with_draws(dataset: xarray.Dataset, velocity: np.ndarray, **columns: np.ndarray) -> xarray.DataTree:
    """An answer: a result whose hits have these residual velocities [m/s] in each draw, shape [draws, hits]; 0 is that
    of a core that is stopped. Its root has the share that passes, and the mean velocity of those that do."""
    is_passed = velocity > 0.0
    status = np.where(is_passed, Status.PERFORATED, Status.ARRESTED).astype(np.int8)
    tilt = np.broadcast_to(dataset["tilt"].values, (*velocity.shape, len(STANDOFFS)))
    by_draw = {"status": status, "residual_velocity": velocity, **columns}
    draws = xarray.Dataset(
        {name: (("draw", "drawn_hit"), values) for name, values in by_draw.items()}
        | {"tilt": (("draw", "drawn_hit", "standoff"), tilt)},
        {"drawn_hit": np.arange(velocity.shape[1])},
    )
    mean = np.where(is_passed.any(axis=0), velocity.sum(axis=0) / np.maximum(1, is_passed.sum(axis=0)), 0.0)
    law = dataset[["status", "residual_velocity", "tilt"]].drop_vars(list(dataset.coords), errors="ignore")
    root = dataset.assign(residual_velocity=("hit", mean), perforated=("hit", is_passed.mean(axis=0)))
    root["status"] = (
        "hit",
        np.where(is_passed.mean(axis=0) >= 0.5, Status.PERFORATED, Status.ARRESTED).astype(np.int8),
    )
    return with_nodes(root, {"law": law, "draws": draws})


def drawn_result(velocity: np.ndarray) -> xarray.DataTree:
    """A result with these residual velocities in its draws, in which all cores pass, shape [draws, hits]."""
    dims, hits = ("draw", "drawn_hit"), np.arange(velocity.shape[1])
    columns = {"status": np.zeros(velocity.shape, np.int8), "residual_velocity": velocity}
    draws = xarray.Dataset({name: (dims, values) for name, values in columns.items()}, {"drawn_hit": hits})
    return with_nodes(plate_result(velocity.mean(axis=0)).assign_coords(hit=hits), {"draws": draws})


@pytest.fixture(scope="session")
def make_plate_result() -> ResultMaker:
    """The function above."""
    return plate_result


@pytest.fixture(scope="session")
def make_answer() -> Callable[..., xarray.DataTree]:
    """The function `with_draws`."""
    return with_draws


def _assert_same_bits(one: Path, other: Path) -> None:
    """Compare two files variable by variable, as stored."""
    with netCDF4.Dataset(one) as a, netCDF4.Dataset(other) as b:
        assert a.variables.keys() == b.variables.keys()
        for name, variable in a.variables.items():
            variable.set_auto_maskandscale(False)
            b[name].set_auto_maskandscale(False)
            stored, other_stored = variable[...], b[name][...]
            if stored.dtype == object:  # strings, of which NumPy has the places in memory
                assert stored.tolist() == other_stored.tolist(), name
            else:
                assert stored.tobytes() == other_stored.tobytes(), name
            assert variable.dimensions == b[name].dimensions
            assert str(variable.__dict__) == str(b[name].__dict__)
        assert a.groups.keys() == b.groups.keys()
        for group in a.groups:
            for name, variable in a[group].variables.items():
                np.testing.assert_array_equal(variable[...], b[group][name][...], err_msg=name)


@pytest.fixture(scope="module")
def coarse_elements() -> Iterator[None]:
    """Hits end soundly whatever elements lose that are too coarse for a result."""
    with pytest.MonkeyPatch.context() as patched:
        for limit in ("LARGEST_IMBALANCE", "LARGEST_HOURGLASS_SHARE"):
            patched.setattr(one_hit, limit, 1.0)
        yield


@pytest.fixture(scope="session", autouse=True)
def few_draws() -> Iterator[None]:
    """Answers of so few draws that tests of other things do not wait for them."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(draws, "COUNT", FEW_DRAWS)
        yield


@pytest.fixture(scope="module")
def all_draws(few_draws: None) -> Iterator[None]:
    """As many draws as users get."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(draws, "COUNT", 128)
        yield


@pytest.fixture
def in_tmp_path(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """An empty folder, in which the test works."""
    monkeypatch.chdir(tmp_path)
    return tmp_path


@pytest.fixture
def unrendered(monkeypatch: pytest.MonkeyPatch) -> None:
    """Figures are laid out, and no picture is written."""

    def laid_out(figure: Figure, file: Path, **_: object) -> None:
        figure.draw_without_rendering()
        Path(file).touch()

    monkeypatch.setattr("matplotlib.figure.Figure.savefig", laid_out)


@pytest.fixture(scope="module")
def small_chunks() -> Iterator[None]:
    """Chunks as in small_chunks.py."""
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(compute, "FEWEST", 256)
        patched.setattr(store, "HELD_SECONDS", 0.0)
        yield


@pytest.fixture(scope="session")
def assert_same_bits() -> Callable[[Path, Path], None]:
    """A function of two result files."""
    return _assert_same_bits


@pytest.fixture(scope="session")
def browser() -> Iterator["Browser"]:
    programs = shutil.which("chromium"), shutil.which("chromedriver")
    if None in programs:
        pytest.skip("needs the programs chromium and chromedriver (Debian: chromium, chromium-driver)")
    browser = Browser(*programs)
    yield browser
    browser.driver.quit()


class Browser:
    """A headless Chromium."""

    def __init__(self, chromium: str, chromedriver: str) -> None:
        from selenium import webdriver

        options = webdriver.ChromeOptions()
        for argument in ("--headless=new", "--no-sandbox", "--disable-gpu", "--disable-dev-shm-usage"):
            options.add_argument(argument)
        options.binary_location = chromium
        options.set_capability("goog:loggingPrefs", {"browser": "ALL"})
        self.driver = webdriver.Chrome(options=options, service=webdriver.ChromeService(chromedriver))

    def open(self, address: str, width: int = 1280) -> None:
        self.driver.execute_cdp_cmd(
            "Emulation.setDeviceMetricsOverride",
            {"width": width, "height": 900, "deviceScaleFactor": 1, "mobile": width < 600},
        )
        self.driver.get("about:blank")
        self.errors()  # of the page before, whose server may have ended
        self.driver.get(address)

    def find(self, selector: str) -> list:
        return self.driver.find_elements("css selector", selector)

    def text(self, selector: str) -> str:
        return "\n".join(element.text for element in self.find(selector))

    def values(self, selector: str) -> list[str]:
        """Of form fields."""
        return [element.get_property("value") for element in self.find(selector)]

    def wait(self, condition: Callable[[], object], seconds: float = 300.0) -> None:
        from selenium.common.exceptions import StaleElementReferenceException
        from selenium.webdriver.support.ui import WebDriverWait

        drawn_anew = [StaleElementReferenceException]  # between finding an element and asking it
        waiting = WebDriverWait(self.driver, seconds, poll_frequency=0.05, ignored_exceptions=drawn_anew)
        waiting.until(lambda _: condition())

    def press(self, selector: str) -> None:
        """Click the first of some elements, which the page may draw anew meanwhile."""
        self.wait(lambda: self.find(selector)[0].click() is None)

    def point_at(self, selector: str, right: float, down: float, *, click: bool = False) -> None:
        """Move to a place of an element, from its middle in shares of its width and height."""
        from selenium.webdriver.common.action_chains import ActionChains

        (place,) = self.find(selector)
        self.driver.execute_script("arguments[0].scrollIntoView({block: 'center'})", place)
        offset = round(right * place.size["width"]) - 2, round(down * place.size["height"])
        action = ActionChains(self.driver).move_to_element_with_offset(place, *offset)
        action = action.pause(0.2).move_by_offset(2, 0).pause(0.2)
        (action.click() if click else action).perform()

    def errors(self) -> list[str]:
        return [entry["message"] for entry in self.driver.get_log("browser") if entry["level"] in ("SEVERE", "WARNING")]


SEARCHED = """
title = "plates"
core = { shape = "cone", diameter = "6 mm", length = "20 mm", cone_length = "8 mm", mass = "4 g" }
impact = { velocity = "825 m/s" }
numerics = { level = 0 }
plate = { thickness = "4 mm", resistance = "2600 MPa" }
objectives = [{ measure = "areal_density" }, { measure = "mean(residual_energy_fraction)" }]
search = { designs = 6, hits = 16, confirm_hits = 64 }
[[references]]
name = "published"
[references.plate]
thickness = "3 mm"
resistance = "2600 MPa"
pattern = { shape = "circle", diameter = "4 mm", spacing = "8 mm" }
[variables]
thickness = ["2 mm", "3 mm", "4 mm"]
[[variables."plate.pattern"]]
name = "holes"
shape = "circle"
diameter = "5 mm"
spacing = "8 mm"
[[variables."plate.pattern"]]
name = "solid"
shape = "none"
"""


@pytest.fixture(scope="session")
def searched() -> xarray.Dataset:
    """A small search for designs, with its front."""
    from warpimpact.optimisation.design import design_from
    from warpimpact.optimisation.optimise import optimise

    return optimise(design_from(SEARCHED, "design", Path()))
