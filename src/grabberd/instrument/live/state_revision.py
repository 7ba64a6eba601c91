"""Revision of the state: what in it may change from one moment to the next and must not be missed.

Counters, rates and the newest field change all the time; whoever shares a state for a moment leaves them out.
"""

from collections.abc import Hashable, Iterable

from grabberd.documents.faults import FaultDocument
from grabberd.instrument.instrument import Instrument


def revision_of(instruments: Iterable[Instrument], faults: Iterable[FaultDocument]) -> Hashable:
    """Two that differ are of states that differ in more than numbers; it is told at once, from memory."""
    known = tuple((fault.cause_code, fault.since_utc, fault.message) for fault in faults)
    return known, tuple(_of_device(one) for one in instruments)


def _of_device(instrument: Instrument) -> Hashable:
    status, worker, documents = instrument.board.now, instrument.worker, instrument.setup.documents
    captures = instrument.running, instrument.armed_capture, instrument.sealing
    return (
        (status.state, status.since_utc, status.cause, status.openings, status.last_failure_utc),
        (status.signal, status.refusals),
        tuple(one.id if one else None for one in captures),
        ((documents.get("calibration") or {}).get("id"), instrument.misfit),
        (worker.live is None, worker.rig.warnings, worker.field_order.warnings),
    )
