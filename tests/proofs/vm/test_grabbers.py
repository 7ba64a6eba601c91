"""Drivers of real grabbers, before emulated ones: what the ledger says, judged by the truth in each row."""

import random
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

from proofs.vm.guest import grabbers, vivid
from proofs.vm.machine import Machine
from proofs.vm.tables import Tables
from proofs.vm.usb.faults import Fault

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
CASES = {"usbtv": USBTV, "usbtv, 525 lines": USBTV, "stk1160": STK1160, "uvc, YUYV": UVC, "uvc, MJPG": UVC}


@pytest.fixture(params=CASES)
def kind(request: pytest.FixtureRequest, fast: Machine) -> Iterator[str]:
    """A grabber that is plugged in."""
    with _plugged(fast, request.param):
        yield request.param


@contextmanager
def _plugged(machine: Machine, kind: str) -> Iterator[None]:
    machine.call(vivid.unload)
    plugged = machine.call(grabbers.plug_in, kind=kind)
    assert "/dev/video0" in plugged["nodes"], plugged["kernel"]
    try:
        yield
    finally:
        machine.call(grabbers.unplug, kind=kind)


def test_whatever_a_grabber_loses_no_row_of_another_field_is_received(
    kind: str, fast: Machine, tables: Tables
) -> None:
    found = _judged(fast, kind)
    for fault, about in found["cases"].items():
        tables.add(
            "Grabbers",
            NOTE,
            driver=kind,
            lost_on_its_way=fault,
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
    """Of two captures, the first in which nothing was lost but what was to be.

    While the guest waits for a page from a busy host's disk, its counted time leaps, and the emulation, which
    goes by that time, leaves fields out.
    """
    found = machine.call(grabbers.judged, kind=kind, cases=list(CASES[kind].items()))
    if found["skipped"] or found["elsewhere"]["said"]:
        found = machine.call(grabbers.judged, kind=kind, cases=list(CASES[kind].items()))
    return found


@pytest.mark.parametrize("broken", ["usbtv", "uvc, YUYV"])
def test_a_connection_that_breaks_and_comes_back_is_accounted_for(broken: str, fast: Machine) -> None:
    with _plugged(fast, broken):
        found = fast.call(grabbers.replugged, kind=broken, seconds=2.0)
    assert not found["unseen"]
    assert any("unplugged" in entry for entry in found["entries"]), found["entries"]
    assert found["after"] > 50


def test_of_pictures_that_come_twice_each_is_received_once(fast: Machine) -> None:
    with _plugged(fast, "uvc, twice"):
        found = fast.call(grabbers.repeated, kind="uvc, twice")
    assert found["received"] == found["different"]
    assert found["damaged"] == {"repeated": pytest.approx(100, abs=2)}


def test_a_decoder_that_tells_of_a_missing_camera_is_believed(fast: Machine) -> None:
    with _plugged(fast, "stk1160"):
        told = fast.call(grabbers.without_a_camera, kind="stk1160", seconds=1.0)
    assert told
    assert all("no_signal (no signal" in entry for entry in told), told


def test_a_decoder_that_sees_a_camera_of_60_hz_is_believed(fast: Machine) -> None:
    with _plugged(fast, "stk1160"):
        assert "60 Hz" in fast.call(grabbers.opened_before_60_hz, kind="stk1160", seconds=30.0)


def test_grabbers_of_a_kind_are_told_apart_by_their_sockets_whatever_comes_first(fast: Machine) -> None:
    fast.call(vivid.unload)
    found = []
    for ports in ([0, 1], [1, 0]):
        found.append(fast.call(grabbers.plug_in_alike, kind="usbtv", ports=ports))
        fast.call(grabbers.unplug_alike)
    one, other = found
    assert len(one) == 2
    assert one.keys() == other.keys()
    assert all(one[option] != other[option] for option in one), "the nodes follow the order of plugging in"
