"""Drivers by name: packages that offer themselves in the entry point group `grabberd.drivers`."""

import inspect
from collections.abc import Callable, Mapping
from importlib.metadata import EntryPoint, entry_points
from typing import Any, cast

from grabberd.acquisition.device import Grabber
from grabberd.errors import DriverMissing

GROUP = "grabberd.drivers"


def available() -> tuple[str, ...]:
    """Names of the installed drivers, sorted; none of them is imported."""
    return tuple(sorted({entry.name for entry in entry_points(group=GROUP)}))


def create(driver: str, options: Mapping[str, Any]) -> Grabber:
    """A grabber that is not opened yet.

    Raises:
        DriverMissing: no driver of that name is installed, or something that it needs is not.
        ValueError: an option is unknown, missing or cannot be used; the text says which.
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
            "install the driver's package anew",
        ) from error


def _check_names(driver: str, factory: Callable[..., Grabber], options: Mapping[str, Any]) -> None:
    signature = inspect.signature(factory)
    try:
        signature.bind(**options)
    except TypeError as error:
        known = ", ".join(signature.parameters) or "none"
        raise ValueError(f"driver '{driver}': {error}; its options are: {known}") from error
