"""Current state of the devices: the document of each, a revision, and changes for clients.

A revision contains what may change at any moment and must not be missed. Counters, rates and the newest field
change all the time and are not part of it, so that a state can be shared for a moment. Changes are those of a
JSON document since the version that a client has seen.
"""

from collections import deque
from collections.abc import Hashable, Iterable, Mapping
from dataclasses import asdict
from typing import Any, NamedTuple

from grabberd.core.ledger import LossCause, Outcome, Rebase
from grabberd.documents.devices import (
    ComputerDocument,
    DeviceDocument,
    FaultDocument,
    LastMinute,
    RingDocument,
    ViewColumnsDocument,
)
from grabberd.documents.document import JsonObject, assembled
from grabberd.documents.enums import Rung
from grabberd.instrument.acquisition import StreamInfo
from grabberd.instrument.active_calibrations import ActiveCalibrations
from grabberd.instrument.device.scheduling import Standstills
from grabberd.instrument.device.worker import Worker
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.live.field_streams import live_document
from grabberd.instrument.live.health import Surroundings, device_health, lacks_of


def device_document(
    instrument: Instrument, active: ActiveCalibrations, around: Surroundings, fields: Mapping[str, object]
) -> DeviceDocument:
    """Current document of a device, with the fields added by others."""
    health = device_health(instrument, around)
    status, rate_hz = instrument.board.now, instrument.board.rate_hz
    # Read once: a capture may end, or begin, while the document is built.
    # The one being sealed last: so a capture that ends meanwhile appears as one of the two.
    captures = instrument.captures
    running, armed, sealing = captures.running, captures.armed, captures.sealing
    capture = running or armed
    views = instrument.setup.config.rig.views
    return assembled(
        DeviceDocument,
        status,
        name=instrument.name,
        cause_code=status.code,
        driver=instrument.setup.config.driver,
        stream=_stream(status.stream) if status.stream else None,
        rate_hz=None if rate_hz is None else round(rate_hz, 1),
        fields={outcome: status.outcomes[outcome] for outcome in Outcome},
        losses={cause: status.losses[cause] for cause in LossCause},
        last_minute=LastMinute(**instrument.board.recent.within(around.clock.now_ns())._asdict()),
        rebases={kind: status.rebases[kind] for kind in Rebase},
        computer=_computer(instrument.board.standstills),
        recoveries={rung: status.recoveries[rung] for rung in Rung},
        ring=_ring(instrument),
        views={name: assembled(ViewColumnsDocument, one) for name, one in views},
        calibration=active.document(instrument),
        lacks=lacks_of(health.parts),
        health=health,
        warnings=[*status.warnings, *active.warnings(instrument), *_warnings(instrument.worker)],
        capture_id=running.id if running else None,
        armed_capture_id=armed.id if armed else None,
        sealing_capture_id=sealing.id if sealing else None,
        group_id=capture.group.id if capture is not None and capture.group is not None else None,
        rig=instrument.worker.rig.document,
        field_order=instrument.worker.field_order.document,
        live=live_document(instrument, around.clock),
    ).model_copy(update=fields)


def _stream(stream: StreamInfo) -> JsonObject:
    """The granted stream; progressive pictures have no video standard."""
    return {**asdict(stream), "standard": stream.standard or None}


def _warnings(worker: Worker) -> tuple[str, ...]:
    return *worker.rig.warnings, *worker.field_order.warnings


def _computer(standstills: Standstills) -> ComputerDocument:
    shown = standstills.shown
    return ComputerDocument(
        cause=shown and shown.cause,
        hint=shown and shown.hint,
        cause_code=shown and shown.code,
        since_utc=shown and shown.utc,
        standstills={code: standstills.counts[code] for code in standstills.seconds},
        standstill_s={code: round(seconds, 1) for code, seconds in standstills.seconds.items()},
    )


def _ring(instrument: Instrument) -> RingDocument:
    ring = instrument.pipeline.ring
    lines = None if instrument.pipeline.is_progressive else ring.lines
    return assembled(RingDocument, ring, lines=lines, threshold=instrument.pipeline.thresholds.in_force.level)


def revision_of(instruments: Iterable[Instrument], faults: Iterable[FaultDocument]) -> Hashable:
    """Differs if states differ in more than numbers; it is cheap, since it is made from memory."""
    known = tuple((fault.cause_code, fault.since_utc, fault.message) for fault in faults)
    return known, tuple(_of_device(one) for one in instruments)


def _of_device(instrument: Instrument) -> Hashable:
    status, worker, documents = instrument.board.now, instrument.worker, instrument.setup.documents
    captures = instrument.captures
    return (
        (status.state, status.since_utc, status.cause, status.openings, status.last_failure_utc),
        (status.signal, status.refusals),
        tuple(one.id if one else None for one in (captures.running, captures.armed, captures.sealing)),
        ((documents.get("calibration") or {}).get("id"), instrument.misfit),
        (worker.live is None, worker.rig.warnings, worker.field_order.warnings),
    )


KEPT = 150
"""At five versions a second, a client that reconnects within half a minute gets only the changes."""


def changes(before: JsonObject, after: JsonObject) -> JsonObject:
    """The keys whose values differ, with their new values, recursively.

    The result is a JSON merge patch (RFC 7396): a key that was removed, or has become null, is null.
    """
    gone = {key: None for key in before if key not in after}
    new = {key: value for key, value in after.items() if key not in before or before[key] != value}
    return gone | {key: _change(before.get(key), value) for key, value in new.items()}


class Version(NamedTuple):
    """A document and its version number, from 1."""

    number: int
    document: JsonObject


class History:
    """The latest versions of a document."""

    def __init__(self, kept: int = KEPT) -> None:
        self._versions: deque[Version] = deque(maxlen=kept)

    def enter(self, document: JsonObject) -> Version | None:
        """Adds the current document as a new version; returns None if it has not changed."""
        newest = self._versions[-1] if self._versions else Version(0, {})
        if document == newest.document:
            return None
        self._versions.append(Version(newest.number + 1, document))
        return self._versions[-1]

    def find(self, number: int) -> Version | None:
        """A version by number; None if it has been dropped."""
        return next((version for version in list(self._versions) if version.number == number), None)


def _change(before: Any, after: Any) -> Any:
    both = isinstance(before, dict) and isinstance(after, dict)
    return changes(before, after) if both else after
