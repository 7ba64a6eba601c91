"""Registries of what other packages bring: those with an entry point in a group of its own, by name.

Grabbers are found in the group `grabberd.drivers`, loggers in `grabberd.loggers`, locators, which are
functions and no devices, in `grabberd.locators`.
"""

import inspect
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import EntryPoint, entry_points
from typing import Any, Generic, TypeVar, cast

from grabberd.errors import DriverMissing

Driven = TypeVar("Driven")


@dataclass(frozen=True, slots=True)
class Registry(Generic[Driven]):
    """The installed drivers of one kind of device, or locators.

    Attributes:
        group: Group of their entry points.
        kind: What one of them is, in a word.
    """

    group: str
    kind: str = "driver"

    def available(self) -> tuple[str, ...]:
        """List the names of the installed drivers, sorted, without importing any."""
        return tuple(sorted({entry.name for entry in entry_points(group=self.group)}))

    def create(self, driver: str, options: Mapping[str, Any]) -> Driven:
        """Create a device, not yet opened.

        Raises:
            DriverMissing: No driver of that name is installed, or a package it needs is missing.
            ValueError: An option is unknown, missing or unusable; the message says which.
        """
        factory = cast("Callable[..., Driven]", self._load(self._find(driver)))
        _check_names(driver, factory, options)
        return factory(**options)

    def load(self, name: str) -> Driven:
        """Load what an entry point names, without calling it.

        Raises:
            DriverMissing: Nothing of that name is installed, or a package it needs is missing.
        """
        return cast("Driven", self._load(self._find(name)))

    def _find(self, driver: str) -> EntryPoint:
        found = [entry for entry in entry_points(group=self.group) if entry.name == driver]
        if not found:
            names = ", ".join(self.available()) or "none at all"
            raise DriverMissing(
                f"there is no {self.kind} '{driver}'; installed are: {names}",
                f"correct the name, or install the package that offers '{driver}' in the entry point group "
                f"'{self.group}' into the same Python environment",
            )
        return found[0]

    def _load(self, entry: EntryPoint) -> Any:
        try:
            return entry.load()
        except ImportError as error:
            missing = error.name or str(error)
            raise DriverMissing(
                f"{self.kind} '{entry.name}' cannot be imported: {error}",
                f"install '{missing}' into the same Python environment",
            ) from error
        except AttributeError as error:
            raise DriverMissing(
                f"{self.kind} '{entry.name}' is not where its package says ({entry.value}): {error}",
                "reinstall its package",
            ) from error


def _check_names(driver: str, factory: Callable[..., Any], options: Mapping[str, Any]) -> None:
    parameters = inspect.signature(factory).parameters
    if any(one.kind is inspect.Parameter.VAR_KEYWORD for one in parameters.values()):
        return  # it reads its options itself
    known = ", ".join(parameters) or "none"
    unknown = [name for name in options if name not in parameters]
    missing = [name for name, one in parameters.items() if one.default is one.empty and name not in options]
    problems = [f"{name}: driver '{driver}' has no such option; its options are: {known}" for name in unknown]
    problems += [f"{name}: missing; driver '{driver}' needs it; its options are: {known}" for name in missing]
    if problems:
        raise ValueError("\n".join(problems))
