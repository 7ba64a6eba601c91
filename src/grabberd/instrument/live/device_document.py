"""The document of a device at this moment."""

from collections.abc import Mapping
from dataclasses import asdict

from grabberd.core.ledger import LossCause, Outcome, Rebase
from grabberd.documents.devices import (
    ComputerDocument,
    DeviceDocument,
    LastMinute,
    RingDocument,
    ViewColumnsDocument,
)
from grabberd.documents.named_types import JsonObject
from grabberd.documents.states import Rung
from grabberd.instrument.acquisition import StreamInfo
from grabberd.instrument.active_calibrations import ActiveCalibrations
from grabberd.instrument.device.standstills import Standstills
from grabberd.instrument.device.worker import Worker
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.live.health import Surroundings, device_health, lacks_of
from grabberd.instrument.live.live_document import live_document


def device_document(
    instrument: Instrument,
    active: ActiveCalibrations,
    around: Surroundings,
    fields: Mapping[str, object],
) -> DeviceDocument:
    """A device at this moment, with the fields that others add to it."""
    health = device_health(instrument, around)
    status, rate_hz = instrument.board.now, instrument.board.rate_hz
    # Read once: a capture may end, or begin, while the document is built.
    # The one being sealed last: so a capture that ends meanwhile is told as one of the two.
    running, armed, sealing = instrument.running, instrument.armed_capture, instrument.sealing
    capture = running or armed
    views = instrument.setup.config.rig.views
    return DeviceDocument(
        name=instrument.name,
        state=status.state,
        since_utc=status.since_utc,
        cause=status.cause,
        hint=status.hint,
        cause_code=status.code,
        driver=instrument.setup.config.driver,
        stream=_stream(status.stream) if status.stream else None,
        signal=status.signal,
        rate_hz=None if rate_hz is None else round(rate_hz, 1),
        fields={outcome: status.outcomes[outcome] for outcome in Outcome},
        losses={cause: status.losses[cause] for cause in LossCause},
        last_minute=LastMinute(**instrument.board.recent.within(around.clock.now_ns())._asdict()),
        rebases={kind: status.rebases[kind] for kind in Rebase},
        computer=_computer(instrument.board.standstills),
        openings=status.openings,
        recoveries={rung: status.recoveries[rung] for rung in Rung},
        last_failure=status.last_failure,
        last_failure_utc=status.last_failure_utc,
        ring=_ring(instrument),
        views={
            name: ViewColumnsDocument(first_column=one.first_column, end_column=one.end_column)
            for name, one in views
        },
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
    """The stream as granted; that of progressive pictures has no video standard."""
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
    return RingDocument(
        slots=ring.slots,
        bits=ring.bits,
        lines=None if instrument.pipeline.is_progressive else ring.lines,
        threshold=instrument.pipeline.thresholds.in_force.level,
        waiting=ring.waiting,
        deepest=ring.deepest,
    )
