"""A run in memory that another thread ends."""

import threading
from pathlib import Path

import pytest

from warpimpact.campaign.campaign import Campaign
from warpimpact.runs.run import run
from warpimpact.solver.worker import Cancel, Cancelled

SLOTTED_PLATE = Path(__file__).parents[3] / "campaigns" / "slotted_plate.toml"


def test_a_run_ends_when_it_is_cancelled() -> None:
    cancel = Cancel()
    threading.Timer(1.0, cancel.cancel).start()
    with pytest.raises(Cancelled):
        run(Campaign.from_toml(SLOTTED_PLATE, count=2**18), device="cpu", progress=lambda _: None, cancel=cancel)
