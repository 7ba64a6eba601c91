"""All instruments, their captures and the jobs: what HTTP and the command line stand on."""

import logging
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from grabberd import __version__
from grabberd.config import Config
from grabberd.documents.devices import DeviceDocument
from grabberd.documents.state import StateDocument, StorageDocument
from grabberd.errors import NotFound, StorageError
from grabberd.geometry import Calibration
from grabberd.service.access import Access
from grabberd.service.archive.annotations import CaptureAnnotations
from grabberd.service.archive.archive import Archive
from grabberd.service.archive.retention import Policy, Retention
from grabberd.service.calibrations.active_calibrations import ActiveCalibrations
from grabberd.service.calibrations.catalog import CalibrationCatalog
from grabberd.service.capture.armed_capture import ArmedCapture
from grabberd.service.capture.capture_control import CaptureControl
from grabberd.service.capture.disk_guard import GB, DiskGuard
from grabberd.service.capture.recorder import CaptureRequest
from grabberd.service.capture.recording import Recording
from grabberd.service.clock import Clock, SystemClock, iso_utc
from grabberd.service.device.fair_lock import FairLock
from grabberd.service.device.instrument import NOMINAL_RATE_HZ, Instrument
from grabberd.service.idempotency import Idempotency
from grabberd.service.jobs.calibrate_file import calibrate_capture
from grabberd.service.jobs.calibration_job import Calibrator
from grabberd.service.jobs.job_runner import JobRunner
from grabberd.service.live.device_document import device_document
from grabberd.service.mqtt.publishing import Publishes, publisher_of
from grabberd.service.secrets import without_secrets
from grabberd.service.settings import Settings
from grabberd.service.setup import DeviceSetup
from grabberd.storage.state.analysis_store import AnalysisStore
from grabberd.storage.state.annotation_store import AnnotationStore
from grabberd.storage.state.calibration_store import CalibrationRecord
from grabberd.storage.state.state_store import StateStore

log = logging.getLogger(__name__)


class Service:
    """Everything that runs; `start` and `stop` frame its life.

    Attributes:
        instruments: by the name of their device.
        archive: the captures; `orders`: begins and ends them; `analyses`: of their points.
        calibrations: those that there are; `active`: which of them every device measures with.
        access: who may.
        settings: what was set in place of the configuration.
        configuration: as it was read, without what is secret in it.
        jobs: what takes long; `calibrator`: of those that calibrate.
        annotations: pins, notes and labels of captures.
        idempotency: orders that take effect once.
        keeping: pins, notes and labels of captures, and their end; `retention`: their end by themselves.
        publisher: tells a broker of them; None where the configuration names none.
    """

    def __init__(
        self,
        setups: Mapping[str, DeviceSetup],
        directory: Path,
        *,
        clock: Clock | None = None,
        site: dict[str, str] | None = None,
        queue_s: float = 10.0,
        disk: DiskGuard | None = None,
        retention: Policy | None = None,
        calibrator: Calibrator = calibrate_capture,
    ) -> None:
        self._clock = clock or SystemClock()
        self._disk = disk or DiskGuard()
        turns = FairLock()
        self.instruments = {
            name: Instrument(
                setup,
                self._clock,
                site=site,
                queue_s=queue_s,
                disk=self._disk,
                on_sealed=self._sealed,
                turns=turns,
            )
            for name, setup in setups.items()
        }
        self.annotations = AnnotationStore(directory / "state.sqlite")
        said = self.annotations
        self.archive = Archive(directory / "captures", self._sessions, self._waiting, said.get, said.all)
        self.orders = CaptureControl(self.instruments, self.archive, said, self._disk, self._clock)
        self.calibrations = CalibrationCatalog(directory / "calibrations", _configured(setups))
        self._state_store = StateStore(directory / "state.sqlite")
        self.access = Access(directory, self._clock)
        self.settings = Settings(self._state_store, self.instruments)
        self.configuration = _configuration(setups)
        self.active = ActiveCalibrations(self.calibrations, self._state_store, self.instruments, self._clock)
        self.calibrator = calibrator
        self.jobs = JobRunner(self._clock)
        self.analyses = AnalysisStore(directory / "analyses")
        self.keeping = CaptureAnnotations(self.archive, self.annotations, self.jobs, self.analyses)
        self.idempotency = Idempotency(directory, self._clock)
        self.retention = Retention(
            self.archive,
            retention or Policy(),
            self._disk,
            self._clock,
            self.keeping.spared,
            self.keeping.delete,
        )
        self.publisher: Publishes | None = None
        self._started = False

    @property
    def clock(self) -> Clock:
        """The clocks that it reads."""
        return self._clock

    @classmethod
    def from_config(cls, config: Config, setups: Mapping[str, DeviceSetup]) -> "Service":
        """The service that a configuration describes."""
        service = cls(
            setups,
            config.state_directory,
            site=dict(config.site),
            queue_s=config.storage.queue_s,
            disk=DiskGuard(round(config.storage.reserve_gb * GB)),
            retention=Policy.from_config(config.storage.retention),
        )
        service.configuration = without_secrets(config.model_dump(mode="json"))
        service.publisher = publisher_of(config, service.archive, service.state, service.clock)
        return service

    def start(self) -> None:
        """Seals what a crash left, then starts all instruments; does nothing the second time.

        Raises:
            StorageError: the state directory cannot be used.
        """
        if self._started:
            return
        self.archive.open()
        self.open_stores()
        self.access.key.make()
        self._started = True
        self.jobs.start()
        self.retention.start()
        if self.publisher is not None:
            self.publisher.start()
        for instrument in self.instruments.values():
            instrument.start()

    def open_stores(self) -> None:
        """Takes up the calibrations and what was chosen among them.

        Raises:
            StorageError: the state directory cannot be used.
        """
        self.calibrations.open()
        self.analyses.open()
        self._state_store.open()
        self.access.open()
        self.settings.open()
        self.active.open()

    def stop(self) -> None:
        """Ends and seals running captures, then stops everything."""
        self.retention.stop()
        for session in self._sessions():
            session.stop("the daemon stopped")  # all at the same moment, before any of them is waited for
        for instrument in self.instruments.values():
            instrument.stop()
        if self.publisher is not None:
            self.publisher.stop()
        self.jobs.stop()
        self.access.key.remove()
        self.archive.close()

    def instrument(self, name: str | None) -> Instrument:
        """An instrument by its device's name, which may be left out where there is one.

        Raises:
            NotFound: there is none of that name, or the name is needed.
        """
        if name is None and len(self.instruments) == 1:
            return next(iter(self.instruments.values()))
        if name is None or name not in self.instruments:
            said = "no device is named" if name is None else f"no device {name!r}"
            raise NotFound(said, f"name one of: {', '.join(self.instruments)}")
        return self.instruments[name]

    def rate_hz(self, device: str | None) -> float:
        """Fields a second of a device."""
        return self.instrument(device).rate_hz

    def start_capture(self, device: str | None, request: CaptureRequest) -> str:
        """Starts a capture of one device and returns its id; see `CaptureControl.start`."""
        return self.orders.start(self.instrument(device), request)

    def arm_capture(self, device: str | None, request: CaptureRequest) -> str:
        """Arms a capture of one device and returns its id; errors as `CaptureControl.arm`, and NotFound."""
        return self.orders.arm(self.instrument(device), request)

    def stop_capture(self, capture_id: str) -> None:
        """Ends a running or armed capture; errors as `CaptureControl.stop`."""
        self.orders.stop(capture_id)

    def import_calibration(self, document: Mapping[str, Any], device: str | None, note: str) -> str:
        """Stores a complete calibration that fits a device, and returns its id.

        Raises:
            NotFound: there is no such device.
            InputError: it is no calibration; CalibrationMismatch: it is one of another rig or stream.
            Conflict: there is one of that id.
        """
        instrument = self.instrument(device)
        instrument.check_fits(Calibration.from_document(document))
        stored_utc = iso_utc(self._clock.utc_now())
        return self.calibrations.add(document, CalibrationRecord(instrument.name, "import", stored_utc, note))

    def activate_calibration(self, calibration_id: str, device: str | None) -> None:
        """Has a device measure with a calibration from the next field on.

        Raises:
            NotFound, CalibrationMismatch, CaptureRunning: see `ActiveCalibrations.activate`.
        """
        self.active.activate(calibration_id, self.instrument(device))

    def state(self) -> StateDocument:
        """State of the devices, the disk and the daemon at a glance."""
        return StateDocument(
            version=__version__,
            devices={name: self.device_document(one) for name, one in self.instruments.items()},
            storage=self.storage_document(),
            mqtt=self.publisher.document() if self.publisher else None,
        )

    def storage_document(self) -> StorageDocument:
        """The disk at this moment, and what has been removed from it since the start."""
        return self._disk.document(
            self.archive.directory,
            sum(instrument.bytes_per_s for instrument in self.instruments.values()),
            removed=self.retention.removed,
            removed_bytes=self.retention.removed_bytes,
        )

    def device_document(self, instrument: Instrument) -> DeviceDocument:
        """A device at this moment."""
        return device_document(instrument, self.active)

    def _waiting(self) -> list[ArmedCapture]:
        """The captures that are armed."""
        return [one.waiting for one in self.instruments.values() if one.waiting is not None]

    def _sessions(self) -> list[Recording]:
        """The captures that are being recorded or sealed, or could not be sealed."""
        sessions = (instrument.session for instrument in self.instruments.values())
        return [session for session in sessions if session is not None and not session.is_sealed]

    def _sealed(self, session: Recording) -> None:
        self._enter_in_index(session)
        if session.failure is not None:
            log.error("capture %s: %s; %s", session.id, session.failure.message, session.failure.hint)
        words = session.recorder.ledger.in_words(NOMINAL_RATE_HZ)
        log.info("capture %s has ended, %s; received: %s", session.id, session.verdict, words)

    def _enter_in_index(self, session: Recording) -> None:
        """A disk that lets nobody write has no say in whether the capture has ended."""
        try:
            self.archive.index.add(session.path)
        except StorageError as error:
            log.error("capture %s is not in the index: %s; %s", session.id, error.message, error.hint)
        if self.publisher is not None:
            self.publisher.notice()


def _configuration(setups: Mapping[str, DeviceSetup]) -> dict[str, Any]:
    devices = {name: setup.config.model_dump(mode="json") for name, setup in setups.items()}
    return {"devices": without_secrets(devices)}


def _configured(setups: Mapping[str, DeviceSetup]) -> dict[str, Mapping[str, Any]]:
    documents = ((name, setup.documents.get("calibration")) for name, setup in setups.items())
    return {name: document for name, document in documents if document}
