"""A device whose captures are analysed when they are sealed, and a barn of them."""

from collections.abc import Collection, Mapping
from pathlib import Path
from typing import Any

import yaml
from queued_jobs import Jobs, jobs_in
from running import configuration
from slots import ManualClock

from archive.milkings import milking
from core.chain.milking import still
from grabberd.archive.catalogue.archive import Archive
from grabberd.archive.state.state_database import StateStore
from grabberd.config import AnalysisConfig, default_config_file
from grabberd.documents.document import JsonObject
from grabberd.documents.enums import JobState
from grabberd.instrument.setup import DeviceSetup, set_up
from grabberd_liner.analyses.capture_analyses import CaptureAnalyses, SealedAnalyses
from grabberd_liner.analyses.store import AnalysisStore
from grabberd_liner.profiles.profiles import Profiles

DEVICE = "simulated"
SHAPE = {"heights_mm": [0]}


def setups_of(folder: Path, inputs: JsonObject | None = None, **analysis: Any) -> dict[str, DeviceSetup]:
    """The simulated device, whose captures are analysed when sealed unless something else is said."""
    file = folder / "inputs.yaml"
    file.write_text(yaml.safe_dump(SHAPE if inputs is None else inputs))
    config = AnalysisConfig(**{"when_sealed": True, "inputs": file, **analysis})
    return set_up(configuration({}, analysis=config), default_config_file())


class Barn:
    """A state directory with what looks after its captures, as one start of a daemon has it."""

    def fields(self, capture_id: str) -> Mapping[str, object]:
        """What the analyses add to a capture's document."""
        return {"analysis": self.analyses.of(capture_id)}

    def analysed(self, captures: Collection[str] | None) -> Collection[str]:
        """The captures that have an analysis."""
        return self.store.among(captures)

    def __init__(
        self, folder: Path, clock: ManualClock, setups: dict[str, DeviceSetup] | None = None
    ) -> None:
        self.seconds = 0.0
        self.clock = clock
        self.captures = folder / "captures"
        self.captures.mkdir(exist_ok=True)
        self.jobs: Jobs = jobs_in(folder, clock=clock)
        self.archive = Archive(self.captures, list, results=self)
        self.archive.index.rebuild()
        self.store = AnalysisStore(folder / "analyses")
        self.store.open()
        self.analyses = CaptureAnalyses(self.store, self.jobs.queue, self.archive.index)
        settings = StateStore(folder / "state.sqlite")
        settings.open()
        self.profiles = Profiles(folder / "state.sqlite", lambda document: [], clock)
        self.profiles.open()
        self.sealing = SealedAnalyses(
            self.jobs.queue,
            self.archive,
            self.analyses,
            settings,
            setups_of(folder) if setups is None else setups,
            self.profiles,
            clock,
            lambda: self.seconds,
        )
        self.sealing.open()

    def seal(self, name: str, *, told: bool = True, **changes: Any) -> None:
        """A capture with points comes into being."""
        created = changes.pop("created_utc", f"{self.clock.utc_now():%FT%TZ}")
        path = milking(self.captures, still(2), name, created_utc=created, device={"name": DEVICE}, **changes)
        self.archive.index.add(path)
        if told:
            self.sealing.sealed(name, DEVICE)

    @property
    def queued(self) -> list[str]:
        """Captures that wait, in order."""
        return [job.subject for job in reversed(self.jobs.queue.list()) if job.state is JobState.QUEUED]
