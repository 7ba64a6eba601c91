"""Drivers of real grabbers, before emulated ones: what the ledger says, judged by the truth in each row."""

import random
import subprocess
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np
import pytest

from grabberd.archive.capture.reader import CaptureReader
from proofs.vm import film
from proofs.vm.guest import emulated, grabbers, shell, vivid
from proofs.vm.image import CHECKOUT
from proofs.vm.machine import Machine
from proofs.vm.tables import Tables
from proofs.vm.usb.faults import Fault

CONFIGS = CHECKOUT / "configs"
NOTE = (
    "Emulated on the bus (USB/IP), programmed and read by Debian's own drivers. Each row of a picture has "
    "the number of the camera's field. Unseen: fields that are called received, though a row is of another "
    "one. Spared: intact fields that are called otherwise, since the driver does not tell which are."
)
USBTV: dict[str, list[list[Any]]] = {
    "one chunk of the first field": [[0, Fault.LOST, 100]],
    "one packet of the first field": [[0, Fault.LOST, 99, 3]],
    "20 chunks of the first field": [[0, Fault.LOST, 100, 20]],
    "one packet of the second field": [[1, Fault.LOST, 99, 3]],
    "the last chunk of the second field": [[1, Fault.LOST, -1]],
    "a chunk's head": [[0, Fault.GARBLED, 50]],
    "a first field": [[0, Fault.FIELD]],
    "a second field": [[1, Fault.FIELD]],
    "a frame": [[0, Fault.FIELD], [1, Fault.FIELD]],
    "a burst over the boundary of fields": [[0, Fault.LOST, -1], [1, Fault.LOST, 0]],
    "a burst over the boundary of frames": [[1, Fault.LOST, -1], [2, Fault.LOST, 0]],
    "the number of the frame before": [[0, Fault.REPEATED_ID]],
    "the parity of the other field": [[0, Fault.SAME_PARITY]],
    "silence for .4 s": [[1, Fault.SILENCE, 0.4]],
}
STK1160: dict[str, list[list[Any]]] = {
    "one packet of the first field": [[0, Fault.LOST, 50]],
    "a packet of the first field, short": [[0, Fault.SHORT, 50, 100]],
    "one packet of the second field": [[1, Fault.LOST, 50]],
    "the mark of a first field": [[0, Fault.LOST, 0]],
    "the mark of a second field": [[1, Fault.LOST, 0]],
    "a first field": [[0, Fault.FIELD]],
    "a second field": [[1, Fault.FIELD]],
    "a frame": [[0, Fault.FIELD], [1, Fault.FIELD]],
    "a burst over the boundary of frames": [[1, Fault.LOST, -3, 3], [2, Fault.LOST, 0, 4]],
    "the parity of the other field": [[0, Fault.SAME_PARITY]],
    "silence for .4 s": [[1, Fault.SILENCE, 0.4]],
}
UVC: dict[str, list[list[Any]]] = {
    "one packet": [[0, Fault.LOST, 10]],
    "the first packet": [[0, Fault.LOST, 0]],
    "the last packet": [[0, Fault.LOST, -1]],
    "a packet, short": [[0, Fault.SHORT, 10, 100]],
    "a picture": [[0, Fault.FIELD]],
    "two pictures": [[0, Fault.FIELD], [1, Fault.FIELD]],
    "a burst over the boundary of pictures": [[0, Fault.LOST, -3, 3], [1, Fault.LOST, 0, 3]],
    "silence for .4 s": [[0, Fault.SILENCE, 0.4]],
}
CASES = {
    "usbtv": USBTV,
    "usbtv, 525 lines": USBTV,
    "stk1160": STK1160,
    "uvc, YUYV": UVC,
    "uvc, bulk": UVC,
    "uvc, MJPG": UVC,
}
UNDER_BOTH = ("usbtv", "stk1160", "uvc, YUYV", "uvc, MJPG")
RUNS = [(kind, "fast") for kind in CASES] + [(kind, "newer") for kind in UNDER_BOTH]


@contextmanager
def _plugged(machine: Machine, kind: str) -> Iterator[None]:
    machine.call(vivid.unload)
    found = machine.call(emulated.plug_in, kind=kind)
    assert "/dev/video0" in found["nodes"], found["kernel"]
    try:
        yield
    finally:
        machine.call(emulated.unplug, kind=kind)


@pytest.mark.parametrize(("kind", "machine"), RUNS)
def test_whatever_a_grabber_loses_no_row_of_another_field_is_received(
    kind: str, machine: str, request: pytest.FixtureRequest, tables: Tables
) -> None:
    guest = request.getfixturevalue(machine)
    kernel = ".".join(guest.call(shell.run, command="uname -r").split(".")[:2])
    with _plugged(guest, kind):
        found = _judged(guest, kind)
    for fault, about in found["cases"].items():
        tables.add_beside(
            "Grabbers",
            of="kernel",
            note=NOTE,
            driver=kind,
            lost_on_its_way=fault,
            kernel=kernel,
            ledger_says="; ".join(about["said"]) or "–",
            unseen=len(about["unseen"]),
            spared=about["spared"],
        )
    assert not found["skipped"], "the emulation was too slow to judge by"
    assert found["elsewhere"] == {"said": [], "unseen": [], "spared": 0}
    assert {fault: about["unseen"] for fault, about in found["cases"].items() if about["unseen"]} == {}
    assert all(about["spared"] <= 2 for about in found["cases"].values())


PARTS = {"usbtv": 432, "stk1160": 136, "uvc, MJPG": 20}
"""Parts of a field, about."""


@pytest.mark.parametrize("bad", PARTS)
def test_of_a_bad_cable_no_row_of_another_field_is_received(bad: str, fast: Machine) -> None:
    draw = random.Random(7)
    lost = [
        [at, Fault.LOST, draw.randrange(PARTS[bad]), draw.choice((1, 1, 1, 3, 20))]
        for at in range(300)
        if draw.random() < 0.2
    ]
    with _plugged(fast, bad):
        found = fast.call(grabbers.judged, kind=bad, cases=[("a bad cable", lost)])
    about = found["cases"]["a bad cable"]
    assert about["unseen"] == []
    assert about["spared"] < len(lost)


def _judged(machine: Machine, kind: str) -> Any:
    """Of three captures, the first in which nothing was lost but what was to be.

    While the guest waits for a page from a busy host's disk, its counted time leaps, and the emulation, which
    goes by that time, leaves fields out.
    """
    for _ in range(3):
        found = machine.call(grabbers.judged, kind=kind, cases=list(CASES[kind].items()))
        if not found["skipped"] and not found["elsewhere"]["said"]:
            break
    return found


@pytest.mark.parametrize(
    ("broken", "happens", "ends", "lasts_s"),
    [
        ("usbtv", ["cut"], ["in"], 2.0),
        ("uvc, YUYV", ["cut"], ["in"], 2.0),
        ("usbtv", ["reset"], [], 2.0),
        ("stk1160", ["reset"], [], 2.0),
        ("uvc, bulk", ["reset"], [], 2.0),
    ],
)
def test_a_device_that_goes_and_comes_back_is_accounted_for(
    broken: str, happens: list[Any], ends: list[Any], lasts_s: float, fast: Machine
) -> None:
    with _plugged(fast, broken):
        found = fast.call(grabbers.through, kind=broken, happens=happens, ends=ends, seconds=lasts_s)
    assert not found["unseen"]
    assert any("unplugged" in entry for entry in found["entries"]), found["entries"]
    assert found["after"] > 50


def test_while_a_decoder_answers_nothing_the_ledger_says_that_the_driver_hangs(fast: Machine) -> None:
    with _plugged(fast, "stk1160"):
        found = fast.call(
            grabbers.through, kind="stk1160", happens=["deaf", True], ends=["deaf", False], seconds=4.0
        )
    assert not found["unseen"]
    assert any("driver hung" in entry for entry in found["entries"]), found["entries"]
    assert found["after"] > 50


def test_a_grabber_that_needs_no_answers_loses_nothing_while_it_gives_none(fast: Machine) -> None:
    with _plugged(fast, "usbtv"):
        found = fast.call(
            grabbers.through, kind="usbtv", happens=["deaf", True], ends=["deaf", False], seconds=2.0
        )
    assert found["entries"] == found["unseen"] == []


def test_pictures_of_another_size_than_granted_are_damaged(fast: Machine) -> None:
    with _plugged(fast, "uvc, MJPG"):
        found = fast.call(
            grabbers.through, kind="uvc, MJPG", happens=["columns", 320], ends=["columns", 720], seconds=0.5
        )
    assert not found["unseen"]
    assert all("it has 320×480 pixels, not 720×480" in entry for entry in found["entries"]), found["entries"]
    assert found["entries"]


def test_a_camera_that_the_bus_has_put_to_sleep_wakes_up_for_a_capture(fast: Machine) -> None:
    with _plugged(fast, "uvc, YUYV"):
        found = fast.call(grabbers.asleep, kind="uvc, YUYV")
    assert found == {"entries": [], "received": 100}


@pytest.mark.parametrize("lying", ["uvc, of no columns", "uvc, at 10 MHz"])
def test_a_camera_that_claims_what_no_camera_has_is_unusable_and_refused(lying: str, fast: Machine) -> None:
    with _plugged(fast, lying):
        (found,) = fast.call(grabbers.found)
        causes = fast.call(grabbers.refused, kind=lying)
    assert found["verdict"] == "unusable"
    assert len(causes) == 1
    assert "it offers MJPG" in causes[0]


@pytest.mark.parametrize(
    ("starved", "words", "says"),
    [
        ("stk1160", ["bandwidth", False], "finds no bandwidth left on its USB bus"),
        ("uvc, YUYV", ["bandwidth", False], "does not respond properly (STREAMON"),
        ("uvc, of 100 bytes", [], "no field for"),
    ],
)
def test_a_device_that_cannot_start_is_named_and_the_daemon_stays_up(
    starved: str, words: list[Any], says: str, fast: Machine
) -> None:
    with _plugged(fast, starved):
        causes = fast.call(grabbers.refused, kind=starved, words=words)
    assert any(says in cause for cause in causes), causes


def test_before_a_dongle_pictures_are_inspected_a_rig_is_calibrated_and_a_liner_measured(
    fast: Machine, tables: Tables
) -> None:
    scenes = {"frame": film.CALIBRATION_FRAME, "liner": film.LINER}
    with _plugged(fast, "usbtv"):
        for name, scene in scenes.items():
            film.render(fast.share / f"{name}.film", scene)
            where = {"film": f"/share/{name}.film", "target": f"/share/{name}.grab"}
            lost = fast.call(grabbers.filmed, kind="usbtv", fields=100, bits=8, **where)
            assert lost == []
    frame, liner, calibration = (fast.share / name for name in ("frame.grab", "liner.grab", "rig.json"))
    seen = _grabberd("inspect", liner)
    assert "720 x 576 pixels" in seen
    assert "each field follows the one before" in seen
    targets, geometry = CONFIGS / "calibration-frames" / "paper-108.yaml", CONFIGS / "fake.yaml"
    _grabberd("calibrate", frame, "--calibration-frame", targets, "--config", geometry, "--out", calibration)
    _grabberd("measure", liner, "--calibration", calibration, "--object", CONFIGS / "objects" / "liner.yaml")
    with CaptureReader(liner) as reader:
        errors_mm = film.errors_mm(reader, film.stamps(reader))
    rms_mm, worst_mm = float(np.sqrt((errors_mm**2).mean())), float(errors_mm.max())
    tables.add(
        "Before a dongle",
        "Films of the calibration frame and of the liner before an emulated usbtv: captured at 8 bits in the "
        "machine, inspected, calibrated and measured outside of it.",
        fields=200,
        points=len(errors_mm),
        RMS_mm=f"{rms_mm:.3f}",
        worst_mm=f"{worst_mm:.2f}",
    )
    assert len(errors_mm) > 60 * 100
    assert rms_mm < 0.05
    assert worst_mm < 1.0


def _grabberd(*words: object) -> str:
    """What a command says, outside of the machine."""
    command = [sys.executable, "-c", "from grabberd.cli import main; main()", *map(str, words)]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def test_of_pictures_that_come_twice_each_is_received_once(fast: Machine) -> None:
    with _plugged(fast, "uvc, twice"):
        found = fast.call(grabbers.repeated, kind="uvc, twice")
    assert found["received"] == found["different"]
    assert found["damaged"] == {"repeated": pytest.approx(100, abs=2)}


def test_a_decoder_that_tells_of_a_missing_camera_is_believed(fast: Machine) -> None:
    with _plugged(fast, "stk1160"):
        found = fast.call(
            grabbers.through, kind="stk1160", happens=["signal", False], ends=["signal", True], seconds=1.0
        )
    assert found["entries"]
    assert all("no_signal (no signal" in entry for entry in found["entries"]), found["entries"]


def test_a_decoder_that_sees_a_camera_of_60_hz_is_believed(fast: Machine) -> None:
    with _plugged(fast, "stk1160"):
        assert "60 Hz" in fast.call(grabbers.opened_before_60_hz, kind="stk1160", seconds=30.0)


def test_grabbers_of_a_kind_are_told_apart_by_their_sockets_whatever_comes_first(fast: Machine) -> None:
    fast.call(vivid.unload)
    found = []
    for ports in ([0, 1], [1, 0]):
        fast.call(emulated.plug_in_alike, kind="usbtv", ports=ports)
        found.append({one["device"]: one["node"] for one in fast.call(grabbers.found)})
        fast.call(emulated.unplug_alike)
    one, other = found
    assert len(one) == 2
    assert one.keys() == other.keys()
    assert all(one[option] != other[option] for option in one), "the nodes follow the order of plugging in"
