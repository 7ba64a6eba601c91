"""The whole daemon in a world: started, asked by clients, killed and started again.

Everything of `Service` is the program's own; HTTP is left out, clients call what its routes call. Two things
are stand-ins: the grabber (`camera.py`), and the work of a job, which takes time and leaves a line in the
world's record. There is no calibration, so that no points are measured: the core has tests of its own.
"""

import gc
from collections.abc import Callable, Mapping
from typing import Any, ClassVar, TypeVar

from tests.proofs.world.camera import COLUMNS, ROWS, Camera
from tests.proofs.world.computer import Computer
from tests.proofs.world.scheduler import Killed

from grabberd import runtime
from grabberd.archive.catalogue.disk_guard import GB, DiskGuard
from grabberd.config import DeviceConfig
from grabberd.documents.jobs import MeasurementResult
from grabberd.errors import GrabberdError
from grabberd.instrument.channels.logger_setup import LoggerSetup
from grabberd.instrument.setup import DeviceSetup
from grabberd.runtime import SystemClock
from grabberd.server.daemon import jobs as daemon_jobs
from grabberd.server.daemon.service import Service
from grabberd.work.job_spec import JobContext, JobSpec, Progress

T = TypeVar("T")
CONFIG = DeviceConfig(
    driver="world",
    rig={
        "columns": COLUMNS,
        "lines": 2 * ROWS,
        "views": {
            "left": {"first_column": 0, "end_column": 32},
            "right": {"first_column": 32, "end_column": 64},
        },
    },
    ring={"bits": 1, "lines": "field"},
    threshold={"kind": "fixed", "value": 127},
)


class WorldClock(SystemClock):
    """The world's clocks; of another type than the computer's own, whose accounting is real."""


class Gone(Exception):
    """The daemon has crashed before it answered."""


class WorldJob(JobSpec):
    """A job whose work is to take time."""

    kind: ClassVar[str] = "world"
    seconds: float
    begun: ClassVar[Callable[[str], None]] = lambda job: None
    done: ClassVar[Callable[[str], None]] = lambda job: None

    def run(self, progress: Progress, context: JobContext) -> MeasurementResult:
        type(self).begun(context.job)
        for step in range(4):
            runtime.sleep(self.seconds / 4)
            progress((step + 1) / 4)
        type(self).done(context.job)
        return MeasurementResult(run=1, fields=1, points=0)


class Daemon:
    """A daemon of the world.

    Args:
        computer: Its computer; the folder of the disk is the state directory.
        cameras: Its cameras, by name.
        loggers: Its loggers, by name.

    Attributes:
        service: The service; None while there is none.
        free_bytes: Of the disk.
        starts: How often it was started.
    """

    def __init__(
        self,
        computer: Computer,
        cameras: Mapping[str, Camera],
        loggers: Mapping[str, LoggerSetup] | None = None,
    ) -> None:
        self._computer, self.cameras, self._loggers = computer, cameras, loggers or {}
        self.service: Service | None = None
        self.free_bytes = 100 * GB
        self.starts = 0
        daemon_jobs.KINDS.setdefault("world", WorldJob)  # type: ignore[attr-defined]

    def start(self) -> Exception | None:
        """Starts it; returns why that was refused."""
        self.starts += 1

        def make() -> Service:
            setups = {name: DeviceSetup(name, CONFIG, one, None, {}) for name, one in self.cameras.items()}
            disk = DiskGuard(free=lambda folder: self.free_bytes)
            service = Service(
                setups, self._computer.disk.folder, clock=WorldClock(), disk=disk, loggers=self._loggers
            )
            service.start()
            return service

        try:
            self.service = self.call(make)
        except (GrabberdError, Gone) as error:
            self.die(power_cut=False)  # the process ends, and with it all that had begun
            return error
        return None

    def call(self, what: Callable[[], T]) -> T:
        """What a client gets from the daemon, in a thread of the daemon.

        Raises:
            Gone: It has crashed before.
            Exception: As it answers.
        """
        computer = self._computer
        answer: dict[str, Any] = {}
        answered = computer.event()

        def handle() -> None:
            try:
                answer["value"] = what()
            except Killed:
                answer["error"] = Gone()
                raise
            except Exception as error:
                answer["error"] = error
            finally:
                answered.set()

        computer.spawn(handle, "client's call", is_daemons=True)
        answered.wait()
        if "error" in answer:
            raise answer["error"]
        return answer["value"]

    def stop(self) -> None:
        """Stops it as systemd does."""
        service, self.service = self.service, None
        if service is not None:
            try:
                self.call(service.stop)
            except GrabberdError:  # likewise
                self.die(power_cut=False)

    def die(self, *, power_cut: bool) -> None:
        """Ends all of its threads, and makes the disk what that has left."""
        computer = self._computer
        computer.disk.crash()
        computer.halts = True
        computer.kill([one for one in computer.tasks.values() if one.is_daemons])
        self.service = None
        computer.close_all()
        for camera in self.cameras.values():
            camera.close()
        gc.collect()
        computer.halts = False
        computer.disk.restart(power_cut=power_cut)
