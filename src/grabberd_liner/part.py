"""The liner science in a running daemon: its stores, and what follows the seal of a capture."""

from collections.abc import Collection, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import cast

from grabberd.archive.state.state_keeper import STATE
from grabberd.documents.jobs import JobDocument
from grabberd.server.daemon.service import Service, ServicePart
from grabberd_liner.analyses.capture_analyses import CaptureAnalyses, SealedAnalyses
from grabberd_liner.analyses.store import AnalysisStore
from grabberd_liner.guided_tests.liner_tests import LinerTests
from grabberd_liner.guided_tests.store import LinerTestStore
from grabberd_liner.profiles.profiles import Profiles, problems_in_process

NAME = "liner"
"""Name of the extension."""


class LinerPart(ServicePart):
    """Analyses, guided tests and profiles of a daemon; see `ServicePart`.

    Args:
        service: The daemon.

    Attributes:
        folders: Folders of analyses and guided tests.
        profiles: Profiles of liners, pulsators, cups and cows.
        analyses: Analyses of the captures' points.
        liner_tests: Guided tests of liners.
        capture_analyses: The latest of each capture, and of each device.
        sealed_analyses: Queues analyses and tests of captures that are sealed.
    """

    def __init__(self, service: Service) -> None:
        state = service.directory / STATE
        self._jobs = service.jobs
        self.profiles = Profiles(
            state, partial(problems_in_process, service.processes), service.clock, service.state_keeper.heal
        )
        self.analyses = AnalysisStore(service.directory / "analyses")
        tests = LinerTestStore(service.directory / "tests")
        self.folders: Mapping[str, Path] = {"analyses": self.analyses.directory, "tests": tests.directory}
        self.liner_tests = LinerTests(tests, service.archive, self.profiles)
        self.capture_analyses = CaptureAnalyses(self.analyses, service.jobs, service.archive.index)
        self.sealed_analyses = SealedAnalyses(
            service.jobs,
            service.archive,
            self.capture_analyses,
            service.state_store,
            service.setups,
            self.profiles,
            service.clock,
        )

    def open(self) -> None:
        """See `ServicePart`."""
        self.analyses.open()
        self.liner_tests.store.open()
        self.profiles.open()
        self.sealed_analyses.open()

    def start(self) -> None:
        """See `ServicePart`."""
        self.capture_analyses.open(reversed(self._jobs.list()))
        self.liner_tests.open(reversed(self._jobs.list()))

    def capture_fields(self, capture_id: str) -> Mapping[str, object]:
        """See `ServicePart`."""
        return {"analysis": self.capture_analyses.of(capture_id)}

    def device_fields(self, device: str) -> Mapping[str, object]:
        """See `ServicePart`."""
        return {
            "latest_analysis": self.capture_analyses.latest.get(device),
            "latest_test": self.liner_tests.latest.get(device),
        }

    def analysed(self, captures: Collection[str] | None) -> Collection[str]:
        """See `ServicePart`."""
        return self.analyses.among(captures)

    def sealed(self, capture_id: str, device: str) -> None:
        """See `ServicePart`."""
        self.sealed_analyses.sealed(capture_id, device)

    def job_ended(self, job: JobDocument, captures: Sequence[str]) -> None:
        """See `ServicePart`."""
        self.capture_analyses.ended(captures)
        self.liner_tests.ended(job)

    def removed(self, capture_id: str) -> None:
        """See `ServicePart`."""
        self.analyses.remove(capture_id)

    def look(self) -> None:
        """See `ServicePart`."""
        self.sealed_analyses.look()

    def keep(self) -> None:
        """See `ServicePart`."""
        self.sealed_analyses.keep()


def liner_of(service: Service) -> LinerPart:
    """The liner science's part of a daemon that has it."""
    return cast("LinerPart", service.parts[NAME])
