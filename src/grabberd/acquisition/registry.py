"""Registry of drivers: packages with an entry point in the group `grabberd.drivers`, by name."""

import inspect
from collections.abc import Callable, Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Any, cast

from grabberd.acquisition.device import Grabber
from grabberd.errors import DriverMissing

GROUP = "grabberd.drivers"


def available() -> tuple[str, ...]:
    """List the names of the installed drivers, sorted, without importing any."""
    return tuple(sorted({entry.name for entry in entry_points(group=GROUP)}))


def create(driver: str, options: Mapping[str, Any]) -> Grabber:
    """Create a grabber, not yet opened.

    Raises:
        DriverMissing: No driver of that name is installed, or a package it needs is missing.
        ValueError: An option is unknown, missing or unusable; the message says which.
    """
    factory = _load(_find(driver))
    _check_names(driver, factory, options)
    return factory(**options)


def _find(driver: str) -> EntryPoint:
    found = [entry for entry in entry_points(group=GROUP) if entry.name == driver]
    if not found:
        names = ", ".join(available()) or "none at all"
        raise DriverMissing(
            f"there is no driver '{driver}'; installed are: {names}",
            f"correct the name, or install the package that offers '{driver}' in the entry point group "
            f"'{GROUP}' into the same Python environment",
        )
    return found[0]


def _load(entry: EntryPoint) -> Callable[..., Grabber]:
    try:
        return cast("Callable[..., Grabber]", entry.load())
    except ImportError as error:
        missing = error.name or str(error)
        raise DriverMissing(
            f"driver '{entry.name}' cannot be imported: {error}",
            f"install '{missing}' into the same Python environment",
        ) from error
    except AttributeError as error:
        raise DriverMissing(
            f"driver '{entry.name}' is not where its package says ({entry.value}): {error}",
            "reinstall the driver's package",
        ) from error


def _check_names(driver: str, factory: Callable[..., Grabber], options: Mapping[str, Any]) -> None:
    signature = inspect.signature(factory)
    try:
        signature.bind(**options)
    except TypeError as error:
        known = ", ".join(signature.parameters) or "none"
        raise ValueError(f"driver '{driver}': {error}; its options are: {known}") from error
