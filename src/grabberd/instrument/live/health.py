"""Health of a device: each part of the instrument by itself, and the overall verdict.

It is the only source of what an operator sees: on the page, from the broker, in /readyz. A part whose state
is unknown is not called good, and old measurements are not shown as current.
"""

from collections.abc import Mapping, Sequence
from typing import NamedTuple

from grabberd.core.reconstruction.drift_check import RigVerdict
from grabberd.documents.devices import (
    DeviceHealth,
    DeviceLackDocument,
    FaultDocument,
    HealthLevel,
    HealthPart,
    HealthPartDocument,
    StartAdvice,
)
from grabberd.documents.document import assembled
from grabberd.documents.enums import DeviceState
from grabberd.documents.state import StorageDocument
from grabberd.errors import Cause
from grabberd.instrument.acquisition import Signal, StreamInfo
from grabberd.instrument.device.field_watch import WHAT_TO_DO
from grabberd.instrument.device.status_board import LATELY_S, STREAMING, DeviceStatus
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.live.field_streams import CURRENT_NS
from grabberd.runtime import UtcClock

LEVELS: tuple[HealthLevel, ...] = ("good", "unknown", "warning", "bad")
_DAEMONS_OWN: frozenset[HealthPart] = frozenset({"computer", "records", "clock"})
"""Parts that are not needed for measuring; all others are."""
_RATE_OFF, _RATE_BAD = 0.04, 0.2
"""Deviations from the rate that are reported, and that are bad; counting over two seconds errs by 1 %."""
_LOST_BAD = 0.01
"""Share of fields lost in the last seconds that is bad: two pulsations in five then have a gap."""
_RING_FULL, _RING_BAD = 0.6, 0.95
_FEW_TARGETS = 0.25
"""Share of the object's targets below which the view is covered; two thirds of a liner's are seen."""
_DISK_SHORT_MIN, _DISK_BAD_MIN = 60.0, 10.0
_EARLIEST = 2026
"""The year in which this program was written: a clock with an earlier year is not set."""


def _part(
    level: HealthLevel,
    word: str,
    message: str = "",
    hint: str = "",
    code: Cause | None = None,
    since_utc: str | None = None,
) -> HealthPartDocument:
    return HealthPartDocument(
        level=level, word=word, message=message, hint=hint, cause_code=code, since_utc=since_utc
    )


_GOOD = _part("good", "good")
_UNKNOWN = _part("unknown", "unknown")


class Surroundings(NamedTuple):
    """Environment of a device, shared with others.

    Attributes:
        storage: The disk that holds the captures.
        faults: Faults of the daemon itself, the worst first.
        clock: Source of time.
    """

    storage: StorageDocument
    faults: Sequence[FaultDocument]
    clock: UtcClock


def device_health(instrument: Instrument, around: Surroundings) -> DeviceHealth:
    """The current health of a device."""
    status = instrument.board.now
    streams = status.state in STREAMING
    # Of several equally bad parts the first is reported: it is probably the cause of the others.
    parts: dict[HealthPart, HealthPartDocument] = {
        "device": _grabber(status),
        "signal": _signal(status) if streams else _UNKNOWN,
        "rate": _rate(instrument) if streams else _UNKNOWN,
        "lost": _lost(instrument, around.clock) if streams else _UNKNOWN,
        "computer": _computer(instrument),
        "ring": _ring(instrument),
        "disk": _disk(around.storage),
        "calibration": _calibration(instrument),
        "measurement": _measurement(instrument, around.clock) if streams else _UNKNOWN,
        "rig": _rig(instrument) if streams else _UNKNOWN,
        "order": _order(instrument) if streams else _UNKNOWN,
        "records": _records(around),
        "clock": _clock(around.clock),
    }
    if instrument.pipeline.is_progressive:
        del parts["order"]  # progressive pictures have no fields whose order could be wrong
    worst = max(parts, key=lambda name: _gravity(parts[name]))
    level = parts[worst].level
    wrong = level in ("warning", "bad")
    return DeviceHealth(
        level=level if wrong or parts["device"].level == "good" else "unknown",
        part=worst if wrong else None,
        message=parts[worst].message if wrong else "",
        hint=parts[worst].hint if wrong else "",
        start=_start(instrument, parts, around.storage),
        parts=parts,
    )


def lacks_of(parts: Mapping[HealthPart, HealthPartDocument]) -> list[DeviceLackDocument]:
    """List of everything that prevents proper measuring; empty if there is nothing."""
    lacking = _bad(parts)
    if parts["device"].level != "good":
        # It is being opened, or was played to its end: no fault, but not measuring either.
        lacking = {"device": parts["device"], **lacking}
    return [assembled(DeviceLackDocument, one, lacks=part) for part, one in lacking.items()]


def _gravity(part: HealthPartDocument) -> int:
    return 0 if part.level == "unknown" else LEVELS.index(part.level)


def _start(
    instrument: Instrument, parts: Mapping[HealthPart, HealthPartDocument], storage: StorageDocument
) -> StartAdvice:
    if not instrument.captures.accepts or not storage.minutes_left:
        return "refused"
    return "doubtful" if _bad(parts) else "allowed"


def _bad(parts: Mapping[HealthPart, HealthPartDocument]) -> dict[HealthPart, HealthPartDocument]:
    """Needed parts that are bad."""
    return {part: one for part, one in parts.items() if part not in _DAEMONS_OWN and one.level == "bad"}


def _grabber(status: DeviceStatus) -> HealthPartDocument:
    if status.state in STREAMING:
        return _GOOD
    level: HealthLevel = "warning" if status.state is DeviceState.RECOVERING else "bad"
    word = str(status.state)
    if status.state is DeviceState.OPENING or status.code is Cause.NOT_OPENED:
        level, word = "unknown", "opening"
    elif status.state is DeviceState.ENDED:
        level = "unknown"
    message = f"it is {status.state}" + (f": {status.cause}" if status.cause else "")
    hint = status.hint or "wait; the daemon keeps trying"
    return _part(level, word, message, hint, status.code, status.since_utc)


def _signal(status: DeviceStatus) -> HealthPartDocument:
    if status.state is not DeviceState.NO_SIGNAL and status.signal is not Signal.ABSENT:
        return _GOOD
    message, hint = status.cause or "the camera gives no signal", status.hint or "check camera and cable"
    return _part("bad", "absent", message, hint, status.code or Cause.NO_SIGNAL, status.since_utc)


def _rate(instrument: Instrument) -> HealthPartDocument:
    rate_hz, stream = instrument.board.rate_hz, instrument.board.now.stream
    if rate_hz is None or stream is None:
        return _part("unknown", "counting")
    if _waits(instrument):
        return _UNKNOWN  # a source that waits for its reader has no rate
    wanted_hz = stream.rate_hz
    off = abs(rate_hz / wanted_hz - 1)
    if off <= _RATE_OFF:
        return _GOOD
    steady_hz = instrument.pipeline.steady_hz
    if steady_hz is not None and steady_hz < wanted_hz and abs(rate_hz / steady_hz - 1) <= _RATE_OFF:
        return _own_pace(steady_hz, stream, instrument.pipeline.rate_hz)
    message = f"{rate_hz:.1f} fields a second arrive instead of {wanted_hz:g}"
    hint = "close other programs, unplug other USB devices, check the camera's standard"
    return _part("bad" if off > _RATE_BAD else "warning", "off", message, hint)


def _own_pace(steady_hz: float, stream: StreamInfo, followed_hz: float) -> HealthPartDocument:
    """The rate of a camera that steadily delivers fewer pictures than granted."""
    is_followed = abs(steady_hz / followed_hz - 1) <= _RATE_OFF
    uncertain = "" if is_followed else "; it does not count them, so their numbers may be uncertain"
    return HealthPartDocument(
        level="warning" if is_followed or steady_hz > (1 - _RATE_BAD) * stream.rate_hz else "bad",
        word="off",
        message=f"the camera delivers {steady_hz:.1f} pictures a second, {stream.rate_hz:.4g} were granted"
        f"{uncertain}",
        hint="shorten the camera's exposure (exposure_dynamic_framerate=0) with more light, or set its "
        f"option rate_hz: {steady_hz:.3g}",
    )


def _waits(instrument: Instrument) -> bool:
    stream = instrument.board.now.stream
    return stream is not None and stream.waits_for_reader


def _lost(instrument: Instrument, clock: UtcClock) -> HealthPartDocument:
    recent = instrument.board.recent
    now_ns = clock.now_ns()
    minute, lately = recent.within(now_ns), recent.within(now_ns, LATELY_S)
    if not minute.lost:
        return _part("good", "none")
    message = f"{minute.lost} of {minute.due} fields of the last minute were lost or damaged, "
    message += f"{lately.lost} of them in the last {LATELY_S} s"
    hint = "close other programs; use a shorter USB cable, straight into the computer"
    return _part("bad" if lately.share > _LOST_BAD else "warning", "some", message, hint)


def _computer(instrument: Instrument) -> HealthPartDocument:
    shown = instrument.board.standstills.shown
    if shown is None:
        return _GOOD
    words = {Cause.PROGRAM_STOPPED: "stopped", Cause.DRIVER_HUNG: "hung"}
    word = words.get(shown.code, "busy")
    return _part("warning", word, shown.cause, shown.hint, shown.code, shown.utc)


def _ring(instrument: Instrument) -> HealthPartDocument:
    ring = instrument.pipeline.ring
    share = ring.waiting / ring.slots
    if share < _RING_FULL:
        return _GOOD
    message = f"{ring.waiting} of the ring's {ring.slots} slots wait for a reader"
    hint = "close other programs, or close live pictures: the computer does not keep up"
    return _part("bad" if share >= _RING_BAD else "warning", "full", message, hint)


def _disk(storage: StorageDocument) -> HealthPartDocument:
    left = storage.minutes_left
    if left is None:
        problem = storage.problem or "the disk cannot be read"
        return _part("bad", "broken", problem, "check the disk that holds the captures", storage.cause_code)
    if left >= _DISK_SHORT_MIN:
        return _GOOD
    level: HealthLevel = "bad" if left < _DISK_BAD_MIN else "warning"
    message = f"the disk has room for {left:.0f} minutes of capturing"
    hint = "download captures, then delete them here"
    return _part(level, "short" if left > 0 else "full", message, hint)


def _calibration(instrument: Instrument) -> HealthPartDocument:
    documents = instrument.setup.documents
    if not documents.get("calibration"):
        hint = "calibrate, or activate a calibration"
        return _part("bad", "none", "it has no calibration", hint, Cause.NO_CALIBRATION)
    if not documents.get("object"):
        hint = "name one in the configuration"
        return _part("bad", "noObject", "it has no object model", hint, Cause.NO_OBJECT)
    if misfit := instrument.misfit:
        hint = "check camera and standard, or calibrate with these pictures"
        return _part("bad", "misfit", misfit, hint, Cause.CALIBRATION_MISFIT)
    return _GOOD


def _measurement(instrument: Instrument, clock: UtcClock) -> HealthPartDocument:
    setup, live = instrument.setup.measuring, instrument.worker.live
    # Between captures, a source that waits for its reader is not read.
    if setup is None or live is None or _waits(instrument) or instrument.misfit:
        return _UNKNOWN
    points, targets = len(live.measured.points), len(setup.object_model.target)
    age_ns = clock.now_ns() - live.measured.time_ns
    if age_ns > CURRENT_NS:
        hint = "close other programs: the computer does not keep up; a capture's points are measured later"
        return _part("warning", "behind", f"the newest points are {age_ns / 1e9:.0f} s old", hint)
    if points >= _FEW_TARGETS * targets:
        return _GOOD
    message = f"{points} of the object's {targets} targets have a point"
    hint = "look at the live picture: light, focus, something in the way, or no object"
    return _part("warning", "few" if points else "none", message, hint)


_RIG_LEVELS: Mapping[RigVerdict, HealthLevel] = {
    RigVerdict.CORRECTED: "good",
    RigVerdict.DOUBTFUL: "warning",
    RigVerdict.MOVED: "bad",
    RigVerdict.UNMATCHED: "bad",
}


def _rig(instrument: Instrument) -> HealthPartDocument:
    fit = instrument.worker.rig.fit
    if fit is None or fit.verdict is RigVerdict.UNKNOWN:
        return _UNKNOWN
    if fit.verdict is RigVerdict.FITS:
        return _part("good", "fits")
    problem = instrument.worker.rig.problem or ""
    return _part(_RIG_LEVELS[fit.verdict], str(fit.verdict), problem, WHAT_TO_DO)


def _order(instrument: Instrument) -> HealthPartDocument:
    found = instrument.worker.field_order.document
    word = str(found.order) if found else "unknown"
    if word == "right":
        return _part("good", word)
    if found is None or found.problem is None:
        return _part("unknown", word)
    return _part("bad", word, *found.problem)


def _records(around: Surroundings) -> HealthPartDocument:
    # Problems of the disk are reported by its own part.
    of_disk = around.storage.cause_code
    worst = next((one for one in around.faults if one.cause_code != of_disk), None)
    if worst is None:
        return _GOOD
    level = "bad" if worst.level == "fault" else "warning"
    return assembled(HealthPartDocument, worst, level=level, word=worst.level)


def _clock(clock: UtcClock) -> HealthPartDocument:
    now_utc = clock.utc_now()
    if now_utc.year >= _EARLIEST:
        return _GOOD
    message = f"the computer's clock is not set: it shows {now_utc:%Y-%m-%d}, and captures carry that date"
    return _part("warning", "unset", message, "set it, or let it reach a time server")
