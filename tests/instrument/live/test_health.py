"""The health of a device: what is wrong is told, the worst of it first; what nobody knows is not good."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from running import PATIENCE_S, configuration, live
from slots import STREAM, ManualClock, slot, without_signal

from grabberd.config import default_config_file
from grabberd.core.field import Field, FieldOrder
from grabberd.core.ledger import Rebase
from grabberd.documents.devices import DeviceHealth, FaultDocument, HealthPart
from grabberd.documents.enums import DeviceState
from grabberd.documents.state import StorageDocument
from grabberd.errors import Cause
from grabberd.instrument.acquisition import GrabbedField, Standstill
from grabberd.instrument.acquisition.device import Signal
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.live.health import Surroundings, device_health, lacks_of
from grabberd.instrument.setup import set_up

STREAM_OF_PAL = replace(STREAM, columns=720, field_rows=288)
PERIOD_S = 1 / STREAM_OF_PAL.rate_hz


def disk(minutes_left: float | None = 600.0, problem: str | None = None) -> StorageDocument:
    code = Cause.DISK_MISSING if problem else None
    return StorageDocument(
        free_bytes=None,
        minutes_left=minutes_left,
        problem=problem,
        cause_code=code,
        removed=0,
        removed_bytes=0,
    )


class Device:
    """An instrument whose threads never start, so that it is as the test says."""

    def __init__(self, state: DeviceState = DeviceState.READY) -> None:
        self.clock = ManualClock(ns=3_600_000_000_000)
        [setup] = set_up(configuration({}), default_config_file()).values()
        self.instrument = Instrument(setup, self.clock)
        self.board = self.instrument.board
        self.storage, self.faults = disk(), list[FaultDocument]()
        self._next = 0
        self.board.enter(DeviceState.OPENING)
        self.board.opened(STREAM_OF_PAL)
        if state is not DeviceState.OPENING:
            self.board.enter(state)

    def fields(self, count: int, *, lost_of_five: int = 0, seconds: float | None = None) -> None:
        """Fields come, of every five so many are lost."""
        for _ in range(count):
            self.clock.advance(PERIOD_S if seconds is None else seconds)
            is_lost = self._next % 5 < lost_of_five
            if not is_lost:
                self.board.count(slot(self._next, self._next % 5 and lost_of_five))
            self._next += 1

    @property
    def health(self) -> DeviceHealth:
        return device_health(self.instrument, Surroundings(self.storage, self.faults, self.clock))

    def part(self, name: HealthPart) -> tuple[str, str]:
        part = self.health.parts[name]
        return part.level, part.word


def told(health: DeviceHealth) -> tuple[str, str | None, str]:
    return health.level, health.part, health.start


def test_one_at_which_nothing_is_wrong_is_good() -> None:
    device = Device()
    device.fields(200)
    assert told(device.health) == ("good", None, "allowed")
    assert device.health.message == ""
    assert lacks_of(device.health.parts) == []


def test_one_that_loses_four_of_five_fields_is_bad_however_ready_it_is() -> None:
    device = Device()
    device.fields(500, lost_of_five=4)
    assert device.board.state is DeviceState.READY
    health = device.health
    assert (health.level, health.part, health.start) == ("bad", "rate", "doubtful")
    assert "10.0 fields a second arrive instead of 50" in health.message
    assert health.parts["lost"].level == "bad"
    assert health.parts["lost"].message.startswith("400 of 500 fields of the last minute")
    assert {lack.lacks for lack in lacks_of(health.parts)} == {"rate", "lost"}


def test_a_few_lost_fields_are_told_for_a_minute_as_a_warning() -> None:
    device = Device()
    device.fields(500)
    device.board.count(slot(device._next + 1, lost_before=1))
    device.fields(600)
    assert told(device.health) == ("warning", "lost", "allowed")
    device.fields(49 * 50)
    assert told(device.health) == ("good", None, "allowed")


@pytest.mark.parametrize(
    ("state", "level", "start"),
    [
        (DeviceState.ABSENT, "bad", "refused"),
        (DeviceState.FAILED, "bad", "refused"),
        (DeviceState.RECOVERING, "warning", "refused"),
        (DeviceState.OPENING, "unknown", "refused"),
        (DeviceState.ENDED, "unknown", "refused"),
    ],
)
def test_one_that_does_not_stream_takes_no_capture(state: DeviceState, level: str, start: str) -> None:
    device = Device(state)
    assert (device.health.level, device.health.start) == (level, start)
    assert [lack.lacks for lack in lacks_of(device.health.parts)] == ["device"]
    for name in ("signal", "rate", "lost", "measurement", "rig", "order"):
        assert device.part(name) == ("unknown", "unknown")  # type: ignore[arg-type]


def test_what_is_wrong_with_the_grabber_is_told_before_what_follows_from_it() -> None:
    device = Device(DeviceState.ABSENT)
    device.storage = disk(5.0)
    assert device.health.part == "device"


def test_a_camera_without_a_signal_makes_a_capture_doubtful() -> None:
    device = Device()
    device.board.saw_signal(Signal.ABSENT)
    device.board.enter(DeviceState.NO_SIGNAL, "the camera gives no signal", "check the cable")
    device.board.count(without_signal(0))
    assert told(device.health) == ("bad", "signal", "doubtful")
    assert (device.health.message, device.health.hint) == ("the camera gives no signal", "check the cable")


def test_what_waits_for_its_reader_has_no_rate_of_its_own() -> None:
    device = Device()
    device.board.opened(replace(STREAM_OF_PAL, waits_for_reader=True))
    device.fields(200, seconds=0.001)
    assert device.part("rate") == ("unknown", "unknown")


@pytest.mark.parametrize("rate_hz", [25.0, 59.94, 120.0])
def test_progressive_pictures_at_the_rate_granted_are_good_and_have_no_order(rate_hz: float) -> None:
    device = Device()
    whole = {"field_rows": 576, "field_order": FieldOrder.PROGRESSIVE, "standard": ""}
    stream = replace(STREAM_OF_PAL, rate_hz=rate_hz, **whole)  # type: ignore[arg-type]
    device.instrument.pipeline.opened(stream)
    device.board.opened(stream)
    device.fields(round(3 * rate_hz), seconds=1 / rate_hz)
    assert told(device.health) == ("good", None, "allowed")
    assert device.part("rate") == ("good", "good")
    assert "order" not in device.health.parts
    assert lacks_of(device.health.parts) == []
    device.fields(round(3 * rate_hz), seconds=1.1 / rate_hz)
    assert device.part("rate") == ("warning", "off")


def slow_camera(counts: bool) -> Device:
    """A progressive camera that has granted 30 pictures a second and steadily delivers 20."""
    device = Device()
    whole = {"field_rows": 576, "field_order": FieldOrder.PROGRESSIVE, "standard": "", "rate_hz": 30.0}
    stream = replace(STREAM_OF_PAL, counts_losses=counts, **whole)  # type: ignore[arg-type]
    device.instrument.pipeline.opened(stream, device.clock.ns)
    device.board.opened(stream)
    y, x = np.mgrid[:576, :720]
    scene, noise = 20 + 180 * ((x // 8 + y // 12) % 5 == 0), np.random.default_rng(1)
    for n in range(100):
        picture = Field.progressive((scene + noise.integers(0, 16, scene.shape)).astype(np.uint8))
        device.clock.advance(0.05)
        grabbed = GrabbedField(picture, device.clock.ns - 40_000_000, n, None)
        for one in device.instrument.pipeline.take(grabbed, Signal.UNKNOWN, device.clock.ns):
            device.board.count(one)
    return device


@pytest.mark.parametrize(("counts", "level"), [(True, "warning"), (False, "bad")])
def test_a_camera_that_delivers_fewer_pictures_than_granted_is_told_with_the_remedy(
    counts: bool, level: str
) -> None:
    rate = slow_camera(counts).health.parts["rate"]
    assert (rate.level, rate.word) == (level, "off")
    assert rate.message.startswith("the camera delivers 20.0 pictures a second, 30 were granted")
    assert ("may be uncertain" in rate.message) == (not counts)
    assert "exposure" in rate.hint
    assert rate.hint.endswith("rate_hz: 20")


def test_a_slower_camera_that_counts_loses_nothing_and_captures_go_by_its_own_rate() -> None:
    device = slow_camera(counts=True)
    assert device.health.parts["lost"].level == "good"
    assert device.instrument.pipeline.rate_hz == pytest.approx(20.0, rel=1e-3)
    assert device.board.now.rebases[Rebase.RATE] == 1


def test_a_rate_that_is_a_little_off_is_a_warning() -> None:
    device = Device()
    device.fields(200, seconds=PERIOD_S / 0.93)
    assert told(device.health) == ("warning", "rate", "allowed")


@pytest.mark.parametrize(
    ("minutes", "level", "word", "start"),
    [
        (600.0, "good", "good", "allowed"),
        (30.0, "warning", "short", "allowed"),
        (5.0, "bad", "short", "doubtful"),
        (0.0, "bad", "full", "refused"),
        (None, "bad", "broken", "refused"),
    ],
)
def test_the_disk(minutes: float | None, level: str, word: str, start: str) -> None:
    device = Device()
    device.fields(200)
    device.storage = disk(minutes, None if minutes is not None else "it was unplugged")
    assert device.part("disk") == (level, word)
    assert device.health.start == start


def test_a_fault_of_the_daemon_is_told_but_keeps_nothing_from_being_measured() -> None:
    device = Device()
    device.fields(200)
    device.faults.append(
        FaultDocument(
            cause_code=Cause.SETTINGS_LOST,
            level="fault",
            message="the settings were damaged",
            hint="enter them again",
            since_utc="2026-01-01T00:00:00.000Z",
        )
    )
    assert told(device.health) == ("bad", "records", "allowed")
    assert lacks_of(device.health.parts) == []


def test_what_the_disk_tells_is_not_told_twice() -> None:
    device = Device()
    device.storage = disk(None, "it was unplugged")
    device.faults.append(
        FaultDocument(
            cause_code=Cause.DISK_MISSING, level="fault", message="no disk", hint="plug it in", since_utc=""
        )
    )
    assert device.part("records") == ("good", "good")


@pytest.mark.parametrize(
    ("missing", "word", "code"),
    [("calibration", "none", Cause.NO_CALIBRATION), ("object", "noObject", Cause.NO_OBJECT)],
)
def test_one_that_is_not_calibrated_captures_but_does_not_measure(
    missing: str, word: str, code: Cause
) -> None:
    device = Device()
    device.fields(200)
    setup = device.instrument.setup
    device.instrument.captures.setup = replace(setup, documents={**setup.documents, missing: None})
    assert device.part("calibration") == ("bad", word)
    assert told(device.health) == ("bad", "calibration", "doubtful")
    assert [lack.cause_code for lack in lacks_of(device.health.parts)] == [code]


def test_a_standstill_of_the_program_is_told_for_a_minute() -> None:
    device = Device()
    device.fields(200)
    device.board.stood_still(Standstill(time_ns=10**9, waited_ns=9 * 10**8, used_ns=10**8))
    assert device.part("computer") == ("warning", "busy")
    assert device.health.start == "allowed"
    device.fields(61 * 50)
    assert device.part("computer") == ("good", "good")


def test_a_clock_that_was_never_set_is_told() -> None:
    device = Device()
    device.fields(200)

    class Unset(ManualClock):
        def utc_now(self):  # type: ignore[no-untyped-def]
            return super().utc_now().replace(year=1970)

    around = Surroundings(device.storage, device.faults, Unset(device.clock.ns))
    clock = device_health(device.instrument, around).parts["clock"]
    assert (clock.level, clock.word) == ("warning", "unset")
    assert "1970" in clock.message


def test_points_that_are_no_longer_measured_are_not_told_as_if_they_were(tmp_path: Path) -> None:
    with live(tmp_path) as service:
        instrument = service.instrument(None)
        with instrument.worker.published:
            assert instrument.worker.published.wait_for(
                lambda: (
                    instrument.worker.live is not None and len(instrument.worker.live.measured.points) > 50
                ),
                PATIENCE_S,
            )
        assert service.device_document(instrument).health.parts["measurement"].level in ("good", "warning")
        later = ManualClock(service.clock.now_ns() + 5_000_000_000)
        around = service.surroundings()._replace(clock=later)
        behind = device_health(instrument, around).parts["measurement"]
        assert (behind.level, behind.word) == ("warning", "behind")
