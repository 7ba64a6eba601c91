"""What happens to one device happens to that one alone."""

import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from running import PATIENCE_S, configuration
from scripted import INFO
from several import sealed_all, service_of, several, wait_until_they_accept

from grabberd.archive.capture.reader import CaptureReader
from grabberd.archive.capture.writer import CaptureWriter
from grabberd.config import default_config_file
from grabberd.documents.enums import DeviceState
from grabberd.errors import ConfigError, DeviceRefused
from grabberd.instrument.acquisition import GrabbedField, Signal, StreamInfo
from grabberd.instrument.capture.capture_request import CaptureRequest
from grabberd.instrument.setup import set_up
from grabberd.server.daemon.service import Service

FIELDS = 60
PACED: dict[str, Any] = {"pace": "real"}


class Grabber:
    """Does as it is told when it is opened or asked for fields."""

    called_ns = 0
    found_empty = True

    def __init__(self, opening: Exception | None = None, hang: threading.Event | None = None) -> None:
        self._opening = opening
        self._hang = hang

    def open(self) -> StreamInfo:
        if self._opening is not None:
            raise self._opening
        return INFO

    @contextmanager
    def dequeue(self, timeout_s: float) -> Iterator[Sequence[GrabbedField]]:
        if self._hang is not None:
            self._hang.wait(PATIENCE_S)
        yield ()

    def signal(self) -> Signal:
        return Signal.PRESENT

    def restart(self) -> StreamInfo:
        return self.open()

    def reset(self) -> None: ...

    def close(self) -> None: ...


def with_bad(service: Service, grabber: Grabber, folder: Path) -> Service:
    """The same with another grabber in place of the bad one's."""
    setups = {name: one.setup for name, one in service.instruments.items()}
    setups["bad"] = replace(setups["bad"], grabber=grabber)
    return Service(setups, folder, clock=service.clock)


def assert_good_is_whole(service: Service, path: Path) -> None:
    with CaptureReader(path) as reader:
        assert reader.ledger.complete, reader.ledger.in_words(50.0)
        assert reader.meta.complete
        assert [field.n for field in reader.received()] == list(range(FIELDS))
        assert [n for n, _ in reader.points()] == list(range(FIELDS))
    board = service.instrument("good").board.now
    assert (board.openings, sum(board.recoveries.values())) == (1, 0)


@pytest.mark.parametrize(
    "fault",
    [
        {"kind": "unplug", "back_after_s": 0.5},
        {"kind": "stall", "until": "reopen"},
        {"kind": "fail", "until": "restart"},
        {"kind": "lose", "count": 5},
    ],
    ids=lambda fault: fault["kind"],
)
def test_a_fault_of_one_costs_the_other_nothing(tmp_path: Path, fault: dict[str, Any]) -> None:
    bad = {**PACED, "seed": 2, "cue": str(tmp_path / "cue"), "faults": [{**fault, "at_s": 0.2}]}
    with several(tmp_path, {"good": PACED, "bad": bad}) as service:
        request = CaptureRequest(fields=FIELDS)
        service.capture_control.start_group({"good": request, "bad": request})
        (tmp_path / "cue").touch()
        files = sealed_all(service)
        assert_good_is_whole(service, files["good"])
        with CaptureReader(files["bad"]) as reader:
            assert not reader.ledger.complete
            assert reader.ledger.total == FIELDS


@pytest.mark.parametrize(
    "error", [DeviceRefused("it is refused", "see why"), RuntimeError("a fault of the driver")]
)
def test_one_that_cannot_be_opened_does_not_keep_the_daemon_from_serving_the_other(
    tmp_path: Path, error: Exception
) -> None:
    service = with_bad(service_of(tmp_path, {"good": {}, "bad": {}}), Grabber(error), tmp_path)
    service.start()
    try:
        wait_until_they_accept(service, "good")
        service.capture_control.start("good", CaptureRequest(fields=FIELDS))
        assert_good_is_whole(service, sealed_all(service)["good"])
        board = service.instrument("bad").board
        with board.changed:
            assert board.changed.wait_for(lambda: board.state is DeviceState.FAILED, PATIENCE_S)
        assert str(error.args[0]) in str(board.now.cause)
    finally:
        service.stop()


def test_a_driver_that_does_not_return_holds_up_nobody_else(tmp_path: Path) -> None:
    returns = threading.Event()
    service = with_bad(service_of(tmp_path, {"good": PACED, "bad": {}}), Grabber(hang=returns), tmp_path)
    service.start()
    try:
        wait_until_they_accept(service, "good")
        service.capture_control.start("good", CaptureRequest(fields=FIELDS))
        assert_good_is_whole(service, sealed_all(service)["good"])
    finally:
        returns.set()
        service.stop()


def test_a_file_that_cannot_be_written_for_a_while_delays_no_other(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    commit, writes = CaptureWriter.commit, threading.Event()

    def stalling(writer: CaptureWriter) -> None:
        if "bad" in writer.path.name and writer._connection.in_transaction and stalled:
            writes.wait(PATIENCE_S)
        commit(writer)

    stalled: list[bool] = []
    monkeypatch.setattr(CaptureWriter, "commit", stalling)
    with several(tmp_path, {"good": PACED, "bad": PACED}) as service:
        request = CaptureRequest(fields=FIELDS)
        service.capture_control.start_group({"good": request, "bad": request})
        stalled.append(True)
        good, bad = (service.instrument(name).captures.recording for name in ("good", "bad"))
        assert good is not None
        assert bad is not None
        assert good.sealed.wait(PATIENCE_S)
        assert not bad.sealed.is_set()
        assert_good_is_whole(service, good.path)
        writes.set()
        assert bad.sealed.wait(PATIENCE_S)
        assert bad.complete, "its own queue has kept what waited for the disk"


def test_a_mistake_in_the_configuration_of_one_is_said_with_its_name() -> None:
    config = configuration({})
    good = config.devices["simulated"]
    bad = good.model_copy(update={"options": {"scene": "udder"}})
    with pytest.raises(ConfigError) as refused:
        set_up(config.model_copy(update={"devices": {"good": good, "bad": bad}}), default_config_file())
    assert {problem.key for problem in refused.value.problems} == {"devices.bad.options"}
