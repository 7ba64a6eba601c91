"""The service: all instruments, their captures, the jobs and the parts of extensions."""

import logging
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from types import MappingProxyType
from typing import Any, Protocol

from grabberd import __version__
from grabberd.archive.access import Access
from grabberd.archive.calibrations.calibration_catalog import CalibrationCatalog, Document
from grabberd.archive.capture.captures_folder import CapturesFolder
from grabberd.archive.catalogue.archive import Archive, CaptureAnnotations
from grabberd.archive.catalogue.capture_list import WidthCourses
from grabberd.archive.catalogue.disk_guard import GB, DiskGuard, Policy, Retention
from grabberd.archive.catalogue.scrub import Scrub
from grabberd.archive.state.calibration_store import CalibrationRecord
from grabberd.archive.state.job_store import JobStore
from grabberd.archive.state.state_database import AnnotationStore, IdempotencyStore, StateStore
from grabberd.archive.state.state_keeper import CAPTURES_FOLDER, STATE, StateKeeper
from grabberd.config import Config, StorageConfig, default_config_file
from grabberd.config.section import without_secrets
from grabberd.core.geometry import Calibration
from grabberd.core.kernel import what_is_slower
from grabberd.documents.devices import DeviceDocument
from grabberd.documents.jobs import JobDocument
from grabberd.documents.state import StateDocument, StorageDocument
from grabberd.errors import ConfigError, Problem, StorageError
from grabberd.extension import extensions, load
from grabberd.fault_board import FaultBoard
from grabberd.instrument.active_calibrations import ActiveCalibrations
from grabberd.instrument.capture.capture_control import CaptureControl
from grabberd.instrument.capture.device_captures import CurrentCaptures, of_device
from grabberd.instrument.capture.recording import Recording
from grabberd.instrument.capture_end import CaptureEnd
from grabberd.instrument.channels.logger_setup import LoggerSetup
from grabberd.instrument.channels.loggers import Loggers
from grabberd.instrument.device.status_board import Liveness
from grabberd.instrument.device.worker import FairLock
from grabberd.instrument.instrument import Instrument
from grabberd.instrument.live.health import Surroundings
from grabberd.instrument.live.state import device_document
from grabberd.instrument.settings import Settings, configuration_document
from grabberd.instrument.setup import DeviceSetup, configured_calibrations
from grabberd.runtime import SystemClock, UtcClock, iso_utc
from grabberd.server.daemon.jobs import KINDS, JobContexts
from grabberd.server.daemon.upkeep import STATE_EVERY, Upkeep
from grabberd.work.job_queue import JobQueue
from grabberd.work.job_runner import JobRunner
from grabberd.work.process import Processes


class ServicePart:
    """Stores and state of an extension, and its reactions to events of captures and jobs.

    Every method does nothing by default.

    Attributes:
        folders: Folders for the results of its jobs, by the names that the jobs use.
    """

    folders: Mapping[str, Path] = MappingProxyType({})

    def open(self) -> None:
        """Opens its stores; their folders and the database already exist.

        Raises:
            StorageError: The state directory cannot be used.
        """

    def start(self) -> None:
        """Takes over the jobs of the previous run, just before captures can start."""

    def stop(self) -> None:
        """Stops what it has started; all captures and threads of the service have ended."""

    def capture_fields(self, capture_id: str) -> Mapping[str, object]:
        """Its fields of a capture's document."""
        return {}

    def device_fields(self, device: str) -> Mapping[str, object]:
        """Its fields of a device's document, from memory: reading the state never waits for a disk."""
        return {}

    def state_fields(self) -> Mapping[str, object]:
        """Its fields of the service's state, from memory."""
        return {}

    def analysed(self, captures: Collection[str] | None) -> Collection[str]:
        """The captures for which it has results, among these or, with None, among all."""
        return ()

    def sealed(self, capture_id: str, device: str) -> None:
        """Called when a capture is sealed; must return at once."""

    def job_ended(self, job: JobDocument, captures: Sequence[str]) -> None:
        """Called when a job has ended, with the captures that it should have analysed."""

    def removed(self, capture_id: str) -> None:
        """Removes its results for a capture that is being deleted.

        Raises:
            StorageError: They cannot be removed.
        """

    def look(self) -> None:
        """Does its periodic work; called once a second."""

    def keep(self) -> None:
        """Stores its active state again after the state database was recovered from a backup.

        Raises:
            StorageError: The state cannot be written.
        """


class ServiceParts(dict[str, ServicePart]):
    """The parts of all extensions, by the extension's name; empty until `make` is called."""

    def make(self, service: Any) -> None:
        """Creates the parts for a `Service` whose stores and archive exist."""
        self.update((one.name, load(one.part)(service)) for one in extensions() if one.part)

    @property
    def folders(self) -> dict[str, Path]:
        """Folders for the results of extensions' jobs."""
        return {name: folder for part in self.values() for name, folder in part.folders.items()}

    def state_fields(self) -> dict[str, object]:
        """Fields that they add to the service's state."""
        return {name: value for part in self.values() for name, value in part.state_fields().items()}

    def fields(self, capture_id: str) -> dict[str, object]:
        """Fields that they add to a capture's document."""
        return {
            name: value for part in self.values() for name, value in part.capture_fields(capture_id).items()
        }

    def device_fields(self, device: str) -> dict[str, object]:
        """Fields that they add to a device's document."""
        return {name: value for part in self.values() for name, value in part.device_fields(device).items()}

    def analysed(self, captures: Collection[str] | None) -> set[str]:
        """The captures for which any of them has results, among these or, with None, among all."""
        return {one for part in self.values() for one in part.analysed(captures)}


log = logging.getLogger(__name__)


class _Threads(Protocol):
    """One or more threads of the daemon."""

    def start(self) -> None: ...

    def stop(self) -> None: ...


class Service:
    """The daemon without its server: instruments, archive, jobs and stores; it runs from `start` to `stop`.

    Attributes:
        clock: Source of time.
        instruments: The instruments, by the name of their device.
        loggers: The data loggers.
        liveness: Finds capture threads that hang.
        capture_control: Starts, arms, triggers and stops captures.
        archive: The captures on disk.
        annotations: Pins, notes and labels of captures, and manual deletion.
        retention: Automatic deletion of old captures, if configured.
        job_contexts: Paths of a job's captures and folders for its results.
        width_courses: A short curve of the wall's width for each capture.
        calibrations: All calibrations.
        active: The calibration that each device measures with.
        access: Tokens and browser sessions.
        faults: Present faults of the daemon itself.
        state_keeper: Backs up and recovers the state database.
        unsealed: Captures whose files could not be sealed yet.
        upkeep: Checks all of these periodically.
        settings: Settings that an operator has made, overriding the configuration.
        configuration: The configuration as it was read, without secrets.
        jobs: The waiting, running and ended jobs.
        job_runner: Runs them.
        processes: Processes that answer questions which need the core.
        idempotency: Requests that must take effect only once.
        parts: The parts of extensions, by the extension's name.
        directory: The state directory.
        state_store: Settings and choices in the state database.
        setups: The devices as configured.
        config: The configuration and its file; None if the service was made without one.
    """

    def __init__(
        self,
        setups: Mapping[str, DeviceSetup],
        directory: Path,
        *,
        clock: UtcClock | None = None,
        disk: DiskGuard | None = None,
        loggers: Mapping[str, LoggerSetup] | None = None,
        config: tuple[Config, Path] | None = None,
    ) -> None:
        self.clock = clock = clock or SystemClock()
        self.directory, self.setups, self.config = directory, setups, config
        self.configuration = (
            without_secrets(config[0].model_dump(mode="json")) if config else configuration_document(setups)
        )
        self.faults = faults = FaultBoard(clock)
        self.processes = Processes()
        self.parts = ServiceParts()

        self.state_keeper = StateKeeper(directory, faults, clock, self._store_again)
        state, heal = directory / STATE, self.state_keeper.heal
        self.state_store, annotations = StateStore(state, heal), AnnotationStore(state, heal)
        self.idempotency, self.access = IdempotencyStore(state, heal), Access(directory, clock, heal)

        storage = config[0].storage if config else StorageConfig()
        self._disk = disk or DiskGuard(round(storage.reserve_gb * GB))
        self.loggers = Loggers(loggers or {}, clock, faults)
        self.instruments = self._instruments(storage.queue_s)
        self.liveness = Liveness(one.board for one in self.instruments.values())
        self._current = CurrentCaptures({name: one.captures for name, one in self.instruments.items()})
        self.settings = Settings(self.state_store, self.instruments)
        self.calibrations = CalibrationCatalog(directory / "calibrations", configured_calibrations(setups))
        self.active = ActiveCalibrations(self.calibrations, self.state_store, self.instruments, clock)

        self.archive = self._archive(annotations)
        self._capture_end = CaptureEnd(self.archive, self.instruments, self._sealed, faults, clock)
        self.unsealed = self._capture_end.unsealed
        self.capture_control = CaptureControl(self._current, self.archive, annotations, clock)
        self.width_courses = WidthCourses(self.archive)

        job_store = JobStore(directory)
        self.jobs = JobQueue(clock, job_store, KINDS, faults, self._job_ended, self._interrupt)
        self.annotations = CaptureAnnotations(self.archive, annotations, self.jobs, self._remove_results)
        self.parts.make(self)
        self.job_contexts = JobContexts(self.archive, self.calibrations.store, self.parts.folders)

        self.job_runner = JobRunner(self.jobs, job_store, self.job_contexts.of, faults)
        policy, delete = Policy.from_config(storage.retention), self.annotations.delete
        self.retention = Retention(self.archive, policy, self._disk, clock, self._spared, delete)
        self.scrub = Scrub(self.archive, self.state_store, faults, clock, self._is_recording)
        self.upkeep = Upkeep(
            [
                (self._check_folder, 1),
                (self.unsealed.retry, 1),
                (self.loggers.look, 1),
                (self.state_keeper.look, STATE_EVERY),
                *((part.look, 1) for part in self.parts.values()),
                (self.width_courses.look, 1),
            ]
        )
        # In the order in which they are started; they are stopped in the reverse order.
        devices = self.instruments.values()
        self._threads: tuple[_Threads, ...] = (self.loggers, *devices, self.retention, self.scrub)
        self._started = False

    def _instruments(self, queue_s: float) -> dict[str, Instrument]:
        fair_lock = FairLock()
        return {
            name: Instrument(
                setup,
                self.clock,
                site=dict(self.config[0].site) if self.config else None,
                queue_s=queue_s,
                disk=self._disk,
                on_sealed=self._ended,
                fair_lock=fair_lock,
                loggers=self.loggers,
            )
            for name, setup in self.setups.items()
        }

    def _archive(self, annotations: AnnotationStore) -> Archive:
        folder = CapturesFolder(
            self.directory / "captures",
            lambda: self.state_store.get(CAPTURES_FOLDER),
            lambda found: self.state_store.put({CAPTURES_FOLDER: found}),
        )
        return Archive(
            folder.path,
            self.recordings,
            self._current.armed,
            annotations.get,
            annotations.all,
            self.parts,
            folder=folder,
            faults=self.faults,
        )

    @property
    def config_file(self) -> Path | None:
        """The configuration's file; None without one."""
        return self.config[1] if self.config else None

    @classmethod
    def from_config(
        cls,
        config: Config,
        setups: Mapping[str, DeviceSetup],
        loggers: Mapping[str, LoggerSetup] | None = None,
        file: Path | None = None,
    ) -> "Service":
        """Makes the service that a configuration describes.

        Raises:
            ConfigError: The configuration needs an extension that is not installed.
        """
        file = file or default_config_file()
        service = cls(setups, config.state_directory, loggers=loggers, config=(config, file))
        if config.mqtt is not None and "mqtt" not in service.parts:
            raise ConfigError([Problem(str(file), "mqtt", "the extension that publishes is not installed")])
        return service

    def start(self) -> None:
        """Seals what a crash left, then starts all threads; does nothing the second time.

        Raises:
            StorageError: The state directory cannot be used.
        """
        if self._started:
            return
        self.open()
        self.archive.open()
        self.open_stores()
        self.access.key.make()
        for part in self.parts.values():
            part.start()
        self._started = True
        if slower := what_is_slower():
            log.warning("%s", slower)
        self.upkeep.start()
        self.job_runner.start()
        for threads in self._threads:
            threads.start()

    def open(self) -> None:
        """Locks the state directory and opens its database, which holds the tokens; may be called twice.

        A second daemon fails here, before it changes anything.

        Raises:
            StorageError: The state directory cannot be used.
        """
        self.state_keeper.open()

    def open_stores(self) -> None:
        """Opens calibrations, jobs, tokens, settings and the stores of extensions; applies stored choices.

        Raises:
            StorageError: The state directory cannot be used.
        """
        self.calibrations.store.open()
        self.jobs.open()
        self.state_store.open()
        self.access.open()
        self.settings.open()
        self.active.open()
        for part in self.parts.values():
            part.open()

    def end_captures(self) -> None:
        """Ends running captures, all at the same moment; their files are then sealed in the background."""
        for recording in self._current.recordings():
            recording.stop("the daemon stopped")

    def stop(self) -> None:
        """Ends and seals running captures, then stops everything."""
        # First, all at once: sealing takes time, and no capture should last longer because of another.
        self.end_captures()
        for threads in reversed(self._threads):
            threads.stop()
        for part in self.parts.values():
            part.stop()
        self.job_runner.stop()
        self.processes.end()  # before the upkeep, which may wait for an answer of one
        self.upkeep.stop()
        self.access.key.remove()
        self.archive.close()
        self.state_keeper.close()  # last: it releases the state directory to another daemon

    def instrument(self, name: str | None) -> Instrument:
        """An instrument by its device's name, which may be None if there is only one.

        Raises:
            NotFound: No device has that name, or the name is needed.
        """
        return of_device(self.instruments, name)

    def import_calibration(self, document: Document, device: str | None, note: str) -> str:
        """Stores a complete calibration that fits a device, and returns its id.

        Raises:
            NotFound: The device does not exist.
            InputError: The document is not a calibration.
            CalibrationMismatch: The calibration is for another rig or stream.
            Conflict: A calibration with that id already exists.
        """
        instrument = self.instrument(device)
        instrument.check_fits(Calibration.from_document(document))
        stored_utc = iso_utc(self.clock.utc_now())
        return self.calibrations.add(document, CalibrationRecord(instrument.name, "import", stored_utc, note))

    def state(self) -> StateDocument:
        """State of the devices, the disk and the daemon at a glance."""
        around = self.surroundings()
        return StateDocument(
            version=__version__,
            devices={name: self.device_document(one, around) for name, one in self.instruments.items()},
            loggers=self.loggers.document(),
            storage=around.storage,
            faults=list(around.faults),
            **{"mqtt": None, **self.parts.state_fields()},
        )

    def storage_document(self) -> StorageDocument:
        """Present state of the disk, and what retention has removed since the start."""
        return self._disk.document(
            self.archive.directory,
            sum(instrument.captures.bytes_per_s for instrument in self.instruments.values()),
            check=self.archive.check,
            removed=self.retention.removed,
            removed_bytes=self.retention.removed_bytes,
        )

    def surroundings(self) -> Surroundings:
        """Present surroundings of all devices."""
        return Surroundings(self.storage_document(), self.faults.now, self.clock)

    def device_document(self, instrument: Instrument, around: Surroundings | None = None) -> DeviceDocument:
        """Present state of a device."""
        return device_document(
            instrument, self.active, around or self.surroundings(), self.parts.device_fields(instrument.name)
        )

    def recordings(self) -> list[Recording]:
        """The captures that are being recorded or sealed, or are not sealed yet."""
        current = self._current.recordings()
        return [*current, *(one for one in self.unsealed.captures if one not in current)]

    def _store_again(self) -> None:
        """Stores the active settings and choices again after the state was recovered from a backup."""
        self.archive.folder.identify()
        self.archive.library.note()
        self.settings.keep()
        self.active.keep()
        for part in self.parts.values():
            part.keep()

    def _check_folder(self) -> None:
        with suppress(StorageError):
            self.archive.check()

    def _is_recording(self) -> bool:
        return bool(self._current.recordings())

    def _spared(self) -> set[str]:
        if not self.state_keeper.pins_known:
            raise StorageError(
                "pins may have been lost with state.sqlite", "check them, then: grabberd storage accept"
            )
        return self.annotations.spared()

    def _ended(self, recording: Recording) -> None:
        self._capture_end.ended(recording)

    def _sealed(self, capture_id: str, device: str) -> None:
        self.width_courses.sealed(capture_id)
        for part in self.parts.values():
            part.sealed(capture_id, device)

    def _job_ended(self, job: JobDocument, captures: Sequence[str]) -> None:
        self.archive.ended(job.subject, captures)
        for part in self.parts.values():
            part.job_ended(job, captures)

    def _interrupt(self, number: int) -> None:
        self.job_runner.interrupt(number)

    def _remove_results(self, capture_id: str) -> None:
        for part in self.parts.values():
            part.removed(capture_id)
