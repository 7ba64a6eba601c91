"""How a device is shown."""

from dataclasses import asdict
from typing import Any

from grabberd.acquisition import Outcome
from grabberd.service.calibrations.active_calibrations import ActiveCalibrations
from grabberd.service.device.recovery import Rung
from grabberd.service.instrument import Instrument
from grabberd.service.live.live_document import live_document
from grabberd.service.readiness import Lack, lacks_of


def device_document(instrument: Instrument, active: ActiveCalibrations) -> dict[str, Any]:
    """A device at this moment."""
    status, rate_hz = instrument.board.now, instrument.board.rate_hz
    armed = instrument.pipeline.configured
    session = instrument.running
    return {
        "name": instrument.name,
        "state": status.state,
        "since_utc": status.since_utc,
        "cause": status.cause,
        "hint": status.hint,
        "cause_code": status.code,
        "driver": instrument.setup.config.driver,
        "stream": asdict(status.stream) if status.stream else None,
        "signal": status.signal,
        "rate_hz": None if rate_hz is None else round(rate_hz, 1),
        "fields": {outcome: status.outcomes[outcome] for outcome in Outcome},
        "openings": status.openings,
        "recoveries": {rung: status.recoveries[rung] for rung in Rung},
        "last_failure": status.last_failure,
        "last_failure_utc": status.last_failure_utc,
        "ring": {
            "slots": armed.ring.slots,
            "bits": armed.bits,
            "lines": armed.lines,
            "threshold": instrument.pipeline.thresholds.in_force.level,
            "waiting": armed.ring.waiting,
            "deepest": armed.ring.deepest,
        },
        "views": instrument.setup.config.rig.views.model_dump(),
        "calibration": active.document(instrument),
        "lacks": [lack_document(one) for one in lacks_of(instrument)],
        "warnings": [*status.warnings, *active.warnings(instrument), *instrument.worker.rig.warnings],
        "capture_id": session.id if session else None,
        "armed_capture_id": instrument.armed_capture.id if instrument.armed_capture else None,
        "group_id": _group_id(instrument),
        "rig": instrument.worker.rig.document,
        "live": live_document(instrument),
    }


def lack_document(lack: Lack) -> dict[str, Any]:
    """What keeps a device from measuring, without its name."""
    return {"lacks": lack.lacks, "message": lack.message, "hint": lack.hint, "cause_code": lack.code}


def _group_id(instrument: Instrument) -> str | None:
    """Of the capture that is being recorded, or waits for its trigger."""
    capture = instrument.running or instrument.armed_capture
    return capture.group.id if capture is not None and capture.group is not None else None
