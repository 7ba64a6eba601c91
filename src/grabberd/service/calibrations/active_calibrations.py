"""Which calibration every device measures with."""

import logging
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from grabberd.documents.calibrations import ActiveCalibration, CalibrationRow
from grabberd.errors import CalibrationMismatch, Conflict, InputError, NotFound, StorageError
from grabberd.geometry import Calibration
from grabberd.service.calibrations.calibration_documents import active_calibration
from grabberd.service.calibrations.catalog import CalibrationCatalog
from grabberd.service.calibrations.rejections import Rejections
from grabberd.service.clock import Clock, iso_utc
from grabberd.service.device.instrument import Instrument
from grabberd.storage.state.state_store import StateStore

log = logging.getLogger(__name__)

NO_CALIBRATION = "no calibration: fields are recorded, but no points measured; calibrate, or activate one"
NO_OBJECT = "no object model: fields are recorded, but no points measured; name one in the configuration"


@dataclass(frozen=True, slots=True)
class _Choice:
    """What was activated for a device; `problem` says why it cannot be used, or is None."""

    id: str
    activated_utc: str
    problem: str | None = None


class ActiveCalibrations:
    """The configuration's calibration until another one is activated; the choice is kept over restarts.

    One that can no longer be used is not replaced by another behind the operator's back: the device then has
    none, and says why.
    """

    def __init__(
        self,
        calibrations: CalibrationCatalog,
        state: StateStore,
        instruments: Mapping[str, Instrument],
        clock: Clock,
    ) -> None:
        self._calibrations = calibrations
        self._state = state
        self._instruments = instruments
        self._clock = clock
        self._rejections = Rejections(state, clock)
        self._chosen: dict[str, _Choice] = {}

    def open(self) -> None:
        """Takes up the choices of before; called before the instruments start.

        Raises:
            StorageError: the state cannot be read.
        """
        for instrument in self._instruments.values():
            chosen = self._state.get(_key(instrument.name))
            if chosen is not None:
                self._chosen[instrument.name] = self._take_up(instrument, **chosen)

    def activate(self, calibration_id: str, instrument: Instrument) -> None:
        """Measures with a calibration from the next field on, and after every restart.

        Raises:
            NotFound: there is none of that id; StorageError: it is damaged.
            CalibrationMismatch: it does not fit the device.
            CaptureRunning: a capture is made with one calibration from its first field to its last.
        """
        document = self._calibrations.find(calibration_id)
        self._check_owner(calibration_id, instrument)
        with instrument.between_captures():
            instrument.check_fits(Calibration.from_document(document))
            setup = instrument.setup.with_calibration(document)
            self._remember(calibration_id, instrument.name)
            instrument.use(setup)
        self._rejections.lift(calibration_id)
        log.info("device %s measures with calibration %s", instrument.name, calibration_id)

    def reject(self, calibration_id: str, note: str) -> None:
        """Remembers that one is not to be used; activating it takes that back.

        Raises:
            NotFound: there is none of that id; StorageError: it is damaged.
            Conflict: a device measures with it.
        """
        self._calibrations.find(calibration_id)
        if calibration_id in self.in_force():
            raise Conflict(
                f"calibration {calibration_id} is active, so it cannot be rejected",
                "activate another one first",
            )
        self._rejections.add(calibration_id, note)

    def in_force(self) -> set[str]:
        """Ids of the calibrations that devices measure with."""
        documents = (one.setup.documents.get("calibration") for one in self._instruments.values())
        return {str(document["id"]) for document in documents if document}

    def rows(self) -> list[CalibrationRow]:
        """All calibrations, newest first; `active` if a device measures with it, `misfit` if its own device
        cannot.
        """
        rows, rejections = self._calibrations.rows(), self._rejections.all()
        measuring = self._measuring(rows)
        return [
            row.model_copy(
                update={
                    "active": (row.id, row.device) in measuring,
                    "misfit": self._misfit(row),
                    "rejected": rejections.get(row.id),
                }
            )
            for row in rows
        ]

    def row(self, calibration_id: str, device: str | None = None) -> CalibrationRow:
        """One calibration; if several devices have it, that of the named device.

        Raises:
            NotFound: there is no calibration of that id.
        """
        rows = [row for row in self.rows() if row.id == calibration_id]
        if not rows:
            raise NotFound(f"no calibration {calibration_id!r}", "GET /api/v1/calibrations lists them")
        return next((row for row in rows if row.device == device), rows[0])

    def document(self, instrument: Instrument) -> ActiveCalibration | None:
        """The calibration that a device measures with, and its age; None where it has none."""
        document = instrument.setup.documents.get("calibration")
        if not document:
            return None
        chosen = self._chosen.get(instrument.name)
        return active_calibration(document, self._clock.utc_now(), chosen.activated_utc if chosen else None)

    def warnings(self, instrument: Instrument) -> list[str]:
        """What keeps a device from measuring, in sentences."""
        chosen = self._chosen.get(instrument.name)
        documents = instrument.setup.documents
        said = [
            chosen.problem if chosen else None,
            None if documents.get("calibration") else NO_CALIBRATION,
            None if documents.get("object") else NO_OBJECT,
            instrument.misfit,
        ]
        return [words for words in said if words]

    def _measuring(self, rows: Sequence[CalibrationRow]) -> set[tuple[str, str]]:
        """Ids and devices of the rows that devices measure with: each with its own, or, where it has none of
        that id, with that of another name.
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
        """Why a calibration is not one of its device as it now is; None too where there is no such device."""
        instrument = self._instruments.get(row.device)
        if instrument is None or row.problem:
            return None
        try:
            instrument.check_fits(Calibration.from_document(self._calibrations.find(row.id)))
        except (CalibrationMismatch, NotFound, StorageError) as error:
            return error.message
        return None

    def _check_owner(self, calibration_id: str, instrument: Instrument) -> None:
        """Refuses the calibration of another device; not that of one that has got another name."""
        owners = self._calibrations.owners(calibration_id) & set(self._instruments)
        if owners and instrument.name not in owners:
            raise CalibrationMismatch(
                f"calibration {calibration_id} is that of {', '.join(sorted(owners))}, "
                f"not of {instrument.name}",
                "every device has its own rig: choose one of its calibrations, or calibrate it",
            )

    def _remember(self, calibration_id: str, device: str) -> None:
        """The configuration's own calibration is no choice, but the absence of one."""
        configured = self._calibrations.configured.get(device)
        if configured is not None and configured["id"] == calibration_id:
            self._state.remove(_key(device))
            self._chosen.pop(device, None)
            return
        activated_utc = iso_utc(self._clock.utc_now())
        self._state.put({_key(device): {"id": calibration_id, "activated_utc": activated_utc}})
        self._chosen[device] = _Choice(calibration_id, activated_utc)

    def _take_up(self, instrument: Instrument, id: str, activated_utc: str) -> _Choice:
        try:
            instrument.use(instrument.setup.with_calibration(self._calibrations.find(id)))
        except (NotFound, InputError, StorageError) as error:
            problem = f"calibration {id}, which was activated, cannot be used: {error.message}"
            log.error("device %s: %s", instrument.name, problem)
            instrument.use(instrument.setup.with_calibration(None))
            return _Choice(id, activated_utc, problem)
        return _Choice(id, activated_utc)


def _key(device: str) -> str:
    return f"active_calibration.{device}"
