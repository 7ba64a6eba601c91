"""How a device is shown."""

from dataclasses import asdict
from typing import Any

from grabberd.acquisition import Outcome
from grabberd.service.active_calibrations import ActiveCalibrations
from grabberd.service.instrument import Instrument
from grabberd.service.recovery import Rung
from grabberd.service.worker import Worker

LATENCY_OF_LATEST = 500


def device_document(instrument: Instrument, active: ActiveCalibrations) -> dict[str, Any]:
    """A device at this moment."""
    status = instrument.board.now
    armed = instrument.intake.armed
    session = instrument.running
    return {
        "name": instrument.name,
        "state": status.state,
        "since_utc": status.since_utc,
        "cause": status.cause,
        "hint": status.hint,
        "driver": instrument.setup.config.driver,
        "stream": asdict(status.stream) if status.stream else None,
        "signal": status.signal,
        "fields": {outcome: status.outcomes[outcome] for outcome in Outcome},
        "openings": status.openings,
        "recoveries": {rung: status.recoveries[rung] for rung in Rung},
        "last_failure": status.last_failure,
        "last_failure_utc": status.last_failure_utc,
        "ring": {
            "slots": armed.ring.slots,
            "bits": armed.bits,
            "lines": armed.lines,
            "threshold": instrument.intake.thresholds.in_force.level,
        },
        "calibration": active.document(instrument),
        "warnings": [*status.warnings, *active.warnings(instrument), *instrument.worker.rig.warnings],
        "capture_id": session.id if session else None,
        "rig": instrument.worker.rig.document,
        "live": _live_document(instrument.worker),
    }


def _live_document(worker: Worker) -> dict[str, Any] | None:
    live = worker.live
    if live is None:
        return None
    residual = live.measured.points.residual_px
    return {
        "n": live.measured.n,
        "blobs": len(live.measured.blobs),
        "points": len(live.measured.points),
        "residual_px": float((residual**2).mean() ** 0.5) if len(residual) else None,
        "latency_ms": worker.latency.percentiles_ms(LATENCY_OF_LATEST),
    }
