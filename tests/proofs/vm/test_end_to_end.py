"""From a film of the liner to points: through the kernel, the driver, the daemon, HTTP and the file."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from grabberd.archive.capture.reader import CaptureReader
from proofs.vm import film
from proofs.vm.guest import daemon, vivid
from proofs.vm.machine import Machine
from proofs.vm.tables import Tables

FIELDS = 100
MIN_FIELDS = FIELDS // 2
"""Enough to judge points by: a machine that is short of time loses fields, and its ledger says so."""
RMS_MM, WORST_MM = 0.11, 1.0
"""Of a single field of one bit; a point further off has another target's id."""


def test_points_of_a_capture_over_http_lie_near_the_truth_of_the_film(fast: Machine, tables: Tables) -> None:
    film.render(fast.share / "film")
    fast.call(vivid.load_loop)
    result = fast.call(
        daemon.captured_liner, film="/share/film", fields=FIELDS, target="/share/liner.grab", timeout_s=600
    )
    capture, device = result["capture"], result["device"]
    ledger = capture["ledger"]
    assert capture["state"] == "sealed", capture
    assert capture["verdict"] == ("complete" if ledger["complete"] else "incomplete"), capture
    assert sum(ledger["counts"].values()) == FIELDS, ledger
    assert device["stream"]["details"]["kernel driver"] == "vivid"
    errors_mm = _errors_mm(fast.share / "liner.grab", ledger)
    rms_mm, worst_mm = float(np.sqrt((errors_mm**2).mean())), float(errors_mm.max())
    tables.add(
        "End to end",
        "Rendered pictures of the liner, fed into the test device and captured from it over HTTP.",
        fields=FIELDS,
        ledger=ledger["in_words"],
        points=len(errors_mm),
        RMS_mm=f"{rms_mm:.3f}",
        worst_mm=f"{worst_mm:.2f}",
    )
    assert len(errors_mm) > 60 * ledger["counts"]["received"]
    assert rms_mm < RMS_MM
    assert worst_mm < WORST_MM


def _errors_mm(path: Path, ledger: dict[str, Any]) -> np.ndarray:
    """Distances of all points from their targets at the fields that the pictures' stamps name."""
    with CaptureReader(path) as reader:
        stamps = film.stamps(reader)
        assert len(stamps) == ledger["counts"]["received"] >= MIN_FIELDS, "every picture bears its number"
        if ledger["complete"]:
            numbers = [stamp.number for stamp in stamps.values()]
            assert set(np.diff(numbers) % film.FIELDS) == {1}, (
                "complete means that no picture of the film is missing"
            )
        return film.errors_mm(reader, stamps)


@pytest.fixture(autouse=True)
def _stop_playing(fast: Machine) -> object:
    yield
    fast.call(vivid.unload)
