"""Problems of the inputs of an analysis, all of them, before the points are looked at."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

from grabberd.errors import GrabberdError
from grabberd_liner.analysis import Grid, read_vacuum_log, read_zones
from grabberd_liner.chain.analysis.inputs import BY_LIGHT, CHANNEL, input_problems
from grabberd_liner.chain.analysis.vacuum_inputs import read_constant, read_lag, read_offset, read_wave

_LOG = "log"
_CHAMBERS = ("pulsation", "liner")


def check_inputs(document: Mapping[str, Any], grid: Grid, recorded: frozenset[str]) -> list[str]:
    """Problems of inputs in sentences; empty if an analysis can begin with them.

    Args:
        document: The inputs, completed.
        grid: Grid of the object model.
        recorded: Chambers whose vacuum was recorded with the capture.
    """
    problems = input_problems(document)
    material, vacuum = document.get("material"), document.get("vacuum")
    if isinstance(material, Mapping):
        problems += _refusals(lambda: read_zones(material, grid))
    if isinstance(vacuum, Mapping):
        problems += _of_vacuum(vacuum, recorded)
    return problems


def _of_vacuum(vacuum: Mapping[str, Any], recorded: frozenset[str]) -> Iterator[str]:
    for name in _CHAMBERS:
        if name in vacuum:
            yield from _of_chamber(name, vacuum[name], vacuum, recorded)
    if _LOG in vacuum:
        yield from _refusals(lambda: read_vacuum_log(vacuum[_LOG]))
    if "lag" in vacuum:
        yield from _refusals(lambda: read_lag(vacuum))
    if vacuum.get("offset") != BY_LIGHT:
        yield from _refusals(lambda: read_offset(vacuum))


def _of_chamber(
    name: str, value: object, vacuum: Mapping[str, Any], recorded: frozenset[str]
) -> Iterator[str]:
    if value == CHANNEL:
        if name not in recorded:
            yield f"vacuum.{name}: is to come from the capture's own channel, and it has none"
    elif value == _LOG:
        if _LOG not in vacuum:
            yield f"vacuum.{name}: is to come from a logger's file, and there is none"
        elif not {"offset", "lag"} & vacuum.keys():
            yield "vacuum: neither offset nor lag relates the logger's clock to the camera's"
    elif not isinstance(value, Mapping):
        yield f"vacuum.{name}: is {value!r}, expected a constant, a pulsator's settings, log or channel"
    elif "rate_per_min" in value:
        yield from _refusals(lambda: read_wave(value))
    else:
        yield from _refusals(lambda: read_constant(name, value))


def _refusals(read: Callable[[], object]) -> list[str]:
    """Refusals of a reader, in its words."""
    try:
        read()
    except GrabberdError as error:
        return [error.message]
    return []
