"""All instruments, their captures and the jobs: what HTTP and the command line stand on."""

import logging
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any

from grabberd import __version__
from grabberd.acquisition import Outcome
from grabberd.config import Config
from grabberd.errors import Conflict, NotFound
from grabberd.service.archive import Archive
from grabberd.service.clock import Clock, SystemClock
from grabberd.service.instrument import NOMINAL_RATE_HZ, Instrument
from grabberd.service.jobs import Job, JobRunner
from grabberd.service.measuring import measure_file
from grabberd.service.recorder import CaptureRequest
from grabberd.service.session import CaptureSession
from grabberd.service.setup import DeviceSetup
from grabberd.service.worker import Worker

log = logging.getLogger(__name__)

LATENCY_OF_LATEST = 500


class Service:
    """Everything that runs; `start` and `stop` frame its life.

    Attributes:
        instruments: by the name of their device.
        archive: the captures.
        jobs: what takes long.
    """

    def __init__(
        self,
        setups: Mapping[str, DeviceSetup],
        directory: Path,
        *,
        clock: Clock | None = None,
        site: dict[str, str] | None = None,
        queue_s: float = 10.0,
    ) -> None:
        self._clock = clock or SystemClock()
        self.instruments = {
            name: Instrument(setup, self._clock, site=site, queue_s=queue_s, on_sealed=self._sealed)
            for name, setup in setups.items()
        }
        self.archive = Archive(directory / "captures", self._sessions)
        self.jobs = JobRunner(self._clock)
        self._started = False

    @classmethod
    def from_config(cls, config: Config, setups: Mapping[str, DeviceSetup]) -> "Service":
        """The service that a configuration describes."""
        return cls(setups, config.state_directory, site=dict(config.site), queue_s=config.storage.queue_s)

    def start(self) -> None:
        """Seals what a crash left, then starts all instruments; does nothing the second time.

        Raises:
            StorageError: the state directory cannot be used.
        """
        if self._started:
            return
        self.archive.open()
        self._started = True
        self.jobs.start()
        for instrument in self.instruments.values():
            instrument.start()

    def stop(self) -> None:
        """Ends and seals running captures, then stops everything."""
        for instrument in self.instruments.values():
            instrument.stop()
        self.jobs.stop()
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
        """Starts a capture and returns its id.

        Raises:
            NotFound, CaptureRunning, NotReady, StorageError: see `Instrument.start_capture`.
        """
        instrument = self.instrument(device)
        moment = self._clock.utc_now()
        capture_id = f"{moment:%Y%m%dT%H%M%S}{moment.microsecond // 1000:03d}Z-{instrument.name}"
        instrument.start_capture(capture_id, request, self.archive.part_of(capture_id))
        return capture_id

    def stop_capture(self, capture_id: str) -> None:
        """Ends the recording of a running capture.

        Raises:
            NotFound: there is none of that id.
            Conflict: it is not running.
        """
        for session in self._sessions():
            if session.id == capture_id:
                session.stop("stopped by the operator")
                return
        self.archive.index.get(capture_id)
        raise Conflict(f"capture {capture_id} is not running", "it has ended already")

    def measure(self, capture_id: str) -> Job:
        """Queues the measuring of a sealed capture with its device's present calibration.

        Raises:
            NotFound, Conflict: there is none of that id, or it is still running.
        """
        path = self.archive.sealed_path(capture_id)
        device = self.archive.document(capture_id)["device"]
        made_with = self.instrument(device).made_with
        return self.jobs.submit("measure", capture_id, measure_file, path=path, made_with=made_with)

    def state(self) -> dict[str, Any]:
        """Everything that a glance needs."""
        return {
            "version": __version__,
            "devices": {name: self.device_document(one) for name, one in self.instruments.items()},
            "storage": {"free_bytes": self.archive.free_bytes},
        }

    def device_document(self, instrument: Instrument) -> dict[str, Any]:
        """A device as it is shown."""
        status = instrument.board.now
        armed = instrument.intake.armed
        measuring = instrument.setup.measuring
        session = instrument.running
        return {
            "name": instrument.name,
            "state": status.state,
            "since_utc": status.since_utc,
            "cause": status.cause,
            "driver": instrument.setup.config.driver,
            "stream": asdict(status.stream) if status.stream else None,
            "signal": status.signal,
            "fields": {outcome: status.outcomes[outcome] for outcome in Outcome},
            "openings": status.openings,
            "ring": {
                "slots": armed.ring.slots,
                "bits": armed.bits,
                "lines": armed.lines,
                "threshold": instrument.intake.threshold,
            },
            "calibration": measuring.calibration.id if measuring else None,
            "capture_id": session.id if session else None,
            "live": _live_document(instrument.worker),
        }

    def _sessions(self) -> list[CaptureSession]:
        """The captures that are being recorded or sealed."""
        sessions = (instrument.session for instrument in self.instruments.values())
        return [session for session in sessions if session is not None and not session.sealed.is_set()]

    def _sealed(self, session: CaptureSession) -> None:
        self.archive.index.add(session.path)
        if session.failure is not None:
            log.error("capture %s: %s; %s", session.id, session.failure.message, session.failure.hint)
        verdict = "complete" if session.complete else "incomplete"
        words = session.recorder.ledger.in_words(NOMINAL_RATE_HZ)
        log.info("capture %s has ended, %s; received: %s", session.id, verdict, words)


def _live_document(worker: Worker | None) -> dict[str, Any] | None:
    live = worker.live if worker else None
    if worker is None or live is None:
        return None
    residual = live.measured.points.residual_px
    return {
        "n": live.measured.n,
        "blobs": len(live.measured.blobs),
        "points": len(live.measured.points),
        "residual_px": float((residual**2).mean() ** 0.5) if len(residual) else None,
        "latency_ms": worker.latency.percentiles_ms(LATENCY_OF_LATEST),
    }
