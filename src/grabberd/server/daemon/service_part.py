"""The parts that extensions contribute to the running daemon."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from grabberd.documents.jobs import JobDocument
from grabberd.extension import extensions, load


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
