"""The parts of the running daemon that extensions make."""

from collections.abc import Collection, Mapping, Sequence
from pathlib import Path
from types import MappingProxyType
from typing import Any

from grabberd.documents.jobs import JobDocument
from grabberd.extension import extensions, load


class ServicePart:
    """Stores and state of an extension, and what it does when something happens to captures and jobs.

    By itself it does nothing.

    Attributes:
        folders: Folders in which its jobs leave their results, by the name that the jobs know them by.
    """

    folders: Mapping[str, Path] = MappingProxyType({})

    def open(self) -> None:
        """Opens its stores, whose folders and database exist by now.

        Raises:
            StorageError: The state directory cannot be used.
        """

    def start(self) -> None:
        """Takes note of the jobs that are known from before, right before captures may begin."""

    def stop(self) -> None:
        """Stops what it has started; captures have ended by now."""

    def capture_fields(self, capture_id: str) -> Mapping[str, object]:
        """Its fields of a capture's document."""
        return {}

    def device_fields(self, device: str) -> Mapping[str, object]:
        """Its fields of a device's document, from memory: the state never waits for a disk."""
        return {}

    def state_fields(self) -> Mapping[str, object]:
        """Its fields of the service's state, from memory."""
        return {}

    def analysed(self, captures: Collection[str] | None) -> Collection[str]:
        """The captures that it has results of, among these or among all."""
        return ()

    def sealed(self, capture_id: str, device: str) -> None:
        """Takes note of a capture that is sealed; nobody waits for what follows from it."""

    def job_ended(self, job: JobDocument, captures: Sequence[str]) -> None:
        """Takes note of a job that has ended, and of the captures that it was to analyse."""

    def removed(self, capture_id: str) -> None:
        """Removes what it has kept of a capture that is deleted.

        Raises:
            StorageError: It cannot be removed.
        """

    def look(self) -> None:
        """Looks after what is its own; called once a second."""

    def keep(self) -> None:
        """Stores again what a recovered state database has lost, as far as it is known.

        Raises:
            StorageError: The state cannot be written.
        """


class ServiceParts(dict[str, ServicePart]):
    """The parts of all extensions by the extension's name; empty until the service has what they stand on."""

    def make(self, service: Any) -> None:
        """Makes the parts of a `Service`."""
        self.update((one.name, load(one.part)(service)) for one in extensions() if one.part)

    @property
    def folders(self) -> dict[str, Path]:
        """Folders in which jobs of extensions leave their results."""
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
        """The captures that any of them has results of, among these or among all."""
        return {one for part in self.values() for one in part.analysed(captures)}
