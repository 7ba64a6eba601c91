"""The active calibration of every device, and the calibrations that were rejected."""

import logging
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from grabberd import runtime
from grabberd.archive.calibrations.calibration_catalog import (
    CalibrationCatalog,
    CalibrationHead,
    active_calibration,
    failure_of,
)
from grabberd.archive.state.state_database import StateStore
from grabberd.core.geometry import Calibration
from grabberd.documents.calibrations import ActiveCalibration, CalibrationRejection, CalibrationRow
from grabberd.errors import CalibrationMismatch, Conflict, InputError, NotFound, StorageError
from grabberd.instrument.instrument import Instrument
from grabberd.runtime import UtcClock, iso_utc

log = logging.getLogger(__name__)

REJECTED = "rejected_calibrations"
"""Key of the rejections in the state database."""
NO_CALIBRATION = "no calibration: fields are recorded, but no points measured; calibrate, or activate one"
NO_OBJECT = "no object model: fields are recorded, but no points measured; name one in the configuration"


@dataclass(frozen=True, slots=True)
class _Choice:
    """A calibration that was activated for a device; `problem` says why it cannot be used, or is None."""

    id: str
    activated_utc: str
    problem: str | None = None


class ActiveCalibrations:
    """Keeps each device's active calibration: the configuration's until another one is activated.

    The choice survives restarts. A calibration that can no longer be used is not replaced silently: the
    device then has none, and a warning says why.
    """

    def __init__(
        self,
        calibrations: CalibrationCatalog,
        state: StateStore,
        instruments: Mapping[str, Instrument],
        clock: UtcClock,
    ) -> None:
        self._calibrations = calibrations
        self._state = state
        self._instruments = instruments
        self._clock = clock
        self._rejections = _Rejections(state, clock)
        self._chosen: dict[str, _Choice] = {}

    def open(self) -> None:
        """Restores the choices made before a restart; called before the instruments start.

        Raises:
            StorageError: The state cannot be read.
        """
        for instrument in self._instruments.values():
            chosen = self._state.get(_key(instrument.name))
            if chosen is not None:
                self._chosen[instrument.name] = self._restored(instrument, **chosen)

    def keep(self) -> None:
        """Stores the choices again after the stored ones were lost.

        Raises:
            StorageError: They cannot be stored.
        """
        for device, chosen in self._chosen.items():
            self._state.put({_key(device): {"id": chosen.id, "activated_utc": chosen.activated_utc}})

    def activate(self, calibration_id: str, instrument: Instrument, *, despite_failure: bool = False) -> None:
        """Makes a device measure with a calibration from the next field on, also after a restart.

        Args:
            calibration_id: Its id.
            instrument: The device.
            despite_failure: True if an admin wants it although its acceptance failed.

        Raises:
            NotFound: No calibration has that id.
            StorageError: The calibration is damaged.
            CalibrationMismatch: The calibration does not fit the device.
            Conflict: Its acceptance failed.
            CaptureRunning: A capture is running, which keeps its calibration.
        """
        document = self._calibrations.find(calibration_id)
        self._check_owner(calibration_id, instrument)
        if not despite_failure and (failure := failure_of(document)) is not None:
            raise Conflict(
                failure, "correct the causes and calibrate again; an admin may use it with despite_failure"
            )
        with instrument.between_captures():
            instrument.check_fits(Calibration.from_document(document))
            setup = instrument.setup.with_calibration(document)
            # Stored before it is used: after a failed write, device and stored choice must agree.
            self._remember(calibration_id, instrument.name)
            instrument.use(setup)
        self._rejections.lift(calibration_id)
        log.info("device %s measures with calibration %s", instrument.name, calibration_id)

    def reject(self, calibration_id: str, note: str) -> None:
        """Rejects a calibration; activating it undoes that.

        Raises:
            NotFound: No calibration has that id.
            StorageError: The calibration is damaged.
            Conflict: A device measures with it.
        """
        self._calibrations.find(calibration_id)
        if calibration_id in self.in_force():
            raise Conflict(
                f"calibration {calibration_id} is active, so it cannot be rejected",
                "activate another one first",
            )
        self._rejections.add(calibration_id, note)

    def in_force(self) -> set[str]:
        """Returns the ids of the calibrations that devices measure with."""
        documents = (one.setup.documents.get("calibration") for one in self._instruments.values())
        return {str(document["id"]) for document in documents if document}

    def listing(self) -> tuple[list[CalibrationHead], Callable[[CalibrationHead], CalibrationRow]]:
        """Returns the heads of all calibrations, newest first, and what reads the row of one.

        `active` is true if a device measures with it; `misfit` says why its own device cannot, or is None.
        """
        heads, rejections = self._calibrations.heads(), self._rejections.all()
        in_force = self.in_force()
        measuring = self._measuring([self._calibrations.row(one) for one in heads if one.id in in_force])

        def row(head: CalibrationHead) -> CalibrationRow:
            found = self._calibrations.row(head)
            return found.model_copy(
                update={
                    "active": (found.id, found.device) in measuring,
                    "misfit": self._misfit(found),
                    "rejected": rejections.get(found.id),
                }
            )

        return heads, row

    def row(self, calibration_id: str, device: str | None = None) -> CalibrationRow:
        """Returns one calibration as it is listed; if several devices have it, that of the device named.

        Raises:
            NotFound: No calibration has that id.
        """
        heads, row_of = self.listing()
        rows = [row_of(head) for head in heads if head.id == calibration_id]
        if not rows:
            raise NotFound(f"no calibration {calibration_id!r}", "GET /api/v1/calibrations lists them")
        return next((row for row in rows if row.device == device), rows[0])

    def document(self, instrument: Instrument) -> ActiveCalibration | None:
        """Returns the calibration that a device measures with, and its age; None if it has none."""
        document = instrument.setup.documents.get("calibration")
        if not document:
            return None
        chosen = self._chosen.get(instrument.name)
        return active_calibration(document, self._clock.utc_now(), chosen.activated_utc if chosen else None)

    def warnings(self, instrument: Instrument) -> list[str]:
        """Returns what keeps a device from measuring, in sentences."""
        chosen = self._chosen.get(instrument.name)
        documents = instrument.setup.documents
        reasons = [
            chosen.problem if chosen else None,
            None if documents.get("calibration") else NO_CALIBRATION,
            None if documents.get("object") else NO_OBJECT,
            failure_of(documents["calibration"]) if documents.get("calibration") else None,
            instrument.misfit,
        ]
        return [reason for reason in reasons if reason]

    def _measuring(self, rows: Sequence[CalibrationRow]) -> set[tuple[str, str]]:
        """Returns ids and devices of the rows that devices measure with.

        A device measures with its own row of an id or, if it was renamed since, with that of the old name.
        """
        owners: dict[str, set[str]] = {}
        for row in rows:
            owners.setdefault(row.id, set()).add(row.device)
        measuring: set[tuple[str, str]] = set()
        for instrument in self._instruments.values():
            calibration_id = str((instrument.setup.documents.get("calibration") or {}).get("id"))
            its_owners = owners.get(calibration_id, set())
            named = {instrument.name} & its_owners or its_owners
            measuring.update((calibration_id, name) for name in named)
        return measuring

    def _misfit(self, row: CalibrationRow) -> str | None:
        """Reason why a calibration does not fit its device as it is now; None also if the device is gone."""
        instrument = self._instruments.get(row.device)
        if instrument is None or row.problem:
            return None
        try:
            instrument.check_fits(Calibration.from_document(self._calibrations.find(row.id)))
        except (CalibrationMismatch, NotFound, StorageError) as error:
            return error.message
        return None

    def _check_owner(self, calibration_id: str, instrument: Instrument) -> None:
        """Refuses the calibration of another configured device; one that is no longer configured may be the
        same device under an earlier name.

        Raises:
            CalibrationMismatch: The calibration belongs to another device.
        """
        owners = self._calibrations.owners(calibration_id) & set(self._instruments)
        if owners and instrument.name not in owners:
            raise CalibrationMismatch(
                f"calibration {calibration_id} belongs to {', '.join(sorted(owners))}, "
                f"not to {instrument.name}",
                "every device has its own rig: choose one of its calibrations, or calibrate it",
            )

    def _remember(self, calibration_id: str, device: str) -> None:
        # Activating the configuration's own is no choice: a later change of the configuration takes effect.
        configured = self._calibrations.configured.get(device)
        if configured is not None and configured["id"] == calibration_id:
            self._state.remove(_key(device))
            self._chosen.pop(device, None)
            return
        activated_utc = iso_utc(self._clock.utc_now())
        self._state.put({_key(device): {"id": calibration_id, "activated_utc": activated_utc}})
        self._chosen[device] = _Choice(calibration_id, activated_utc)

    def _restored(self, instrument: Instrument, id: str, activated_utc: str) -> _Choice:
        try:
            instrument.use(instrument.setup.with_calibration(self._calibrations.find(id)))
        except (NotFound, InputError, StorageError) as error:
            problem = f"the active calibration {id} cannot be used: {error.message}"
            log.error("device %s: %s", instrument.name, problem)
            instrument.use(instrument.setup.with_calibration(None))
            return _Choice(id, activated_utc, problem)
        return _Choice(id, activated_utc)


def _key(device: str) -> str:
    return f"active_calibration.{device}"


class _Rejections:
    """The rejected calibrations, kept in the state database; usable from any thread."""

    def __init__(self, state: StateStore, clock: UtcClock) -> None:
        self._state = state
        self._clock = clock
        self._lock = runtime.lock()

    def all(self) -> dict[str, CalibrationRejection]:
        return {
            key: CalibrationRejection(**value) for key, value in (self._state.get(REJECTED) or {}).items()
        }

    def add(self, calibration_id: str, note: str) -> None:
        with self._lock:
            rejection = CalibrationRejection(rejected_utc=iso_utc(self._clock.utc_now()), note=note)
            self._write({**self.all(), calibration_id: rejection})

    def lift(self, calibration_id: str) -> None:
        with self._lock:
            left = self.all()
            if left.pop(calibration_id, None):
                self._write(left)

    def _write(self, rejections: Mapping[str, CalibrationRejection]) -> None:
        self._state.put({REJECTED: {key: one.model_dump() for key, one in rejections.items()}})
